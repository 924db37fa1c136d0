"""The [microgeometry] table: deviations of micrometres of both gears, in everyday units."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, fields
from typing import ClassVar

from ..config import Removed, quantity, renamed
from ..errors import InputError
from .loadmap import LoadMapTable

SHAPES = ("linear", "arc", "parabolic")
#: Ends of the face width, at the smaller and at the larger y, and corners of a flank.
ENDS_OF_WIDTH = ("low", "high")
CORNERS = ("tip_low", "tip_high", "root_low", "root_high")
#: Keys of modifications that vary along the face width.
ALONG_WIDTH = (
    *("helix_crowning_um", "helix_slope_um", "bias_um"),
    *(f"end_relief_{end}_um" for end in ENDS_OF_WIDTH),
    *("triangular_reliefs", "topography_csv"),
)
#: Keys of which at most one says where a relief starts.
STARTS = ("length_mm", "start_mm", "start_diameter_mm")
#: Keys of which at most one says where it has its amount.
ENDS = ("end_mm", "end_diameter_mm")


@dataclass(frozen=True)
class WavinessTable:
    """A wave on the flanks of all teeth, which continues from tooth to tooth."""

    amplitude_um: float = quantity(doc="amplitude (um)", low=0.0)
    waves: int = quantity(doc="whole waves around the gear", low=1, high=100_000)
    phase_deg: float = quantity(0.0, doc="phase (deg)")


@dataclass(frozen=True)
class TriangularReliefTable:
    """Material taken off a corner of the flanks, down to nothing on the line between two edges."""

    corner: str = quantity(doc="tip_low, tip_high, root_low or root_high (y)", choices=CORNERS)
    amount_um: float = quantity(doc="relief in the corner (um)", low=0.0)
    width_mm: float = quantity(doc="its length along the face width (mm)", above=0.0)
    roll_length_mm: float = quantity(doc="its length along the profile, as roll length (mm)", above=0.0)


@dataclass(frozen=True)
class FlankTable:
    """Deviations of the flanks of a gear in the transverse section, along their normals; > 0 is more material."""

    #: Keys that were: what became of them, and what to write instead.
    REMOVED: ClassVar[dict[str, Removed]] = {
        f"{key}_um": (
            f"has another name when helix_{key}_um is given, the one along the face width",
            f"write profile_{key}_um",
        )
        for key in ("crowning", "slope")
    } | {"points": renamed("points_mm_um")}

    tip_relief_um: float | None = quantity(None, doc="tip relief C_alpha a (um), at the tip circle", low=0.0)
    tip_relief_length_mm: float | None = quantity(
        None, doc="its roll length L_C alpha a from the tip circle (mm)", above=0.0
    )
    tip_relief_start_mm: float | None = quantity(None, doc="or the roll length where it starts (mm)", above=0.0)
    tip_relief_start_diameter_mm: float | None = quantity(None, doc="or the diameter d_C alpha a there (mm)", above=0.0)
    tip_relief_end_mm: float | None = quantity(
        None, doc="roll length where it has its amount (mm), if not the tip circle", above=0.0
    )
    tip_relief_end_diameter_mm: float | None = quantity(None, doc="or the diameter there (mm)", above=0.0)
    tip_relief_shape: str = quantity("linear", doc="linear, arc or parabolic", choices=SHAPES)
    root_relief_um: float | None = quantity(None, doc="root relief C_alpha f (um), at the form circle", low=0.0)
    root_relief_length_mm: float | None = quantity(
        None, doc="its roll length L_C alpha f from the form circle (mm)", above=0.0
    )
    root_relief_start_mm: float | None = quantity(None, doc="or the roll length where it starts (mm)", above=0.0)
    root_relief_start_diameter_mm: float | None = quantity(
        None, doc="or the diameter d_C alpha f there (mm)", above=0.0
    )
    root_relief_end_mm: float | None = quantity(
        None, doc="roll length where it has its amount (mm), if not the form circle", low=0.0
    )
    root_relief_end_diameter_mm: float | None = quantity(None, doc="or the diameter there (mm)", above=0.0)
    root_relief_shape: str = quantity("linear", doc="linear, arc or parabolic", choices=SHAPES)
    profile_crowning_um: float = quantity(0.0, doc="profile crowning C_alpha (um), removed at both ends of the profile")
    profile_slope_um: float = quantity(
        0.0, doc="profile slope C_H alpha (um), from form to tip circle, > 0: more material at the tip"
    )
    helix_crowning_um: float = quantity(0.0, doc="helix crowning C_beta (um), removed at both ends of the width")
    helix_slope_um: float = quantity(
        0.0, doc="helix slope C_H beta (um) over the face width, > 0: more material at the larger y"
    )
    bias_um: float = quantity(
        0.0, doc="flank twist S (um): helix slope at the tip circle minus that at the form circle"
    )
    end_relief_low_um: float | None = quantity(None, doc="end relief C_beta I (um), at the end of smaller y", low=0.0)
    end_relief_low_length_mm: float | None = quantity(None, doc="length of it along the width (mm)", above=0.0)
    end_relief_high_um: float | None = quantity(None, doc="end relief C_beta II (um), at the end of larger y", low=0.0)
    end_relief_high_length_mm: float | None = quantity(None, doc="length of it along the width (mm)", above=0.0)
    end_relief_shape: str = quantity("linear", doc="linear or parabolic, of both ends", choices=("linear", "parabolic"))
    triangular_reliefs: tuple[TriangularReliefTable, ...] = quantity((), doc="reliefs of corners")
    waviness: tuple[WavinessTable, ...] = quantity((), doc="waves")
    points_mm_um: tuple[tuple[float, float], ...] = quantity(
        (), doc="K-chart: [roll length (mm), deviation (um)] and straight lines between"
    )
    measured_csv: str | None = quantity(
        None, doc="file with columns roll_length_mm (or diameter_mm), deviation_um, and tooth where teeth differ"
    )
    topography_csv: str | None = quantity(
        None,
        doc="file with a grid over the flank: roll_length_mm (or diameter_mm), y_mm from the middle of the width, "
        "deviation_um, and tooth where teeth differ",
    )
    pitch_um: tuple[float, ...] = quantity((), doc="index deviations F_i of all teeth (um), along the reference circle")
    single_pitch_um: tuple[float, ...] = quantity((), doc="or the single pitch deviations f_pi (um), which add up to 0")
    pitch_csv: str | None = quantity(None, doc="or a file with the columns tooth and pitch_um")
    run_out_um: float = quantity(
        0.0, doc="amplitude of a sine of one turn (um) of the index deviations, those of an eccentric gear", low=0.0
    )
    run_out_phase_deg: float = quantity(0.0, doc="its phase (deg), of the left flanks where both have it")
    pitch_class: int | None = quantity(None, doc="index deviations drawn for a class of ISO 1328-1", low=1, high=11)
    pitch_seed: int = quantity(1, doc="seed of the draw", low=0, high=2**63 - 1)

    def along_width(self) -> str:
        """Return the first key by which the flank varies along the face width, or an empty text."""
        reliefs = any(relief.amount_um for relief in self.triangular_reliefs)
        return next(
            (key for key in ALONG_WIDTH if (reliefs if key == "triangular_reliefs" else getattr(self, key))), ""
        )

    def check(self, where: str) -> None:
        """Raise `InputError` for keys that contradict each other."""
        for name, keys in itertools.product(("tip_relief", "root_relief"), (STARTS, ENDS)):
            given = [f"{name}_{key}" for key in keys if getattr(self, f"{name}_{key}") is not None]
            if len(given) > 1:
                value = getattr(self, given[1])
                raise InputError(f"{where}.{given[1]}", value, f"conflicts with {given[0]}", "leave one of them out")
        for amount, length in ((f"end_relief_{end}_um", f"end_relief_{end}_length_mm") for end in ENDS_OF_WIDTH):
            if (getattr(self, amount) is None) != (getattr(self, length) is None):
                lacking, there = (amount, length) if getattr(self, amount) is None else (length, amount)
                raise InputError(f"{where}.{lacking}", None, f"is required with {there}", "add it, or leave out both")
        pitch = [key for key in ("pitch_um", "single_pitch_um", "pitch_csv", "pitch_class") if getattr(self, key)]
        if len(pitch) > 1:
            value = getattr(self, pitch[1])
            raise InputError(f"{where}.{pitch[1]}", value, f"conflicts with {pitch[0]}", "leave one of them out")


@dataclass(frozen=True)
class GearMicrogeometryTable(FlankTable):
    """Deviations of one gear: of both flanks of its teeth, or of one, which then wins key by key.

    Pitch errors of both flanks displace teeth, see `gears.geometry.pitch_errors`; those of one side are of its flanks.
    """

    left: FlankTable | None = quantity(None, doc="of the left (counter-clockwise) flanks")  # noqa: RUF009
    right: FlankTable | None = quantity(None, doc="of the right flanks")  # noqa: RUF009

    def flank(self, side: str) -> FlankTable:
        """Return the deviations of the flanks `side` (left or right)."""
        own, default = getattr(self, side), FlankTable()
        values = {f.name: getattr(self, f.name) for f in fields(FlankTable)}
        if own is not None:
            given = {f.name: getattr(own, f.name) for f in fields(FlankTable)}
            changed = {name: value for name, value in given.items() if value != getattr(default, name)}
            # another start or end takes the place of the shared one
            for relief, keys in itertools.product(("tip_relief", "root_relief"), (STARTS, ENDS)):
                if any(f"{relief}_{key}" in changed for key in keys):
                    values |= dict.fromkeys((f"{relief}_{key}" for key in keys), None)
            values |= changed
        return FlankTable(**values)


@dataclass(frozen=True)
class MicrogeometryTable(LoadMapTable):
    """Deviations of both gears, and the torques and angles of their load map where there is no [loadmap]."""

    NAME = "microgeometry"

    flank: str = quantity("left", doc="the driving flanks of both gears: left or right", choices=("left", "right"))
    tolerance_class: int | None = quantity(
        None, doc="class of ISO 1328-1 whose profile tolerances the picture of the flanks shows", low=1, high=11
    )
    pinion: GearMicrogeometryTable = quantity(GearMicrogeometryTable, doc="the driving gear")  # noqa: RUF009
    wheel: GearMicrogeometryTable = quantity(GearMicrogeometryTable, doc="the driven gear")  # noqa: RUF009
