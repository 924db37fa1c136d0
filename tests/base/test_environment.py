"""Environment variables of the program: each wrong value is an error of one line, for every command."""

from __future__ import annotations

from pathlib import Path

import pytest

from gearfe.base.cache import cache_folder
from gearfe.base.environment import LIMIT, interpreted, limit
from gearfe.cli.main import main
from tests.places import GEOMETRY

JOB = str(GEOMETRY / "gear_train.toml")


@pytest.mark.parametrize(
    ("variable", "value", "message"),
    [
        ("GEARFE_CACHE", "~nobody-of-this-name/x", "a user that is unknown here"),
        ("GEARFE_CACHE", "cache", "must be an absolute path"),
        ("GEARFE_CACHE", __file__, "is a file"),
        ("GEARFE_CACHE_LIMIT_MB", "much", "must be a number >= 0"),
        ("GEARFE_CACHE_LIMIT_MB", "nan", "must be a number >= 0"),
        ("GEARFE_CACHE_LIMIT_MB", "-1", "must be a number >= 0"),
        ("GEARFE_CACHE_LIMIT_MB", "1e300", "<= 1e+12"),
        ("NUMBA_DISABLE_JIT", "yes", "must be 0 or 1"),
        ("NUMBA_NUM_THREADS", "0", "must be a whole number > 0"),
        ("NUMBA_NUM_THREADS", "-2", "must be a whole number > 0"),
        ("NUMBA_NUM_THREADS", "all", "must be a whole number > 0"),
        ("NUMBA_NUM_THREADS", "9" * 30, "must be a whole number > 0"),
        ("GEARFE_NO_NUMBA", "1", "was removed"),
    ],
)
@pytest.mark.parametrize("line", [["cache"], ["gear", JOB], ["study", "study.toml"]])
def test_wrong_values_are_refused(
    variable: str,
    value: str,
    message: str,
    line: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv(variable, value)
    assert main(line) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"gearfe: error: {variable} = '{value}': ")
    assert message in said
    assert said.count("\n") == 1


def test_values_that_are_left_empty_are_the_defaults(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("GEARFE_CACHE_LIMIT_MB", "NUMBA_DISABLE_JIT"):
        monkeypatch.setenv(name, "")
    assert limit() == LIMIT
    assert not interpreted()
    monkeypatch.setenv("GEARFE_CACHE_LIMIT_MB", "0.05")
    assert limit() == 50_000


def test_relative_folders_of_the_system_are_ignored(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The rule of the XDG base directories; compiled code is kept there, which must not come from a working folder."""
    monkeypatch.delenv("GEARFE_CACHE", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", "cache")
    folder = cache_folder()
    assert folder is not None
    assert folder.is_absolute()


def test_a_user_without_a_home_keeps_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def nowhere() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("GEARFE_CACHE", raising=False)
    monkeypatch.setattr(Path, "home", staticmethod(nowhere))
    assert cache_folder() is None
