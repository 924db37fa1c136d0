r"""Contact laws: what the pressure on a flank is; and the model of a pair: its law, materials, sizes, deviations.

**On the elements of the flanks** (nitsche, penalty; `gearfe.gears.contact.elements`). With the gap g (negative where
the bodies overlap), the normal stress :math:`\sigma_n` of the body that carries a point, and the law's parameter
:math:`\gamma` (Pa/m), find u such that for all v (Chouly, Mlika & Renard, *Numer. Math.* 139, 2018, with theta = 0 and
the gap instead of its negative)

.. math::
    a(u, v) = \int_{\Gamma_C} p\,\delta g(v), \qquad p = \max(0,\; -\gamma g - s\,\sigma_n).

The part :math:`\Gamma_C` is the contact surface (tip round included) of the gears on the law's `sides`. If these are
both gears, each takes half of the integral. `gearfe.gears.contact.whole_gears` solves the same on whole gears.

**On half-planes** (half_plane): `gearfe.gears.contact.half_plane`, without contact elements.

A law is a frozen dataclass whose fields are its parameters, and a line that names it (`gearfe.base.tables.pair`; for
another package an entry point). Nothing else has to be changed to add a law. It has a ``name``, the text that selects
it. One that derives from `HalfPlane` is solved as that is. One on the elements (`ElementLaw`) provides besides:

1. ``uses_stress``: s above (0 or 1); with 1 the bodies keep the stress rows of their flanks;
2. ``parameter(youngs_modulus, sizes)``: gamma at the edges of a flank, from the body's modulus (Pa) and its edge
lengths (m);
3. ``sides``: ``both`` (unbiased: each flank carries half of the pressure), ``pinion``, ``wheel``, or ``tip``: of each
tooth pair the gear whose tip is nearer to the contact. A corner that digs into the other flank then lies on the side
that is integrated, which nothing cuts.
"""

from __future__ import annotations

import importlib
import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, Protocol, get_args, runtime_checkable

import numpy as np

from ...base.config import fields_of
from ...base.errors import InputError
from ...base.tables.pair import GROUP, LAWS, check_flank_coarsen, check_law, known_laws
from ...base.typing import Array, BoolArray
from ...fem.plane import Material, Plane
from ..geometry.face import NOMINAL, ToothDeviations
from ..geometry.mesh_geometry import ContactModel
from ..geometry.pair import GearPair
from ..geometry.validity import MOST_YIELD
from ..rating.stiffness import mesh_stiffness

Sides = Literal["both", "pinion", "wheel", "tip"]


class ContactLaw(Protocol):
    """See the module's docstring for what a law must provide."""

    @property
    def name(self) -> str: ...


@runtime_checkable
class ElementLaw(ContactLaw, Protocol):
    """A law on the elements of the flanks."""

    @property
    def uses_stress(self) -> bool: ...
    @property
    def sides(self) -> Sides: ...
    def parameter(self, youngs_modulus: float, sizes: Array) -> Array: ...


def on_elements(law: ContactLaw) -> ElementLaw:
    """The law, which has to be one on the elements of the flanks."""
    if isinstance(law, ElementLaw):
        return law
    problem = "has no pressure at points of a mesh: gearfe.gears.contact.half_plane solves it"
    raise InputError("law", law.name, problem, "use nitsche or penalty here")


def uses_stress(law: ContactLaw) -> bool:
    """Whether the law needs the stress at the flanks."""
    return isinstance(law, ElementLaw) and law.uses_stress


def carrying(law: ElementLaw, to_tip: Array) -> BoolArray:
    """Which gears carry contact points at contacts that lie `to_tip` (m) from their tips, shape (m, 2)."""
    if law.sides == "both":
        return np.ones(to_tip.shape, dtype=bool)
    nearer = np.argmin(to_tip, axis=1) if law.sides == "tip" else np.full(len(to_tip), law.sides == "wheel")
    return np.stack([nearer == 0, nearer == 1], axis=1)


def law_text(law: ContactLaw) -> str:
    """Name and parameters in one line without commas, for tables and reports."""
    parameters = {name: getattr(law, name) for name in fields_of(type(law))}
    if isinstance(law, Penalty):
        parameters["stiffness"] = "300E/h" if law.stiffness is None else f"{law.stiffness * 1e-9:.12g}N/mm3"
    texts = {name: f"{v:.12g}" if isinstance(v, float) else str(v).replace(",", "") for name, v in parameters.items()}
    return " ".join([law.name, *(f"{name}={text}" for name, text in texts.items())])


