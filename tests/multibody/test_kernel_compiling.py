"""Compiled kernels: named arrays as blocks, functions as parts of others."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import NamedTuple

import numpy as np
import pytest

from gearfe.base.typing import Array, IntArray
from gearfe.multibody.compiled import kernels as compiled
from gearfe.multibody.compiled.packed import Packed
from gearfe.multibody.compiled.simd import NAMES, SimdArray, flat, halves, highest, simd_copy, simd_zeros, total
from tests.makers.rigid_cases import by_scipy, pendulum
from tests.places import ROOT


class Inner(NamedTuple):
    weights: Array  # (n,)
    chosen: IntArray  # (m,)
    factor: float


class Outer(NamedTuple):
    cube: Array  # (a, b, c)
    inner: Inner
    count: int
    out: Array  # (b,)


def weighted(inner, cube, b):  # type: ignore[no-untyped-def]
    """factor sum_k w_k cube[chosen_k, b, k]."""
    total = 0.0
    for k in range(inner.chosen.shape[0]):
        total += inner.weights[k] * cube[inner.chosen[k], b, k]
    return inner.factor * total


def fill_out(outer):  # type: ignore[no-untyped-def]
    """out_b = the weighted sum of row b, `count` times."""
    for b in range(outer.out.shape[0]):
        outer.out[b] = 0.0
        for _ in range(outer.count):
            outer.out[b] += weighted(outer.inner, outer.cube, b)
    return outer.out.shape[0]


def sample() -> Outer:
    rng = np.random.default_rng(5)
    chosen = np.array([2, 0, 1, 2], dtype=np.int64)
    return Outer(rng.normal(size=(3, 5, 4)), Inner(rng.normal(size=4), chosen, 0.75), 3, np.zeros(5))


def test_a_block_reads_as_the_named_tuple_it_was_made_from(tmp_path, monkeypatch):
    monkeypatch.setenv("GEARFE_CACHE", str(tmp_path))
    names = compiled.bind((weighted, fill_out), {}, entries=("fill_out",))
    outer = sample()
    assert names.fill_out(Packed(outer)) == 5
    k = np.arange(4)
    rows = outer.cube[outer.inner.chosen, :, k]  # (4, 5)
    assert np.allclose(outer.out, 3 * 0.75 * outer.inner.weights @ rows, rtol=1e-14)


def test_parts_give_what_numba_alone_gives(tmp_path, monkeypatch):
    """One compilation with all parts in their entry against numba's own, each function for itself."""
    results = []
    for number, options in enumerate((None, {})):
        monkeypatch.setenv("GEARFE_CACHE", str(tmp_path / str(number)))
        if options is not None:
            monkeypatch.setattr(compiled, "part_options", lambda: {})
        names = compiled.bind((weighted, fill_out), {}, entries=("fill_out",))
        outer = sample()
        names.fill_out(Packed(outer))
        results.append(outer.out)
    assert np.allclose(*results, rtol=1e-15, atol=0.0)


def test_arrays_that_are_not_contiguous_or_of_another_type_are_refused():
    with pytest.raises(TypeError, match="weights: float64 array, C-contiguous: False"):
        Packed(Inner(np.zeros(8)[::2], np.zeros(2, dtype=np.int64), 1.0))
    with pytest.raises(TypeError, match="chosen: int32"):
        Packed(Inner(np.zeros(8), np.zeros(2, dtype=np.int32), 1.0))


def test_code_in_the_cache_is_found_by_another_process(tmp_path, monkeypatch):
    """With a block as argument, whose type another process makes anew."""
    monkeypatch.setenv("GEARFE_CACHE", str(tmp_path))
    told = [
        subprocess.run(
            [sys.executable, "-c", "from tests.multibody.test_kernel_compiling import hits; print(*hits())"],
            capture_output=True, text=True, check=True,
        ).stdout.split()
        for _ in range(2)
    ]  # fmt: skip
    assert told == [["1", "5"], ["0", "5"]]


