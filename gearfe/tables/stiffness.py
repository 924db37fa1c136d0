"""The [stiffness] table: how a gear pair's mesh stiffness is computed, in everyday units; and which contact laws there
are: their names, and where their classes stand. NumPy is not loaded for it.

A new law is one class (its contract is in `gearfe.contact.laws`) and one line: here, or for another package the entry
point ``name = "module:Class"`` in the group ``gearfe.laws``. Job files, the command line and Python then know it by its
name; its numbers are the table ``law_parameters``, the option ``--law-parameter``, the fields of the class.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from importlib import metadata
from typing import Any, ClassVar, Literal

from ..config import quantity
from ..errors import InputError, nearest

#: Law that holds where none is named.
DEFAULT_LAW = "half_plane"
#: Name -> "module:class" of the laws of this package.
LAWS: dict[str, str] = {
    "half_plane": "gearfe.contact.laws:HalfPlane",
    "nitsche": "gearfe.contact.laws:Nitsche",
    "penalty": "gearfe.contact.laws:Penalty",
}
#: Group of entry points in which other packages name theirs.
GROUP = "gearfe.laws"
#: Names of laws that were, and what to write instead.
REMOVED = {"exact": ("is a law of the tests' whole-gear route alone", "use half_plane")}


def known_laws() -> dict[str, str]:
    """Name -> "module:class" of all laws, those of other packages included; none takes the name of one of these."""
    return {point.name: point.value for point in metadata.entry_points(group=GROUP)} | LAWS


def check_law(label: str, name: str) -> None:
    """Raise `InputError` unless there is a law called `name`; `label` names the key or option in the message."""
    if name in LAWS:
        return
    if name in REMOVED:
        raise InputError(label, name, *REMOVED[name])
    known = known_laws()
    if name not in known:
        problem = "must be one of " + ", ".join([*LAWS, *sorted(known.keys() - LAWS)])
        raise InputError(label, name, problem, nearest(name, known))


def law_class(name: str) -> Any:
    """Class of the law called `name`."""
    check_law("law", name)
    reference = LAWS.get(name) or known_laws()[name]
    module, _, attribute = reference.partition(":")
    try:
        return getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        problem = f"cannot be loaded from {reference} ({error})"
        raise InputError("law", name, problem, f"mend the package that names it in the group {GROUP}") from None


#: More positions than this are a slip of the keyboard.
MOST_POSITIONS = 100_000


#: Beyond these angles rounding is more than 1e-10 deg.
FAR_DEG = 1e6

#: Finest flank elements, in default ones: some 1,200 on a flank, whose compliances take gigabytes.
FINEST = 0.1


def check_flank_coarsen(coarsen: float, flank_coarsen: float, field: str) -> None:
    """Raise `InputError` unless the flanks' elements are within the range that is known to work."""
    least = max(FINEST, FINEST / coarsen)
    if not least * (1 - 1e-12) <= flank_coarsen <= 10.0:
        problem = f"must be >= {least:g} with coarsen {coarsen:g}, and <= 10"
        raise InputError(field, flank_coarsen, problem, "1 leaves the flanks to coarsen")


