"""Commands on single meshes of a gearbox: --mesh, all of them, their folders."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gearfe.base.errors import InputError
from gearfe.base.tables.names import check_folders
from gearfe.cli.main import main
from gearfe.output.exchange.tables import read_csv
from tests.makers.gearboxes import MESHES, pair_text, text
from tests.places import GEOMETRY


@pytest.fixture
def box(tmp_path: Path) -> Path:
    (tmp_path / "box.toml").write_text(text())
    return tmp_path / "box.toml"


def test_each_mesh_has_its_folder_and_the_digits_of_its_pair(box: Path, tmp_path: Path, capsys) -> None:
    options = ["--no-estimate", "--no-pictures", "--json"]
    assert main(["stiffness", str(box), "--out", str(tmp_path / "all"), *options]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [Path(result["folder"]).name for result in told["results"]] == list(MESHES)
    (tmp_path / "pair.toml").write_text(pair_text("out", 30.0))
    assert main(["stiffness", str(tmp_path / "pair.toml"), "--out", str(tmp_path / "pair"), *options]) == 0
    own, pair = (read_csv(folder / "stiffness.csv") for folder in (tmp_path / "all" / "out", tmp_path / "pair"))
    assert own["k_mesh_N_per_m"].tolist() == pair["k_mesh_N_per_m"].tolist()
    summary = json.loads((tmp_path / "all" / "out" / "summary.json").read_text())
    assert list(summary["job"]["gears"]) == list(MESHES["out"])
    assert summary["job"]["mesh"]["name"] == "out"


def test_one_mesh_by_its_name(box: Path, tmp_path: Path, capsys) -> None:
    assert main(["loadmap", str(box), "--mesh", "out", "--torques-Nm", "20", "--positions", "3", "--no-pictures",
                 "--out", str(tmp_path / "map")]) == 0  # fmt: skip
    assert [path.name for path in (tmp_path / "map").iterdir()] == ["out"]
    assert main(["stiffness", str(box), "--mesh", "outt"]) == 2
    assert "--mesh: unknown name 'outt'; did you mean 'out'?" in capsys.readouterr().err
    assert main(["mesh", str(box), "--out", str(tmp_path / "m")]) == 2
    assert "the file has several: in, through, out" in capsys.readouterr().err


def test_a_mesh_of_a_train_beside_its_pair(tmp_path: Path) -> None:
    """A file with [pair] has the mesh of [pair] in the folder itself, as ever; those of its train have names, too."""
    job, out = str(GEOMETRY / "gear_train.toml"), tmp_path / "gear"
    assert main(["gear", job, "--out", str(out), "--no-pictures"]) == 0
    assert (out / "gear_pair.json").exists()
    assert main(["gear", job, "--out", str(out), "--no-pictures", "--mesh", "gear_3-gear_4"]) == 0
    one, two = (json.loads((folder / "gear_pair.json").read_text()) for folder in (out, out / "gear_3-gear_4"))
    assert one == two


def test_a_mistake_in_one_mesh_shows_before_the_first_is_computed(tmp_path: Path, capsys) -> None:
    (tmp_path / "box.toml").write_text(text(meshes__out__centre_distance_mm=68.0))
    assert main(["stiffness", str(tmp_path / "box.toml"), "--out", str(tmp_path / "o")]) == 2
    assert "meshes.out.centre_distance_mm = 68.0: " in capsys.readouterr().err
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize(
    ("named", "says"),
    [
        (("../../away", "b"), "letters, digits, _ and - only"),
        (("/away", "b"), "letters, digits, _ and - only"),
        (("a\\b", "c"), "letters, digits, _ and - only"),
        (("a" * 60, "b" * 60), "80 characters or less"),
    ],
)
def test_lists_of_a_train_name_no_folder_outside(named: tuple[str, str], says: str, tmp_path: Path, capsys) -> None:
    """Gears of [[train.gears]] may have any name; results of a mesh lie in the folder that --out names, or nowhere."""
    source = (GEOMETRY / "gear_train.toml").read_text()
    for old, new in zip(("gear_3", "gear_4"), named, strict=True):
        source = source.replace(f'"{old}"', json.dumps(new))
    (tmp_path / "in" / "deep").mkdir(parents=True)
    job = tmp_path / "in" / "deep" / "job.toml"
    job.write_text(source)
    out = tmp_path / "in" / "deep" / "out"
    assert main(["gear", str(job), "--out", str(out), "--no-pictures", "--mesh", "-".join(named)]) == 2
    assert says in capsys.readouterr().err
    assert sorted(path for path in tmp_path.rglob("*") if path.is_file()) == [job]


@pytest.mark.parametrize("names", [("CON", "b"), ("one", "One"), ("groß", "gross")])
def test_names_that_some_systems_cannot_keep_apart(names: tuple[str, str]) -> None:
    with pytest.raises(InputError, match=r"device on Windows|upper and lower case"):
        check_folders(names)
