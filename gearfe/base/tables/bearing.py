"""Keys of a bearing: stiffness and damping as numbers or matrices, or the inner geometry of a rolling bearing.

A bearing without any of them is a hinge. Directions are x, y (the axis of the shafts), z, and tilts about x and z.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

from ..config import Removed, quantity, renamed
from ..errors import InputError

Two = tuple[float, float]
Three = tuple[float, float, float]
Five = tuple[float, float, float, float, float]
Matrix = tuple[Five, Five, Five, Five, Five]

#: Types of rolling bearings.
DEEP_GROOVE, ANGULAR, CYLINDRICAL, TAPERED = TYPES = (
    "deep_groove_ball", "angular_contact_ball", "cylindrical_roller", "tapered_roller",
)  # fmt: skip
#: Groove radii over the ball's diameter without the keys: ISO 76:2006, inner and outer ring.
INNER_OSCULATION, OUTER_OSCULATION = 0.52, 0.53
#: Keys that every type needs, and further keys of a type: needed ones, then those that may be left out.
ALWAYS = ("elements", "element_diameter_mm", "pitch_diameter_mm")
ANY = ("row_distance_mm", "first_element_deg")
_BALL, _ROLLER = ("inner_osculation", "outer_osculation"), ("roller_profile",)
NEEDED: dict[str, tuple[str, ...]] = {
    DEEP_GROOVE: (),
    ANGULAR: ("contact_angle_deg",),
    CYLINDRICAL: ("roller_length_mm",),
    TAPERED: ("contact_angle_deg", "roller_length_mm"),
}
FURTHER: dict[str, tuple[str, ...]] = {
    DEEP_GROOVE: ("radial_clearance_um", *_BALL, *ANY),
    ANGULAR: ("axial_preload_um", "carries", "arrangement", *_BALL, *ANY),
    CYLINDRICAL: ("radial_clearance_um", "axial_stiffness_N_per_m", *_ROLLER, *ANY),
    TAPERED: ("axial_preload_um", "carries", "arrangement", *_ROLLER, *ANY),
}
#: Least eigenvalue of a matrix, scaled to a diagonal of ones, and difference of its halves: round-off of four digits.
ROUND_OFF = 1e-4
#: Keys of the matrices, in N, m, rad (and s).
MATRIX, DAMPING_MATRIX = "stiffness_matrix_N_m_rad", "damping_matrix_N_m_s_rad"


def in_two(value: Any, along: str, tilt: str) -> str:
    """Return what to write instead of a list of five numbers, the last two of which have another unit.

    Parameters
    ----------
    value : Any
        What was written.
    along, tilt : str
        Keys of the numbers along x, y, z, and of those for tilts.
    """
    if isinstance(value, list) and len(value) == 5:
        return f"write {along} = {value[:3]} and {tilt} = {value[3:]}"
    return f"write {along}, and {tilt} for the tilts"


_UNITS_APART = "has other names, one for each unit"


@dataclass(frozen=True)
class BearingTable:
    """Elasticity of a bearing: its stiffness, a matrix, or `type` with its inner geometry."""

    #: Removed keys, see `gearfe.base.config.build`.
    REMOVED: ClassVar[dict[str, Removed]] = {
        "stiffness": (_UNITS_APART, partial(in_two, along="stiffness_N_per_m", tilt="tilt_stiffness_Nm_per_rad")),
        "damping": (_UNITS_APART, partial(in_two, along="damping_N_s_per_m", tilt="tilt_damping_Nm_s_per_rad")),
        "stiffness_matrix": renamed(MATRIX),
        "damping_matrix": renamed(DAMPING_MATRIX),
    }

    stiffness_N_per_m: Three | None = quantity(None, low=0.0, doc="along x, y, z (N/m)")  # noqa: RUF009
    tilt_stiffness_Nm_per_rad: Two | None = quantity(  # noqa: RUF009
        None, low=0.0, doc="for tilt about x, z (N m/rad), with stiffness_N_per_m; left out: 0, it tilts freely"
    )
    stiffness_matrix_N_m_rad: Matrix | None = quantity(  # noqa: RUF009
        None,
        doc="instead, a symmetric 5 x 5 matrix: forces along x, y, z (N) and moments about x, z (N m) per "
        "displacement (m) and tilt (rad)",
    )
    type: str | None = quantity(
        None,
        choices=TYPES,
        doc="instead, a rolling bearing, whose stiffness follows from its geometry and its load; the keys below are "
        "its geometry",
    )
    damping_N_s_per_m: Three = quantity((0.0, 0.0, 0.0), low=0.0, doc="along x, y, z (N s/m)")  # noqa: RUF009
    tilt_damping_Nm_s_per_rad: Two = quantity((0.0, 0.0), low=0.0, doc="for tilt about x, z (N m s/rad)")  # noqa: RUF009
    damping_matrix_N_m_s_rad: Matrix | None = quantity(  # noqa: RUF009
        None, doc=f"instead, five lists of five numbers, as of {MATRIX}, per velocity; symmetric"
    )
    elements: int | None = quantity(None, low=3, high=500, doc="number of rolling elements in a row")
    element_diameter_mm: float | None = quantity(
        None, above=0.0, doc="diameter of the balls or rollers, of tapered rollers in their middle (mm)"
    )
    pitch_diameter_mm: float | None = quantity(
        None, above=0.0, doc="diameter of the circle through the middles of the rolling elements (mm)"
    )
    contact_angle_deg: float | None = quantity(
        None, above=0.0, below=90.0,
        doc="angle between the contact's normal and the radial plane without load; of a tapered roller bearing at the "
        "outer ring",
    )  # fmt: skip
    inner_osculation: float | None = quantity(
        None, above=0.5, below=1.0,
        doc=f"radius of the inner groove over the ball's diameter; left out: {INNER_OSCULATION}",
    )  # fmt: skip
    outer_osculation: float | None = quantity(
        None, above=0.5, below=1.0,
        doc=f"radius of the outer groove over the ball's diameter; left out: {OUTER_OSCULATION}",
    )  # fmt: skip
    roller_length_mm: float | None = quantity(None, above=0.0, doc="effective length of a roller (mm)")
    roller_profile: str | None = quantity(
        None,
        choices=("logarithmic", "straight"),
        doc="crowning of the rollers: logarithmic (ISO/TS 16281), or straight; left out: logarithmic",
    )
    radial_clearance_um: float | None = quantity(
        None, low=-200.0, high=1000.0, doc="diametral clearance in running (um), negative: preload; left out: 0"
    )
    axial_preload_um: float | None = quantity(
        None, low=-1000.0, high=200.0,
        doc="axial displacement that presses the rings together before any load (um), negative: play; left out: 0",
    )  # fmt: skip
    carries: str | None = quantity(
        None, choices=("+y", "-y"), doc="direction of the axial force on the shaft that a single row carries"
    )
    arrangement: str | None = quantity(
        None,
        choices=("O", "X", "tandem"),
        doc="of two rows with contact angles: O (back to back), X (face to face), or tandem, which needs carries",
    )
    row_distance_mm: float | None = quantity(
        None, above=0.0, doc="distance of the middles of two rows (mm); left out: a single row"
    )
    first_element_deg: float | None = quantity(
        None, low=-360.0, high=360.0, doc="angle of the first rolling element from x towards z (deg); left out: 0"
    )
    axial_stiffness_N_per_m: float | None = quantity(
        None, low=0.0, doc="of the ribs of a cylindrical roller bearing along the axis (N/m); left out: 0, it floats"
    )

    def check(self, where: str) -> None:
        """One source of the stiffness, and the geometry of one type."""
        sources = [key for key in ("stiffness_N_per_m", MATRIX, "type") if getattr(self, key) is not None]
        if len(sources) > 1:
            problem = f"conflicts with {sources[0]}: a bearing has one stiffness"
            raise InputError(f"{where}.{sources[1]}", getattr(self, sources[1]), problem, "leave one out")
        tilt = self.tilt_stiffness_Nm_per_rad
        if tilt is not None and self.stiffness_N_per_m is None:
            label = f"{where}.tilt_stiffness_Nm_per_rad"
            if sources:
                problem = f"conflicts with {sources[0]}, which has the stiffness for tilt"
                raise InputError(label, list(tilt), problem, "leave one out")
            problem = "needs stiffness_N_per_m: a bearing without it is rigid"
            raise InputError(label, list(tilt), problem, "add stiffness_N_per_m = [x, y, z]")
        for key in ("damping_N_s_per_m", "tilt_damping_Nm_s_per_rad"):
            if any(getattr(self, key)) and self.damping_matrix_N_m_s_rad is not None:
                problem = f"conflicts with {key}"
                raise InputError(f"{where}.{DAMPING_MATRIX}", None, problem, "leave one out")
        for key in (DAMPING_MATRIX, "damping_N_s_per_m", "tilt_damping_Nm_s_per_rad"):
            value = getattr(self, key)
            if not sources and value is not None and any(x for x in value if x):
                problem = "needs a stiffness: a rigid bearing has nothing to damp"
                raise InputError(f"{where}.{key}", value, problem, "give the stiffness, or leave it out")
        for key in (MATRIX, DAMPING_MATRIX):
            if getattr(self, key) is not None:
                check_matrix(f"{where}.{key}", getattr(self, key))
        self._check_geometry(where)

    def _check_geometry(self, where: str) -> None:
        """Every type has its keys and no others, and its parts fit."""
        kind = self.type
        allowed = () if kind is None else (*ALWAYS, *NEEDED[kind], *FURTHER[kind])
        for key in {**dict.fromkeys(ALWAYS), **{k: None for t in TYPES for k in (*NEEDED[t], *FURTHER[t])}}:
            value = getattr(self, key)
            if value is not None and key not in allowed:
                of = [t for t in TYPES if key in (*ALWAYS, *NEEDED[t], *FURTHER[t])]
                beside = "a bearing without type" if kind is None else f"type = {kind!r}"
                problem = f"conflicts with {beside}: it belongs to {', '.join(of)}"
                raise InputError(f"{where}.{key}", value, problem, "leave it out, or give the type")
            if value is None and key in allowed and key not in FURTHER[kind or DEEP_GROOVE]:
                raise InputError(f"{where}.{key}", None, f"is required of type = {kind!r}", "add it")
        if kind is not None:
            self._check_rows(where)
            self._check_sizes(where)

    def _check_rows(self, where: str) -> None:
        """Rows with a contact angle say which way they carry."""
        angled = self.type in (ANGULAR, TAPERED)
        if angled and self.row_distance_mm is not None and self.arrangement is None:
            raise InputError(f"{where}.arrangement", None, "is required with row_distance_mm", 'add "O", "X", "tandem"')
        if self.arrangement is not None and self.row_distance_mm is None:
            problem = "is of two rows, and there is one"
            raise InputError(f"{where}.arrangement", self.arrangement, problem, "add row_distance_mm, or leave it out")
        both = self.arrangement in ("O", "X")
        if angled and not both and self.carries is None:
            cure = 'add carries = "+y" or "-y"'
            raise InputError(f"{where}.carries", None, "is required: such rows carry one way along the axis", cure)
        if both and self.carries is not None:
            problem = f"conflicts with arrangement = {self.arrangement!r}, which carries both directions"
            raise InputError(f"{where}.carries", self.carries, problem, "leave one out")

    def _check_sizes(self, where: str) -> None:
        """The rolling elements fit on their circle, and the clearance into the grooves."""
        number, diameter, pitch = self.elements or 0, self.element_diameter_mm or 0.0, self.pitch_diameter_mm or 0.0
        if pitch * math.sin(math.pi / number) < diameter:
            most = int(math.pi / math.asin(diameter / pitch)) if diameter < pitch else 0
            problem = f"of {diameter:g} mm do not fit on a circle of {pitch:g} mm: must be {most} or less"
            cure = "take fewer or smaller elements, or a larger pitch_diameter_mm"
            if most < 3:
                problem = f"must be smaller: rolling elements of {diameter:g} mm do not fit on a circle of {pitch:g} mm"
                raise InputError(f"{where}.element_diameter_mm", diameter, problem, "is it the pitch diameter?")
            raise InputError(f"{where}.elements", number, problem, cure)
        if self.type not in (DEEP_GROOVE, ANGULAR):
            return
        inner = INNER_OSCULATION if self.inner_osculation is None else self.inner_osculation
        outer = OUTER_OSCULATION if self.outer_osculation is None else self.outer_osculation
        apart = 1e3 * (inner + outer - 1.0) * diameter
        angle = math.radians(self.contact_angle_deg or 0.0)
        for key, play, room in (
            ("radial_clearance_um", self.radial_clearance_um or 0.0, 2.0 * apart),
            ("axial_preload_um", -(self.axial_preload_um or 0.0), apart * math.sin(angle)),
        ):
            if play >= room > 0.0:
                sign = "" if key == "radial_clearance_um" else "-"
                problem = (
                    f"is more than the clearance of the grooves: must be {'<' if not sign else '>'} {sign}{room:.4g} um"
                )
                raise InputError(f"{where}.{key}", getattr(self, key), problem, "correct it, or the osculations")

    @property
    def stiffness(self) -> Five | None:
        """Stiffness along x, y, z (N/m) and for tilt about x, z (N m/rad); None without numbers of it."""
        if self.stiffness_N_per_m is None:
            return None
        return (*self.stiffness_N_per_m, *(self.tilt_stiffness_Nm_per_rad or (0.0, 0.0)))

    @property
    def damping(self) -> Five:
        """Damping along x, y, z (N s/m) and for tilt about x, z (N m s/rad)."""
        return (*self.damping_N_s_per_m, *self.tilt_damping_Nm_s_per_rad)

    @property
    def hinge(self) -> bool:
        """Return whether the bearing is rigid."""
        return self.stiffness_N_per_m is None and self.stiffness_matrix_N_m_rad is None and self.type is None


def check_matrix(where: str, matrix: Matrix) -> None:
    """Raise `InputError` unless a matrix is symmetric and positive semi-definite."""
    import numpy as np

    values = np.array(matrix, dtype=float)
    size = np.sqrt(np.abs(np.diag(values)))
    size = np.outer(size, size)
    for i in range(5):
        if values[i, i] < 0.0:
            problem = f"has {values[i, i]:g} on its diagonal, in row {i + 1}: must be >= 0"
            raise InputError(where, None, problem, "a negative one pushes away from its place: correct its sign")
        for j in range(i):
            low, high = float(values[j, i]), float(values[i, j])
            if abs(low - high) > ROUND_OFF * max(abs(low), abs(high)):
                problem = f"must be symmetric: row {i + 1} has {high:g} in column {j + 1}, row {j + 1} has {low:g}"
                cure = f"write {0.5 * (low + high):g} in both, or correct one"
                raise InputError(where, None, problem, cure)
            if abs(high) > (1.0 + ROUND_OFF) * size[i, j]:
                problem = f"has {high:g} in row {i + 1}, column {j + 1}: must be {size[i, j]:g} or less in size"
                cure = "larger ones than the root of both diagonal entries feed energy in: correct it, or its unit"
                raise InputError(where, None, problem, cure)
    used = np.diag(values) > 0.0
    scaled = 0.5 * (values + values.T)[np.ix_(used, used)] / size[np.ix_(used, used)]
    least = float(np.linalg.eigvalsh(scaled).min(initial=0.0))
    if least < -ROUND_OFF:
        problem = f"must be positive semi-definite: scaled to ones on its diagonal its least eigenvalue is {least:.4g}"
        raise InputError(where, None, problem, "some motions would feed energy in: check the signs of its entries")
