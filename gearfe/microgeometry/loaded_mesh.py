r"""A loaded pair with its deviations: transmission error, load sharing, pressure and root stress over angle and torque.

The transmission error is the wheel's lag on the line of action, :math:`r_{b2}` (twist - lost motion): unloaded that of
the rigid flanks, :math:`\min_k t_k(\psi)`, loaded with what the teeth yield. Material out of the driving flanks makes
the wheel lead, so it counts negative. An order is so many times a turn of the pinion; the mesh has the order
:math:`z_1`.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..gear.pair import GearPair
from ..gear.validity import MOST_OVERLAP, overlaps
from ..shown import Shown
from ..typing import Array, BoolArray, IntArray

#: Status of a cell whose back flanks would bear: gears that jam carry the torque on both flanks, which this is not for.
BACK = "back_flanks_bear"


@dataclass(frozen=True)
class PairLoads:
    """Tooth pairs that carry load, q of them over all cells.

    Attributes
    ----------
    torque, angle : ndarray, shape (q,)
        Numbers of the torque and of the pinion angle.
    pair : ndarray, shape (q,)
        Pair number k: pinion tooth k, wheel tooth -1 - k, counted on round the gears.
    force : ndarray, shape (q,)
        On the whole width (N).
    share : ndarray, shape (q,)
        Share of the wheel's torque (-).
    roll : ndarray, shape (q, 2)
        Roll lengths of the middle of the contact on pinion and wheel (m); not-a-number off the involutes.
    half_width, pressure : ndarray, shape (q,)
        Half width (m), and peak pressure of the elliptic contact of that force and half width (Pa); where an edge bears
        (`mark`) the blunted figure of `gearfe.stiffness.contact_pressure`.
    mark : ndarray of str, shape (q,)
        Edge that the pressure reaches, see `gearfe.contact.half_plane_pair.HalfPlanePair.marks`, or nothing.
    """

    torque: IntArray
    angle: IntArray
    pair: IntArray
    force: Array
    share: Array
    roll: Array
    half_width: Array
    pressure: Array
    mark: NDArray[np.str_]


@dataclass(frozen=True, repr=False)
class LoadedMesh(Shown):
    """Results over m torques and n pinion angles.

    Attributes
    ----------
    torque : ndarray, shape (m,)
        At the wheel's hub (N m).
    pinion_angle : ndarray, shape (n,)
        rad.
    mesh_cycles
        Mesh cycles that the angles divide into equal steps; 0 where they do not.
    twist, torque_pinion, tangent : ndarray, shape (m, n)
        Twist since unmodified flanks touch (rad), torque at the pinion's hub (N m), d torque/d twist (N m/rad).
    twist_unloaded : ndarray, shape (n,)
        Twist at which the rigid flanks touch, from there (rad).
    twist_unloaded_back : ndarray, shape (n,), or None
        The same of the back flanks, > 0 where they lie behind those without deviations.
    back_clearance : ndarray, shape (m, n), or None
        Normal clearance (m) of the back flanks, unloaded themselves; < 0 where they would bear.
    status : ndarray of str, shape (m, n)
        ``converged``, or why there are no numbers: `BACK`, or what the search for the torque says.
    pairs
        Loaded tooth pairs.
    root_stress : ndarray, shape (m, n, 2), or None
        Largest tension at the tooth roots of pinion and wheel (Pa).
    pair
        The gears.
    """

    torque: Array
    pinion_angle: Array
    mesh_cycles: int
    twist: Array
    torque_pinion: Array
    tangent: Array
    twist_unloaded: Array
    twist_unloaded_back: Array | None
    back_clearance: Array | None
    status: NDArray[np.str_]
    pairs: PairLoads
    root_stress: Array | None
    pair: GearPair

    def facts(self) -> dict[str, str]:
        """Torques, angles and transmission error."""
        error = 1e6 * self.peak_to_peak
        return {
            "gears": f"{self.pair.pinion.teeth}/{self.pair.wheel.teeth} teeth",
            "torques": f"{len(self.torque)}, {self.torque[0]:.4g} to {self.torque[-1]:.4g} N m at the wheel",
            "pinion angles": f"{len(self.pinion_angle)} over {self.span}",
            "transmission error": f"peak to peak {error[0]:.3g} to {error[-1]:.3g} um",
        }

    @property
    def span(self) -> str:
        """What the angles run over, in words."""
        return "1 mesh cycle" if self.mesh_cycles == 1 else f"{self.mesh_cycles} mesh cycles"

    @property
    def transmission_error(self) -> Array:
        """Loaded transmission error (m), shape (m, n)."""
        return self.twist * self.pair.wheel.base_radius

    @property
    def transmission_error_unloaded(self) -> Array:
        """Unloaded transmission error (m), shape (n,)."""
        return self.twist_unloaded * self.pair.wheel.base_radius

    @property
    def peak_to_peak(self) -> Array:
        """Peak-to-peak loaded transmission error (m), shape (m,)."""
        return np.asarray(np.ptp(self.transmission_error, axis=1))

    @property
    def failed(self) -> BoolArray:
        """Cells without numbers, shape (m, n)."""
        return self.status != "converged"

    @property
    def beyond_validity(self) -> IntArray:
        """1 where flanks overlap by more than the law holds for, -1 where failed, shape (m, n)."""
        return np.where(self.failed, -1, overlaps(self.pair, self.twist) > MOST_OVERLAP)

    @property
    def statuses(self) -> dict[str, int]:
        """How many cells have which status."""
        return dict(Counter(map(str, self.status.ravel())))

    def load_share(self) -> tuple[IntArray, Array]:
        """Leading pair of each angle, shape (n,), and the shares of it and of the pairs behind it, shape (m, n, p)."""
        own, shape = self.pairs, self.twist.shape
        leading = np.full(shape[1], np.iinfo(np.int64).min)
        np.maximum.at(leading, own.angle, own.pair)
        slot = leading[own.angle] - own.pair
        shares = np.zeros((*shape, int(slot.max(initial=0)) + 1))
        np.add.at(shares, (own.torque, own.angle, slot), own.share)
        shares[self.failed] = np.nan
        return np.where(leading == np.iinfo(np.int64).min, 0, leading), shares

    def largest_pressure(self) -> tuple[Array, Array]:
        """Largest pressure (Pa) of smooth contacts and where an edge bears, shape (m, n); not-a-number without one."""
        own, made = self.pairs, []
        for edge in (False, True):
            rows = (own.mark != "") == edge
            most = np.full(self.twist.shape, -np.inf)
            np.maximum.at(most, (own.torque[rows], own.angle[rows]), own.pressure[rows])
            made.append(np.where(np.isfinite(most), most, np.nan))
        return made[0], made[1]

    def spectrum(self, *, unloaded: bool = False) -> tuple[Array, Array]:
        """Orders, shape (k,), and one-sided amplitudes (m) of the transmission error, shape (m, k) or (k,).

        Raises
        ------
        InputError
            Where the angles are no equal steps over whole mesh cycles.
        """
        if not self.mesh_cycles:
            raise InputError("angles", None, "are no equal steps over whole mesh cycles", "leave angles out")
        values = self.transmission_error_unloaded if unloaded else self.transmission_error
        count = len(self.pinion_angle)
        made = np.abs(np.fft.rfft(values, axis=-1)) / count
        made[..., 1 : (count + 1) // 2] *= 2
        return np.arange(made.shape[-1]) * (self.pair.pinion.teeth / self.mesh_cycles), made


def full_period(pair: GearPair) -> int:
    """Mesh cycles after which every tooth meets the same mate again: the least common multiple of the teeth."""
    return math.lcm(pair.pinion.teeth, pair.wheel.teeth)