@dataclass(frozen=True)
class StiffnessTable:
    """Load, positions, model and mesh of a rotation sweep."""

    #: Keys that were: what became of them, and what to write instead.
    REMOVED: ClassVar[dict[str, tuple[str, str]]] = {
        "route": (
            "is gone: one law answers every load",
            'leave it out; law = "half_plane" (the default) needs no mesh that resolves the contact',
        ),
        "law_sides": (
            "is gone: the law fixes the flanks that it is integrated on (nitsche both, penalty the nearer tip's)",
            "leave it out; other sides are in Python: gearfe.contact.laws",
        ),
        "nitsche_theta": (
            "is gone: theta is 0",
            "leave it out",
        ),
    }

    twist_deg: float | None = quantity(
        None, doc="twist of the wheel against the pinion (deg), or give torque_Nm", above=0.0, below=36.0
    )
    torque_Nm: float | None = quantity(None, doc="torque at the wheel's hub (N m), or give twist_deg", above=0.0)
    twist_from: Literal["contact", "centred"] = quantity(
        "contact",
        doc="where twist_deg counts from: contact (where unmodified driving flanks touch) or centred (a wheel space "
        "faces the pinion tooth; half the backlash is then lost motion)",
        choices=("contact", "centred"),
    )
    angle_start_deg: float = quantity(0.0, doc="first pinion angle (deg)", low=-FAR_DEG, high=FAR_DEG)
    angle_step_deg: float = quantity(1.0, doc="step of the pinion angle (deg)", above=0.0)
    angle_stop_deg: float | None = quantity(
        None, doc="last pinion angle (deg); without it, one mesh cycle", low=-FAR_DEG, high=FAR_DEG
    )
    plane: Literal["strain", "stress"] = quantity(
        "strain", doc="plane strain or plane stress", choices=("strain", "stress")
    )
    law: str = quantity(
        DEFAULT_LAW,
        doc="contact law: half_plane (every load), nitsche or penalty (on the flanks' elements), or another package's",
    )
    law_parameters: dict[str, float] = quantity(  # noqa: RUF009
        dict, doc="parameters of a law of another package, by name (in its own units)"
    )
    kinematics: Literal["small", "finite"] = quantity(
        "finite",
        doc="small (small strain) or finite (with the first-order effect of finite strain on the torque)",
        choices=("small", "finite"),
    )
    nitsche_gamma0: float | None = quantity(
        None, doc="parameter of the law nitsche, gamma h/E (-), by default 1, the most accurate", low=1e-6, high=1e9
    )
    penalty_stiffness_N_per_mm3: float | None = quantity(
        None,
        doc="parameter of the law penalty (N/mm3), by default 300 E/h with the flank's largest element h",
        low=1e3,
        high=1e13,
    )
    points_per_edge: int = quantity(4, doc="contact points on each element edge of a flank", low=2, high=10)
    coarsen: float = quantity(
        1.0, doc="factor on all element sizes; 2 is faster and about four times less accurate", low=0.2, high=5.0
    )
    flank_coarsen: float = quantity(
        1.0, doc="factor on the element sizes of the driving flanks, besides coarsen", low=0.1, high=10.0
    )
    solve_all: bool = quantity(False, doc="true: solve also positions that differ by whole mesh cycles")
    interpolation: str = quantity(
        "cubic", doc="how the curve runs between its positions: cubic (monotone) or linear", choices=("cubic", "linear")
    )

    def check(self, where: str) -> None:
        """Raise `InputError` for keys that contradict each other."""
        if self.twist_deg is not None and self.torque_Nm is not None:
            raise InputError(f"{where}.torque_Nm", self.torque_Nm, "stands beside twist_deg", "leave one of them out")
        check_flank_coarsen(self.coarsen, self.flank_coarsen, f"{where}.flank_coarsen")
        check_law(f"{where}.law", self.law)
        if self.angle_stop_deg is None:
            return
        if self.angle_stop_deg < self.angle_start_deg:
            problem = f"must be >= angle_start_deg = {self.angle_start_deg:g}"
            raise InputError(f"{where}.angle_stop_deg", self.angle_stop_deg, problem, "swap them")
        if (self.angle_stop_deg - self.angle_start_deg) / self.angle_step_deg > MOST_POSITIONS:
            problem = f"makes more than {MOST_POSITIONS} positions"
            raise InputError(f"{where}.angle_step_deg", self.angle_step_deg, problem, "use a larger step")

    def angles_deg(self, mesh_cycle_deg: float) -> list[float]:
        """Pinion angles (deg), the last one included."""
        start, step, stop = self.angle_start_deg, self.angle_step_deg, self.angle_stop_deg
        if stop is None:
            count = max(1, round(mesh_cycle_deg / step))
            return [start + mesh_cycle_deg * i / count for i in range(count)]
        return [start + step * i for i in range(int((stop - start) / step + 1e-9) + 1)]
