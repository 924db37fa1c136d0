"""Compiled kernels in the cache: where they are kept, for whom, and what is said about them."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from gearfe.base.typing import Array
from gearfe.multibody.compiled import kernels as compiled
from gearfe.multibody.compiled.object_code import Entry
from gearfe.multibody.compiled.packed import Layout, Packed
from tests.places import GEOMETRY, ROOT

KERNELS = """
def doubled(x):
    return 2.0 * x


def entry(numbers):
    numbers.out[0] = doubled(numbers.x) + 1.0
    return 0
"""
#: Runs the kernel and says: was it told to be in the cache, is it now, did the run without the compiler.
RUN = """
import sys
sys.path.insert(0, sys.argv[1])
import little_kernels as k
import numpy as np
from typing import Any, NamedTuple
from gearfe.multibody.compiled import kernels as compiled
from gearfe.multibody.compiled.packed import Packed
class Numbers(NamedTuple):
    x: float
    out: Any
functions = (k.doubled, k.entry)
before = compiled.is_cached(functions, "entry")
bound = compiled.bind(functions, {}, entries=("entry",))
numbers = Numbers(3.0, np.zeros(1))
assert bound.entry(Packed(numbers)) == 0 and numbers.out[0] == 7.0
print(before, compiled.is_cached(functions, "entry"), int("numba" not in sys.modules))
"""


def installed(folder: Path) -> Path:
    folder.mkdir()
    (folder / "little_kernels.py").write_text(KERNELS)
    return folder


def ran(source: Path, **environment: str) -> str:
    env = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    done = subprocess.run([sys.executable, "-c", RUN, str(source)], env=env, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_installations_of_the_same_kernels_share_them_and_others_do_not(tmp_path: Path) -> None:
    one, two, cache = installed(tmp_path / "one"), installed(tmp_path / "two"), tmp_path / "cache"
    assert ran(one, GEARFE_CACHE=str(cache)) == "False True 0"
    assert ran(two, GEARFE_CACHE=str(cache)) == "True True 1"
    (two / "little_kernels.py").write_text(KERNELS.replace("2.0 * x", "x + x"))
    assert ran(two, GEARFE_CACHE=str(cache)) == "False True 0"
    cache.rename(tmp_path / "moved")
    assert ran(one, GEARFE_CACHE=str(tmp_path / "moved")) == "True True 1"


def test_code_that_was_cut_short_is_made_anew(tmp_path: Path) -> None:
    source, cache = installed(tmp_path / "one"), tmp_path / "cache"
    assert ran(source, GEARFE_CACHE=str(cache)) == "False True 0"
    (kept,) = cache.rglob("*.o")
    whole = kept.read_bytes()
    for left in (whole[:-8], whole[:40], b""):
        kept.write_bytes(left)
        assert ran(source, GEARFE_CACHE=str(cache)) == "True True 0"
        assert ran(source, GEARFE_CACHE=str(cache)) == "True True 1"


def test_without_a_cache_nothing_is_kept(tmp_path: Path) -> None:
    source = installed(tmp_path / "one")
    assert ran(source, GEARFE_CACHE="off", XDG_CACHE_HOME=str(tmp_path / "user")) == "False False 0"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["one"]
    assert not list(source.rglob("*.o"))


def test_the_variable_governs_where_kernels_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    functions = (compiled.interpreted,)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    monkeypatch.setenv("GEARFE_CACHE", str(tmp_path / "named"))
    named = compiled.cache_folder(functions)
    assert named is not None
    assert named.parent == tmp_path / "named"
    monkeypatch.setenv("GEARFE_CACHE", "off")
    assert compiled.cache_folder(functions) is None
    monkeypatch.delenv("GEARFE_CACHE")
    folder = compiled.cache_folder(functions)
    assert folder is not None
    if sys.platform == "linux":
        assert folder.parent == tmp_path / "user" / "gearfe"


def test_another_compiler_or_processor_needs_kernels_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GEARFE_CACHE", str(tmp_path))
    here = compiled.cache_folder((compiled.interpreted,))
    monkeypatch.setenv("NUMBA_CPU_NAME", "generic")
    assert compiled.cache_folder((compiled.interpreted,)) != here


def test_constants_of_other_modules_are_in_the_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Numbers, enumerations and arrays that are compiled in; a tuple of functions differs from process to process."""
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "using_kernels.py").write_text(
        "from other_constants import CODE, KIND, TABLE, CALLS\n"
        "def f(x):\n    return x * CODE + KIND.one.value + TABLE[0] + CALLS[0](x)\n"
    )
    keys = []
    for code, kind, table in ((1, 1, 1.0), (1, 1, 1.0), (2, 1, 1.0), (1, 2, 1.0), (1, 1, 2.0)):
        (tmp_path / "other_constants.py").write_text(
            "from enum import Enum\nimport numpy as np\n"
            f"CODE = {code}\nTABLE = np.array([{table}])\nCALLS = (lambda x: x,)\n"
            f"class KIND(Enum):\n    one = {kind}\n"
        )
        script = (
            "import sys, using_kernels as u\nfrom gearfe.multibody.compiled import kernels\n"
            "print(kernels._key((u.f,), ()))"
        )
        made = subprocess.run(
            [sys.executable, "-B", "-c", script], cwd=tmp_path, env={**os.environ, "PYTHONPATH": f"{tmp_path}:{ROOT}"},
            check=True, capture_output=True, text=True,
        )  # fmt: skip
        keys.append(made.stdout)
    assert keys[0] == keys[1]
    assert len(set(keys)) == 4


@pytest.mark.slow
def test_a_command_compiles_them(tmp_path: Path) -> None:
    """The first run says that it compiles; one after the command does not."""
    env = {**os.environ, "PYTHONPATH": str(ROOT), "GEARFE_CACHE": str(tmp_path / "cache")}
    andrews = ["mechanism", str(GEOMETRY / "andrews.toml"), "--no-pictures", "--out", str(tmp_path / "out")]

    def said(*command: str) -> str:
        line = [sys.executable, "-m", "gearfe", *command]
        return subprocess.run(line, env=env, check=True, capture_output=True, text=True).stderr

    assert "compiling the kernels" in said("cache", "--compile")
    assert "compiling" not in said(*andrews)


class Numbers(NamedTuple):
    """One array, as a block."""

    out: Array


class Read(Entry):
    """An entry without machine code: it takes the addresses of its blocks."""

    def _link(self, layouts: tuple[Layout, ...]) -> Callable[..., int]:
        return lambda *addresses: len(addresses)


def test_a_bound_call_keeps_the_memory_of_its_blocks() -> None:
    """Machine code has only addresses: with the block freed before the call it wrote into others' memory."""
    entry = Read("entry", None, lambda _: pytest.fail("nothing is compiled"))
    block = Packed(Numbers(np.zeros(1)))
    alive = weakref.ref(block)
    run = entry.on(block)
    del block
    gc.collect()
    assert alive() is not None
    assert run() == 1
    del run
    gc.collect()
    assert alive() is None


@pytest.mark.skipif(sys.platform != "linux", reason="other systems allow text only")
def test_a_folder_whose_name_is_no_text_holds_kernels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Linux allows any bytes in names; Python hands them on as lone surrogates, which UTF-8 does not encode."""
    folder = tmp_path / os.fsdecode(b"\xff\xfe")
    monkeypatch.setenv("GEARFE_CACHE", str(folder))
    kept = compiled.cache_folder((compiled.interpreted,))
    assert kept is not None
    assert kept.parent == folder
