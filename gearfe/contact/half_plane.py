r"""One contact law for every load: finite elements for the teeth, half-planes for the contacts, exact moved flanks.

Teeth and rims move the faces by the smooth influence H of `.flank_compliance`; the contact itself is that of
half-planes and wedges on panels, which no mesh resolves. (Vijayakar, *Int. J. Numer. Meth. Eng.* 31, 1991, joins a
finite-element and a half-space solution at a depth below the contact; here they join in the influence function.)

**One position.** Every tooth pair has a centre O with the common normal n, and panels at x along the tangent over the
window in which the gap may close. With the pressure p, its force per width :math:`F=\int p`, the gap g between the
faces as moved by the loads :math:`F_0` of the step before (`.moved_faces`),

.. math::
    p \ge 0,\qquad g(x) + \frac{2}{\pi}\Big(\frac1{E_1'}+\frac1{E_2'}\Big)\int -\ln|x-\xi|\,p\,d\xi
    + \sum_i \frac{n W_i n}{E_i'}\int -\ln(y_i+\eta_i)\,p + \sum_l T_l\,(F_l-F_{0,l}) \ge 0,

complementary, :math:`T = w\, n H n` over all tooth pairs l of the position. Then O moves to the mean place of p, n to
the mean normal of the deformed faces under p (of the face that is further from its corner), H is taken at the material
that is at O now, and so on until F stays.

**Why this is an equilibrium.** H is symmetric, and with O at the mean place of p the energy does not change to first
order with the arcs at which H is taken; with n the mean normal under p, it does not change with n either. What is left
is the work of the twist, so that the torque F times lever is the derivative of the energy (a test).

The faces' displacement is taken at O with its slope. Across n it includes the wedge's part; along n that is in the
equation above. The influence at the stations is a mean over bumps and the contact has a width of its own: together they
add :math:`(\langle x^2\rangle - a^2/4)\,H_{ss}`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..gear.touching import Touching
from .half_plane_result import TORQUES, HalfPlaneSolution, PairContacts, contacts_of, joined, no_contacts, pair_torques
from .half_plane_step import HalfPlanePair, half_plane_pair, moved_on, smooth_influence, step
from .moved_faces import Frames
from .panels import Couplings, couplings, forces_of_overlaps

__all__ = ["HalfPlanePair", "HalfPlaneSolution", "PairContacts", "half_plane_pair", "solve_half_plane"]

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: Relative change of the forces at which a position is done, and most steps.
TOLERANCE, STEPS = 1e-5, 20
#: Approach of a contact per force in units of 2/pi (1/E_1' + 1/E_2'), with which the first forces are made.
USUAL_APPROACH = 6.0
#: Rigid clearance (rad) up to which a tooth pair is looked at.
CLEAR = 1e-7
#: Positions solved side by side.
BATCH = 128


def solve_half_plane(law: HalfPlanePair, pinion_angles: ArrayLike, twists: ArrayLike) -> HalfPlaneSolution:
    """Solve the contact of a gear pair at several positions.

    Parameters
    ----------
    pinion_angles : array_like, shape (n,)
        rad.
    twists : array_like, shape (n,) or ()
        Twist of the wheel (rad), from where a wheel space faces the pinion tooth.
    """
    angles = np.atleast_1d(np.asarray(pinion_angles, dtype=float))
    twist = np.broadcast_to(np.asarray(twists, dtype=float), angles.shape)
    parts = [slice(first, first + BATCH) for first in range(0, len(angles), BATCH)]
    made = [_batch(law, angles[part], twist[part]) for part in parts]
    for part, one in zip(parts, made, strict=True):
        one.contacts.position[:] += part.start
    return joined(HalfPlaneSolution, made)


@dataclass(frozen=True)
class _Open:
    """Positions that are not done yet, with their p tooth pairs.

    Attributes
    ----------
    numbers : ndarray, shape (m,)
        Of the positions in the batch, in rising order.
    found
        Where the rigid flanks of the pairs touch.
    frames, force, spread, bearing
        Where the next step starts from: forces per width (N/m), variances of the pressure (m2), panels that bore.
    """

    numbers: IntArray
    found: Touching
    frames: Frames
    force: Array
    spread: Array
    bearing: NDArray[np.bool_] | None

    @cached_property
    def couples(self) -> Couplings:
        """Which pairs share a position."""
        return couplings(np.searchsorted(self.numbers, self.found.position), self.found.pair, len(self.numbers))

    def kept(self, positions: NDArray[np.bool_]) -> _Open:
        """Only some of the positions, shape (m,)."""
        on = np.flatnonzero(positions[self.couples.position])
        bearing = None if self.bearing is None else self.bearing[on]
        return _Open(
            self.numbers[positions], self.found.take(on), self.frames.take(on), self.force[on], self.spread[on], bearing
        )


def _first(law: HalfPlanePair, angles: Array, twists: Array) -> _Open:
    """Forces to begin with: the overlaps of the rigid gears, taken up by the teeth and usual contacts."""
    found = law.flanks.touching(angles)
    found = found.take(np.flatnonzero(found.twist < twists[found.position] + CLEAR))
    turn = [
        found.angle + found.pair * law.pair.mesh_cycle,
        law.flanks.wheel_frame(found.angle, found.pair) + twists[found.position],
    ]
    none = np.zeros((len(found), 2), dtype=complex)
    frames = Frames(
        centre=found.point,
        normal=found.normal,
        turn=np.exp(1j * np.stack(turn, axis=1)),
        hub=law.hub,
        arc=np.stack([curve.arc_at(found.place[:, g]) for g, curve in enumerate(law.curves)], axis=1),
        shift=none,
        stretch=none,
    )
    nothing = np.zeros(len(found))
    start = _Open(np.unique(found.position), found, frames, nothing, nothing, None)
    if len(found) == 0:
        return start
    overlap = found.arm[:, 1] * (twists[found.position] - found.twist)
    T = smooth_influence(law, frames, start.couples).compliance
    force = forces_of_overlaps(overlap, USUAL_APPROACH * law.compliance, T, start.couples)
    return replace(start, force=force)


def _batch(law: HalfPlanePair, angles: Array, twists: Array) -> HalfPlaneSolution:
    count = len(angles)
    status, iterations = np.full(count, "no_contact", dtype="<U13"), np.zeros(count, dtype=np.int64)
    numbers = {name: np.zeros(count) for name in TORQUES}
    contacts: list[PairContacts] = []
    open_ = _first(law, angles, twists)
    status[open_.numbers] = "not_converged"
    for number in range(1, STEPS + 1):
        if len(open_.numbers) == 0:
            break
        couples = open_.couples
        made = step(law, open_.frames, open_.force, open_.spread, couples, open_.bearing)
        new = made.solution.force
        total = couples.total(new)
        change = couples.total(np.abs(new - open_.force))
        unsettled = couples.total((~made.solution.settled).astype(float)) > 0
        done = ~unsettled & (change <= TOLERANCE * total) & (number > 1)
        iterations[open_.numbers] = number
        if done.any():
            bears = total[done] > 0
            status[open_.numbers[done]] = np.where(bears, "converged", "no_contact")
            mine = np.flatnonzero(done[couples.position] & (new > 0))
            torques = pair_torques(law, made)
            for name in TORQUES:
                numbers[name][open_.numbers[done]] = couples.total(torques[name])[done]
            contacts.append(contacts_of(law, open_.found, made, torques, mine))
        bearing = made.solution.pressure > 0
        onward = replace(open_, frames=moved_on(law, made), force=new, spread=made.spread, bearing=bearing)
        open_ = onward.kept(~done)
    for values in numbers.values():
        values[status == "not_converged"] = np.nan
    gathered = joined(PairContacts, contacts) if contacts else no_contacts()
    order = np.lexsort((gathered.pair, gathered.position))
    return HalfPlaneSolution(
        pinion_angle=angles,
        twist=twists,
        status=status,
        iterations=iterations,
        contacts=gathered.take(order),
        **numbers,
    )
