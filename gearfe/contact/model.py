"""What an elastic pair is made of beside its gears: materials, plane, contact law, element sizes, deviations."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from ..elasticity import Material, Plane
from ..errors import InputError
from ..gear.deviation import NOMINAL, ToothDeviations
from ..tables.stiffness import check_flank_coarsen
from .laws import ContactLaw, HalfPlane, check_deviations, law_named

#: Structural steel, the material where none is given.
STEEL = Material()
#: The mesh of an error estimate is so many times coarser.
COARSENING = 1.6
#: Flank elements of the half-plane law, which need not resolve contacts: times those of the laws on the mesh, and at
#: most so many times the default ones.
HALF_PLANE_FLANK, HALF_PLANE_COARSEST = 4.0, 6.0


@dataclass(frozen=True)
class PairModel:
    """Model of a pair: what `gearfe.stiffness.sweep.elastic_pair` makes of its gears.

    Parameters
    ----------
    materials
        Of pinion and wheel.
    plane
        ``strain`` or ``stress``.
    law
        Contact law.
    coarsen, flank_coarsen
        Factor on all element sizes, and besides on those of the driving flanks.
    points_per_edge
        Contact points on each edge of a flank.
    deviations
        Of micrometres, which no mesh has, of the driving flanks of pinion and wheel, all teeth alike; for the
        half-plane law alone.

    Raises
    ------
    InputError
        For values out of range, and deviations that the law cannot have.
    """

    materials: tuple[Material, Material] = (STEEL, STEEL)
    plane: Plane = "strain"
    law: ContactLaw = HalfPlane()  # noqa: RUF009
    coarsen: float = 1.0
    flank_coarsen: float = 1.0
    points_per_edge: int = 4
    deviations: tuple[ToothDeviations, ToothDeviations] = NOMINAL

    def __post_init__(self) -> None:
        if self.plane not in ("strain", "stress"):
            raise InputError("plane", self.plane, "must be strain or stress")
        # the error estimate of a mesh at the limit is coarser by COARSENING
        if not (math.isfinite(self.coarsen) and 0.2 <= self.coarsen <= 5.0 * COARSENING):
            cure = "1 is the default mesh, 2 twice its sizes"
            raise InputError("coarsen", self.coarsen, "must be >= 0.2 and <= 5", cure)
        check_flank_coarsen(self.coarsen, self.flank_coarsen, "flank_coarsen")
        check_deviations(self.deviations, self.law)

    def changed(self, **changes: Any) -> PairModel:
        """The model with other fields; a law may be named, and one material stands for both gears."""
        law, materials = changes.get("law", self.law), changes.get("materials", self.materials)
        changes["law"] = law_named(law) if isinstance(law, str) else law
        changes["materials"] = (materials, materials) if isinstance(materials, Material) else materials
        return replace(self, **changes)

    @property
    def mesh_flank_coarsen(self) -> float:
        """`flank_coarsen` of the mesh: that of the half-plane law is coarser by `HALF_PLANE_FLANK`, as far as
        `HALF_PLANE_COARSEST` allows.
        """
        if not isinstance(self.law, HalfPlane):
            return self.flank_coarsen
        return min(HALF_PLANE_FLANK * self.flank_coarsen, max(1.0, HALF_PLANE_COARSEST / self.coarsen))


#: The model where nothing else is said.
DEFAULT_MODEL = PairModel()
