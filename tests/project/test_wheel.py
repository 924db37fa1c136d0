"""The wheel in a fresh environment, from a folder outside the checkout: every command, with the extras and without."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import sysconfig
import tomllib
from importlib import metadata
from pathlib import Path

import pytest

from gearfe.cli import COMMANDS
from tests.places import ROOT

pytestmark = pytest.mark.slow

#: A line a command, in this order.
LINES = """
new stiffness pair.toml
new loadmap map.toml
new relief.toml
new study study.toml
new vibration gearbox.toml
new runup runup.toml
new mechanism crank.toml
new housing housing.toml
new box.toml
gear pair.toml --export csv,step,brep
stiffness pair.toml --fields 5 --angles 1 4 9 --coarsen 3 --report --format npz,h5,mat
compare out/pair/stiffness out/pair/stiffness/stiffness.csv
report pair.toml
loadmap map.toml --positions 4 --set stiffness.coarsen=3 --set stiffness.torque_Nm=50
loadmap relief.toml --set stiffness.coarsen=3 --torques-Nm 50
study relief.toml --set study.cases=8 --set microgeometry.positions=4 --jobs 1 --no-pictures
mesh pair.toml --deck --teeth 2 --coarsen 4
mechanism crank.toml --until 0.2 --report
housing box.toml --json
vibration gearbox.toml --set train.housing=rigid --set train.duration_ms=1.0
vibration box.toml --set train.duration_ms=0.5 --set housing.reduction.least_modes=6 \
--set train.curves.mesh_model=mean_stiffness
modes runup.toml --set train.housing=rigid --speeds 3
runup runup.toml --set train.housing=rigid --set runup.speeds=3 --set runup.speed_stop_rad_per_s=320
study study.toml --set study.cases=2
cache
completion bash
"""


def closure(extras: tuple[str, ...]) -> dict[str, metadata.Distribution]:
    """Distributions that the project needs with these extras."""
    with (ROOT / "pyproject.toml").open("rb") as stream:
        project = tomllib.load(stream)["project"]
    wanted = [*project["dependencies"], *(line for name in extras for line in project["optional-dependencies"][name])]
    found: dict[str, metadata.Distribution] = {}
    while wanted:
        line = wanted.pop()
        if "extra ==" in line:
            continue
        name = re.sub(r"[-_.]+", "-", re.split(r"[\s<>=!;\[(~]", line, maxsplit=1)[0]).lower()
        if name in found:
            continue
        try:
            found[name] = metadata.distribution(name)
        except metadata.PackageNotFoundError:  # for another system or version of Python
            continue
        wanted += found[name].requires or []
    return found


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("hatchling", reason="pip install 'gearfe[dev]'")
    folder = tmp_path_factory.mktemp("wheel")
    line = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "-w", str(folder)]
    subprocess.run([*line, str(ROOT)], check=True, capture_output=True)
    return next(folder.glob("*.whl"))


def environment(folder: Path, wheel: Path, extras: tuple[str, ...]) -> Path:
    """Program ``gearfe`` of an environment that holds the wheel and what it needs, and nothing else."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    python = folder / "bin" / "python"
    ask = "import sysconfig; print(sysconfig.get_path('purelib'))"
    here = Path(subprocess.run([python, "-c", ask], check=True, capture_output=True, text=True).stdout.strip())
    there = Path(sysconfig.get_path("purelib"))
    for found in closure(extras).values():
        for top in {Path(str(file)).parts[0] for file in found.files or ()} - {"..", "__pycache__"}:
            if not (here / top).exists():
                (here / top).symlink_to(there / top)
    line = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", "--no-deps", str(wheel)]
    subprocess.run(line, check=True, capture_output=True)
    return folder / "bin" / "gearfe"


def run(program: Path, folder: Path, line: str) -> subprocess.CompletedProcess[str]:
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "GEARFE"))}
    clean["GEARFE_CACHE"] = str(folder / "cache")
    return subprocess.run(
        [program, *line.split()], cwd=folder, env=clean, capture_output=True, text=True, check=False, timeout=600
    )


@pytest.mark.skipif(os.name == "nt", reason="links and folders as on Linux and macOS")
@pytest.mark.parametrize("extras", [(), ("fields", "fast")], ids=["lean", "all"])
def test_every_command_of_the_wheel(extras: tuple[str, ...], wheel: Path, tmp_path: Path) -> None:
    program = environment(tmp_path / "env", wheel, extras)
    folder = tmp_path / "work"
    folder.mkdir()
    lines = LINES.strip().splitlines()
    assert {line.split()[0] for line in lines} == set(COMMANDS)
    for line in lines:
        done = run(program, folder, line)
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
        assert "Traceback" not in done.stderr, line
        assert extras or line.split()[0] != "housing" or "pip install 'gearfe[fields]'" in done.stdout + done.stderr
    for name in COMMANDS:
        assert "usage" in run(program, folder, f"{name} --help").stdout
    assert (folder / "out/pair/stiffness/tables.mat").exists()
    assert "<img" in (folder / "out/crank/mechanism/report.html").read_text(encoding="utf-8")


def test_a_missing_extra_is_named_with_its_line(wheel: Path, tmp_path: Path) -> None:
    program = environment(tmp_path / "env", wheel, ())
    run(program, tmp_path, "new stiffness pair.toml")
    for line in (
        "gear pair.toml --export dxf",
        "stiffness pair.toml --angles 1 4 5 --coarsen 3 --no-estimate --format uff",
    ):
        done = run(program, tmp_path, line)
        assert done.returncode == 2
        assert "pip install 'gearfe[exchange]'" in done.stderr