def check_sides(sides: str, allowed: tuple[str, ...]) -> None:
    """Raise `InputError` for sides that a law cannot have."""
    if sides not in allowed:
        raise InputError("sides", sides, "must be one of " + ", ".join(allowed))


def _check_positive(name: str, value: float, meaning: str) -> None:
    if not (isinstance(value, int | float) and math.isfinite(value) and value > 0):
        raise InputError(name, value, f"must be finite and > 0: {meaning}")


@dataclass(frozen=True)
class Penalty:
    """p = max(0, -gamma g): simple and fast; the bodies overlap by p/gamma.

    Parameters
    ----------
    stiffness
        gamma (Pa/m); 1e17 Pa/m is 1e8 N/mm3. ``None`` takes 300 E/h with h the largest edge of the flank: steel at
        0.07 mm then overlaps by 2 nm at 1.5 GPa. Far stiffer, the points over-constrain the edges and rounding shows
        in the pressures.
    sides
        One side: two would ask twice for the same thing. By default that is the gear whose tip is nearer, for each
        tooth pair. Points of the flank that a sharp tip digs into would hold the corner from either side of it. That
        costs up to 0.5 %, and deep overlaps have several solutions.
    """

    stiffness: float | None = None
    sides: Sides = "tip"
    name: ClassVar[str] = "penalty"
    uses_stress: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_sides(self.sides, get_args(Sides))
        if self.stiffness is not None:
            _check_positive("stiffness", self.stiffness, "Pa/m, pressure for each metre of overlap")

    def parameter(self, youngs_modulus: float, sizes: Array) -> Array:
        """gamma at each edge (Pa/m)."""
        stiffness = self.stiffness
        return np.full(len(sizes), 300 * youngs_modulus / sizes.max() if stiffness is None else stiffness)


@dataclass(frozen=True)
class Nitsche:
    """p = max(0, -sigma_n - gamma g) with gamma = gamma0 E/h: consistent, so the overlap vanishes with the mesh.

    Parameters
    ----------
    gamma0
        gamma h/E (-); about 1 is the most accurate, far above it the law turns into a stiff penalty.
    sides
        ``both``: unbiased, neither gear is the master. Where a sharp edge bears, ``tip`` (see `Penalty`) is nearer to
        the truth (docs/contact_laws.md).
    """

    gamma0: float = 1.0
    sides: Sides = "both"
    name: ClassVar[str] = "nitsche"
    uses_stress: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_sides(self.sides, get_args(Sides))
        _check_positive("gamma0", self.gamma0, "gamma h/E")

    def parameter(self, youngs_modulus: float, sizes: Array) -> Array:
        """gamma at each edge (Pa/m)."""
        return self.gamma0 * youngs_modulus / sizes


@dataclass(frozen=True)
class HalfPlane:
    """No overlap, no tension, on the panels of `gears.contact.half_plane`: half-planes instead of contact elements."""

    name: ClassVar[str] = "half_plane"


def law_class(name: str) -> Any:
    """Class of the law called `name`."""
    check_law("law", name)
    reference = LAWS.get(name) or known_laws()[name]
    module, _, attribute = reference.partition(":")
    try:
        return getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        problem = f"cannot be loaded from {reference} ({error})"
        raise InputError("law", name, problem, f"correct the package that names it in the group {GROUP}") from None


def law_named(name: str, **parameters: Any) -> ContactLaw:
    """The law called `name` (`gearfe.base.tables.pair`) with the parameters given, the others by default."""
    kind = law_class(name)
    known = list(fields_of(kind))
    for key, value in parameters.items():
        if key not in known:
            problem = "is no parameter of the law " + name
            cure = "it has " + ", ".join(known) if known else "it has none"
            raise InputError(f"law_parameters.{key}", value, problem, cure)
    made: ContactLaw = kind(**parameters)
    return made


