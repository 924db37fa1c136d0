"""Mesh cache and gmsh session: stored once, read back, never trusted when damaged."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from gearfe.base.cache import LOOK, cache_folder, cache_key, cached_arrays, entries, kept, trim
from gearfe.base.errors import MissingLibraryError
from gearfe.cli.main import main
from gearfe.fem.meshing import session


@dataclasses.dataclass(frozen=True)
class Recipe:
    size_mm: float
    order: int = 2


def test_made_once_then_read(tmp_path: Path) -> None:
    calls: list[int] = []

    def make() -> dict[str, np.ndarray]:
        calls.append(1)
        return {"points": np.arange(12.0).reshape(4, 3), "tets": np.array([[0, 1, 2, 3]])}

    first = cached_arrays("thing", Recipe(3.0), make, tmp_path)
    second = cached_arrays("thing", Recipe(3.0), make, tmp_path)
    assert len(calls) == 1
    assert set(second) == {"points", "tets"}
    for name in first:
        np.testing.assert_array_equal(first[name], second[name])
        assert first[name].dtype == second[name].dtype
    cached_arrays("thing", Recipe(3.0, order=1), make, tmp_path)
    assert len(calls) == 2


@pytest.mark.parametrize("damage", ["cut", "rubbish", "flip", "empty", "other key"])
def test_damaged_file_is_ignored_and_rewritten(tmp_path: Path, damage: str) -> None:
    recipe = {"a": 1.0}
    cached_arrays("thing", recipe, lambda: {"x": np.arange(1000.0)}, tmp_path)
    (path,) = tmp_path.iterdir()
    data = bytearray(path.read_bytes())
    if damage == "cut":
        path.write_bytes(bytes(data[: len(data) // 2]))
    elif damage == "rubbish":
        path.write_bytes(b"not a zip file")
    elif damage == "empty":
        path.write_bytes(b"")
    elif damage == "flip":
        data[len(data) // 2] ^= 0xFF
        path.write_bytes(bytes(data))
    else:
        np.savez(path, _key=np.array("someone else"), x=np.zeros(3))
    again = cached_arrays("thing", recipe, lambda: {"x": np.arange(1000.0)}, tmp_path)
    np.testing.assert_array_equal(again["x"], np.arange(1000.0))
    stored = cached_arrays("thing", recipe, lambda: pytest.fail("made again"), tmp_path)
    np.testing.assert_array_equal(stored["x"], np.arange(1000.0))
    assert len(list(tmp_path.iterdir())) == 1


def test_unwritable_folder_costs_only_the_storing(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("a file, not a folder")
    assert cached_arrays("thing", 1, lambda: {"x": np.ones(2)}, blocked)["x"].sum() == 2.0


def test_key_sees_every_digit_and_the_class() -> None:
    assert cache_key("k", Recipe(1.0)) != cache_key("k", Recipe(1.0 + 1e-15))
    assert cache_key("k", Recipe(1.0)) == cache_key("k", Recipe(1.0))
    assert cache_key("k", np.zeros(3)) != cache_key("k", np.zeros(4))
    with pytest.raises(TypeError, match="plain data"):
        cache_key("k", object())


def test_the_first_of_two_processes_wins(tmp_path: Path) -> None:
    """What another process kept meanwhile is what both go on with."""
    other = {"x": np.arange(3.0)}

    def slowly() -> dict[str, np.ndarray]:
        cached_arrays("thing", 1, lambda: other, tmp_path)
        return {"x": np.nextafter(other["x"], 9.0)}

    np.testing.assert_array_equal(cached_arrays("thing", 1, slowly, tmp_path)["x"], other["x"])
    np.testing.assert_array_equal(cached_arrays("thing", 1, slowly, tmp_path)["x"], other["x"])


def test_the_entries_used_last_stay(tmp_path: Path) -> None:
    """Beyond the limit, what was not used for longest goes; other files of the folder are left alone."""
    for number in range(10):
        cached_arrays("thing", number, lambda: {"x": np.zeros(1000)}, tmp_path)
        path = tmp_path / f"thing-{cache_key('thing', number)[:32]}.npz"
        os.utime(path, (1e9 + number, 1e9 + number))
    (tmp_path / "notes.txt").write_text("mine")
    size = entries(tmp_path)[0].size
    cached_arrays("thing", 0, lambda: pytest.fail("made again"), tmp_path)  # used now
    assert trim(tmp_path, 10 * size) == []
    gone = trim(tmp_path, 5 * size)
    assert [round(entry.used - 1e9) for entry in gone] == [1, 2, 3, 4, 5, 6]
    assert len(entries(tmp_path)) == 4
    assert (tmp_path / "notes.txt").exists()
    cached_arrays("thing", 0, lambda: pytest.fail("went"), tmp_path)


def test_a_new_entry_keeps_the_size_below_the_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEARFE_CACHE_LIMIT_MB", "0.05")
    keys = [f"{number * LOOK:08x}" + "0" * 24 for number in range(1, 20)]  # each looks at the size
    for key in keys:
        kept(
            "text", key, read=Path.read_text, make=lambda: "x" * 5000, folder=tmp_path,
            write=lambda text, path: path.write_text(text),
        )  # fmt: skip
    assert sum(entry.size for entry in entries(tmp_path)) <= 50_000


def test_arrays_that_would_push_out_the_others_are_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEARFE_CACHE_LIMIT_MB", "1")
    for number, count in enumerate((12_000, 13_000)):  # of 8 bytes each: below and above a tenth
        assert len(cached_arrays("thing", number, partial(dict, x=np.zeros(count)), tmp_path)["x"]) == count
    (entry,) = entries(tmp_path)
    assert 90_000 < entry.size < 100_000


def test_command_tells_and_cleans(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setenv("GEARFE_CACHE", str(tmp_path))
    cached_arrays("thing", 1, lambda: {"x": np.zeros(1000)})
    cached_arrays("other", 1, lambda: {"x": np.zeros(1000)})
    assert main(["cache"]) == 0
    assert "2 entries" in capsys.readouterr().out
    assert main(["cache", "--clean", "thng"]) == 2
    assert "did you mean 'thing'" in capsys.readouterr().err
    assert main(["cache", "--clean", "--compile"]) == 2
    assert "not allowed with" in capsys.readouterr().err
    assert main(["cache", "--clean", "thing"]) == 0
    assert [entry.kind for entry in entries(tmp_path)] == ["other"]
    assert main(["cache", "--clean"]) == 0
    assert entries(tmp_path) == []
    monkeypatch.setenv("GEARFE_CACHE", "off")
    assert main(["cache"]) == 0
    assert "nothing is kept" in capsys.readouterr().out


def test_folder_from_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("GEARFE_CACHE", str(tmp_path))
    assert cache_folder() == tmp_path
    monkeypatch.setenv("GEARFE_CACHE", "off")
    assert cache_folder() is None
    monkeypatch.delenv("GEARFE_CACHE")
    folder = cache_folder()
    assert folder is not None
    assert folder.name == "gearfe"


def test_session_leaves_nothing_behind_even_after_an_error() -> None:
    gmsh = session.import_gmsh()

    def fail() -> None:
        with session.gmsh_session() as inner:
            assert inner.isInitialized()
            raise RuntimeError("inside")

    with pytest.raises(RuntimeError, match="inside"):
        fail()
    assert not gmsh.isInitialized()


def test_session_inside_someone_elses_gmsh() -> None:
    gmsh = session.import_gmsh()
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("theirs")
        with session.gmsh_session("ours"):
            assert gmsh.model.getCurrent() == "ours"
        assert gmsh.isInitialized()
        assert "theirs" in gmsh.model.list()
        assert "ours" not in gmsh.model.list()
    finally:
        gmsh.finalize()


def test_missing_system_library_names_the_packages(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "gmsh.py").write_text("raise OSError('libGLU.so.1: cannot open shared object file')")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "gmsh", raising=False)
    with pytest.raises(MissingLibraryError, match="libglu1-mesa"):
        session.import_gmsh()


def test_cache_module_imports_no_mesher() -> None:
    code = "import sys, gearfe.base.cache; assert not {'gmsh', 'meshio', 'skfem'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
