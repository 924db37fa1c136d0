r"""Friction of a mesh with a law: Coulomb's, pair by pair, from the normal force and the sliding speed.

Tooth pair k touches on the line of action at P + e_k n, P the pitch point, :math:`e_k = r_{b1}(\psi_k - \psi_C)`,
:math:`\psi_C` the phase at which a pair passes P. There the driver's flank slides on the driven one, along q = a x n,
with

.. math:: v_k = q\cdot\big(\dot u_1(P) - \dot u_2(P)\big) + e_k\,(\Omega_1 - \Omega_2) ,

:math:`\Omega` the whole speeds about the axis a: rolling gears slide with :math:`e_k(\Omega_1 - \Omega_2)`. The
friction on the driver is :math:`-\mu N_k s(v_k/v_0)\,q`, on the driven gear its opposite. :math:`N_k` is the pair's
normal force, damping included. The sign is :math:`s(x) = x\,(15 - 10 x^2 + 3 x^4)/8` within :math:`\pm 1`, and
:math:`\pm 1` beyond. It is a polynomial between two borders at which steps end; a function such as tanh has terms that
show too late in a series. As :math:`v_k` belongs to this force, the loss is :math:`\sum \mu N_k v_k s(v_k/v_0) \ge 0`
whatever the motion. The pair's place is that on the path of contact: beyond its ends, where edges bear, the lever arms
are some per cent off.

:math:`\mu` is given, or the mean coefficient along the path by Schlenk (ISO/TR 14179-2:2001; Niemann and Winter,
Maschinenelemente II):

.. math:: \mu = 0.048\,\Big(\frac{F_{bt}/b}{v_{\Sigma C}\,\rho_{redC}}\Big)^{0.2} \eta^{-0.05} R_a^{0.25} X_L

with F_bt/b in N/mm (150 at least), the sum of the surface speeds at P :math:`v_{\Sigma C} = 2 v_t\sin\alpha_w` in m/s
(v_t 50 at most), the reduced radius of curvature there in mm, the oil's viscosity in mPa s, and the mean roughness of
both flanks in um.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array, IntArray
from ...gears.geometry.pair import MeshGeometry

#: Largest coefficient that is no slip of the pen.
MOST = 0.5
#: v0: the sliding speed so many base pitches from the pitch point, at the largest speed of the drive ...
NEAR = 0.02
#: ... and where the drive stands still (m/s).
CREEP = 2e-3
#: In place of the range of a smoothed sign: not known.
UNKNOWN = 2
#: Range of the formula: least load of a width (N/m), largest speed of the pitch circles (m/s).
LEAST_LOAD, FASTEST = 150e3, 50.0


def smooth_sign(x: Array) -> tuple[Array, Array]:
    """s(x) and its slope, see the module's docstring."""
    inside = np.clip(x, -1.0, 1.0)
    square = inside * inside
    return inside * (15.0 - square * (10.0 - 3.0 * square)) / 8.0, 1.875 * (1.0 - square) ** 2


def product(j: int, a: int, b: int, memory: Array) -> float:
    """Return order j of the product of two series by Cauchy's rule, sum_k a_k b_(j-k).

    Parameters
    ----------
    j : int
        Order.
    a, b : int
        Rows of the factors.
    memory : ndarray, shape (rows, orders)
        Series over x.
    """
    value = 0.0
    for k in range(j + 1):
        value += memory[a, k] * memory[b, j - k]
    return value