def check_alike(deviations: tuple[ToothDeviations, ToothDeviations]) -> None:
    """Raise `InputError` for teeth that differ, which the one mesh cycle of a curve or mesh law cannot have."""
    for name, own in zip(("pinion (driver)", "wheel (driven)"), deviations, strict=True):
        if not own.alike:
            what = "stand unevenly" if len(set(own.turn)) > 1 else "have different flanks"
            problem = f"its teeth {what}: curves and mesh laws are of one mesh cycle that repeats"
            cure = (
                "leave out pitch errors, measured teeth that differ, and waves that are no multiple of the teeth; "
                'gearfe loadmap takes them, and pitch errors also trains with mesh_model = "potential"'
            )
            raise InputError(f"deviations of the {name}", None, problem, cure)


def check_deviations(deviations: tuple[ToothDeviations, ToothDeviations], law: ContactLaw) -> None:
    """Raise `InputError` for deviations that a law cannot have."""
    if deviations != NOMINAL and not isinstance(law, HalfPlane):
        problem = "takes flanks from meshes, which have no deviations of micrometres"
        raise InputError("law", law.name, problem, 'write law = "half_plane", or leave [microgeometry] out')


#: Structural steel, the material where none is given.
STEEL = Material()
#: The mesh of an error estimate is so many times coarser.
COARSENING = 1.6
#: Flank elements of the half-plane law, which need not resolve contacts: times those of the laws on the mesh, and at
#: most so many times the default ones.
HALF_PLANE_FLANK, HALF_PLANE_COARSEST = 4.0, 6.0


@dataclass(frozen=True)
class PairModel(ContactModel):
    """Materials, contact law and element sizes of a gear pair, for `gearfe.gears.gearmesh.sweep.elastic_pair`.

    Parameters
    ----------
    materials
        Of pinion and wheel.
    plane
        ``strain`` or ``stress``.
    law
        Contact law.
    coarsen, flank_coarsen
        Factor on all element sizes, and additional factor on those of the driving flanks.
    points_per_edge
        Contact points on each edge of a flank.
    deviations
        Of micrometres, which no mesh has, of the driving flanks of pinion and wheel; for the half-plane law alone.

    Raises
    ------
    InputError
        For values out of range, and deviations that the law cannot have.
    """

    materials: tuple[Material, Material] = (STEEL, STEEL)
    plane: Plane = "strain"
    law: ContactLaw = HalfPlane()
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
        for material in self.materials:
            check_poisson(material.poisson_ratio, self.plane)
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


#: Poisson's ratio (-) up to which error estimates of plane strain hold. Displacements of quadratic triangles that keep
#: their area lack freedoms as nu nears 0.5 (locking: Babuska, Suri, Numer. Math. 62, 1992). Against elements that do
#: not lock (a bubble and a pressure of their own) k erred by at most 0.35 % at 0.499, estimated 0.49 %, for all laws.
MOST_POISSON = 0.499


def check_poisson(poisson_ratio: float, plane: Plane, name: str = "poisson_ratio") -> None:
    """Raise `InputError` for a Poisson's ratio, called `name`, whose error estimate does not hold in plane strain."""
    if plane == "strain" and poisson_ratio > MOST_POISSON:
        problem = (
            f"must be <= {MOST_POISSON:g} in plane strain: closer to 0.5 elements lock, and no error estimate holds"
        )
        cure = f'give {MOST_POISSON:g} (k (1 - nu^2) has a limit and differs by about 0.1 %), or plane = "stress"'
        raise InputError(name, poisson_ratio, problem, cure)


#: The model where nothing else is said.
DEFAULT_MODEL = PairModel()


def check_torque(pair: GearPair, model: PairModel, torque: float, name: str = "torque") -> None:
    """Raise an error for a torque under which small strain does not hold.

    Parameters
    ----------
    pair : GearPair
        The gears.
    model : PairModel
        Materials and plane state.
    torque : float
        At the wheel (N m).
    name : str
        Name of the torque in the message.

    Raises
    ------
    InputError
        If the teeth would deflect by more than `MOST_YIELD` modules.
    """
    gears = pair.pinion, pair.wheel
    width = pair.common_width
    moduli = [
        gear.face_width / (width * material.contact_compliance(model.plane))  # E' per width of the contact
        for gear, material in zip(gears, model.materials, strict=True)
    ]
    most = MOST_YIELD * pair.pinion.module * mesh_stiffness(pair, *moduli) * width * pair.wheel.base_radius
    if torque > most:
        problem = f"must be <= {most:.3g} N m: the teeth would deflect by more than {MOST_YIELD:g} modules"
        raise InputError(name, torque, problem, "linear elasticity does not reach so far; give less")