def hits() -> tuple[int, int]:
    """Whether the compiler was needed; what the kernel returned."""
    names = compiled.bind((weighted, fill_out), {}, entries=("fill_out",))
    made = names.fill_out(Packed(sample()))
    return int("numba" in sys.modules), made


class Sides(NamedTuple):
    angles: SimdArray  # (n, 4)
    out: SimdArray  # (4, n, 4)
    wave: SimdArray  # (2, 2, 4)
    single: Array  # (3,)


def square_order(a, i, k):  # type: ignore[no-untyped-def]
    """Order k of a square: a sum that begins as a number and goes on as a SIMD vector."""
    value = 0.0
    for p in range(k + 1):
        value += a[i, p] * a[i, k - p]
    return value


def use_sides(sides):  # type: ignore[no-untyped-def]
    """Everything that kernels do with SIMD vectors."""
    angles, out, single = sides.angles, sides.out, sides.single
    for i in range(angles.shape[0]):
        x = angles[i]
        out[0, i] = np.sin(x)
        out[1, i] = np.cos(x)
        out[2, i] = np.maximum(-x, 2.0 - x / 3.0)
        out[2, i] -= abs(x) * 0.5
        out[3, i] = 1
    flat(out)[3, 1, 2] = flat(angles)[0, 3]
    single[0] = total(halves(angles)[0, 1])
    single[1] = highest(angles[1])
    single[2] = total(square_order(sides.wave, 1, 1))
    return angles.shape[0]


def test_simd_vectors_compute_as_arrays_do(tmp_path, monkeypatch):
    """Compiled against NumPy; sines and cosines within two roundings of 1 of the library's, far from zero, too."""
    monkeypatch.setenv("GEARFE_CACHE", str(tmp_path))
    rng = np.random.default_rng(8)
    angles = rng.normal(size=(60, 4)) * np.logspace(-8, 6, 60)[:, None]
    angles[2, 1] = np.nan
    angles[3] = np.array([0.5, 1.0, -1.5, 1e5]) * np.pi
    wave = rng.normal(size=(2, 2, 4))
    made = []
    for jit in (False, True):
        sides = Sides(simd_copy(angles), simd_zeros(4, 60, 4), simd_copy(wave), np.zeros(3))
        names = compiled.bind((square_order, use_sides), {**NAMES, "np": np}, entries=("use_sides",) if jit else ())
        assert names.use_sides(Packed(sides) if jit else sides) == 60
        made.append(sides)
    plain, quick = made
    np.testing.assert_allclose(quick.out[:2], plain.out[:2], rtol=0.0, atol=4.5e-16)
    np.testing.assert_allclose(quick.out[2:], plain.out[2:], rtol=1e-15)
    np.testing.assert_allclose(quick.single, plain.single, rtol=1e-14)
    np.testing.assert_allclose(plain.single[:2], [angles[0, 2:].sum(), angles[1].max()], rtol=1e-14)
    assert plain.single[2] == pytest.approx(2.0 * (wave[1, 0] * wave[1, 1]).sum(), rel=1e-14)
    assert np.isnan(quick.out[2, 2, 1])


STEPPED = """
import sys
import numpy as np
from gearfe.multibody import integrate
from tests.makers.rigid_cases import pendulum
for method in ("taylor", "implicit"):
    print(repr(integrate(pendulum(), [0.0, 0.2], method=method, tolerance=1e-9).q[-1, 2].item()))
assert "numba" not in sys.modules
"""


def test_kernels_run_as_python_where_numba_is_switched_off(tmp_path):
    """NUMBA_DISABLE_JIT: a debugger steps through them; no cache is written, the motion is that of compiled code."""
    env = {**os.environ, "NUMBA_DISABLE_JIT": "1", "GEARFE_CACHE": str(tmp_path), "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", STEPPED], env=env, capture_output=True, text=True, check=True)
    times = np.array([0.0, 0.2])
    exact = by_scipy(pendulum(), times)[0][-1, 2]
    assert [float(line) for line in done.stdout.split()] == pytest.approx([exact, exact], abs=1e-8)
    assert not list(tmp_path.rglob("kernels-*"))