def smoothed_sign(j: int, x: int, row: int, piece: int, memory: Array, pieces: IntArray) -> None:
    """Write order j of the smoothed sign s(x), and of its factors x^2 and s/x, into three rows.

    Parameters
    ----------
    j : int
        Order.
    x : int
        Row of the argument, v/v0.
    row : int
        Row of s(x); x^2 and s/x are in the next two.
    piece : int
        Place of the range of x among the pieces: -1, 0 (within +-1) or 1. `UNKNOWN` is resolved from x at order 0.
    memory : ndarray, shape (rows, orders)
        Series over the step.
    pieces : ndarray of int, shape (whole numbers,)
        Cells that the flanks are on.
    """
    if j == 0 and pieces[piece] == UNKNOWN:
        pieces[piece] = 1 if memory[x, 0] > 1.0 else -1 if memory[x, 0] < -1.0 else 0
    if pieces[piece] != 0:
        memory[row, j] = float(pieces[piece]) if j == 0 else 0.0
        return
    memory[row + 1, j] = product(j, x, x, memory)
    inner = 0.375 * product(j, row + 1, row + 1, memory) - 1.25 * memory[row + 1, j]
    memory[row + 2, j] = inner + 1.875 if j == 0 else inner
    memory[row, j] = product(j, x, row + 2, memory)


@dataclass(frozen=True)
class Lubrication:
    """What the mean coefficient of friction by Schlenk follows from.

    Parameters
    ----------
    viscosity
        Dynamic, of the oil at its temperature in the mesh (Pa s).
    roughness
        Mean Ra of both gears' flanks (m).
    oil_factor
        X_L, 1 for mineral oils.
    """

    viscosity: float
    roughness: float
    oil_factor: float = 1.0

    def coefficient(self, pair: MeshGeometry, force: float, speed: float) -> float:
        """Mean coefficient of a pair under a mesh force (N), the pinion turning with a speed (rad/s).

        Raises
        ------
        InputError
            For gears at rest, for which the formula gives no coefficient.
        """
        if not abs(speed) > 0.0:
            problem = "cannot be computed: the gears do not rotate"
            raise InputError("coefficient of friction", None, problem, "give the coefficient itself")
        one, two, sine = pair.pinion_working_radius, pair.wheel_working_radius, math.sin(pair.working_pressure_angle)
        width = min(pair.pinion.face_width, pair.wheel.face_width)
        load = max(abs(force) / width, LEAST_LOAD)
        sum_speed = 2.0 * min(abs(speed) * one, FASTEST) * sine
        radius = one * two * sine / (one + two)
        base = (1e-3 * load / (sum_speed * 1e3 * radius)) ** 0.2
        film = (1e3 * self.viscosity) ** -0.05 * (1e6 * self.roughness) ** 0.25
        return 0.048 * base * film * self.oil_factor


@dataclass(frozen=True)
class Sliding:
    """Friction of a flank, for `gearfe.drivetrain.train.forces`.

    Attributes
    ----------
    coefficient, speed
        mu; v0 (m/s).
    across, spin
        Numbers of the directions of the displacement of P along q and of the driver's turn against the driven gear.
    ratio
        The driver's ratio to the drive less the driven gear's.
    radius, pitch_phase
        r_b1 (m); psi_C (rad).
    arm
        Lever arm (m) of a force along q at P about the driver's axis.
    """

    coefficient: float
    speed: float
    across: int
    spin: int
    ratio: float
    radius: float
    pitch_phase: float
    arm: float


def check_friction(label: str, friction: float | Lubrication, has_law: bool) -> None:
    """Raise `InputError` for friction out of range, or of a mesh whose tooth pairs are not known."""
    if isinstance(friction, Lubrication):
        for name, unit in (("viscosity", "Pa s"), ("roughness", "m"), ("oil_factor", "")):
            value = getattr(friction, name)
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"{label} {name}", value, f"must be finite and > 0 {unit}".rstrip(), "see Lubrication")
    elif not (math.isfinite(friction) and 0.0 <= friction <= MOST):
        cure = "0.03 to 0.08 is usual for lubricated steel gears"
        raise InputError(f"{label} friction", friction, f"must be 0 to {MOST:g}", cure)
    if friction != 0.0 and not has_law:
        problem = "needs a mesh law of tooth pairs: neither a stiffness nor a law over the face width has their forces"
        cure = 'write mesh_model = "potential" for loads alike along the width, or leave friction out'
        raise InputError(f"{label} friction", None, problem, cure)
