"""From the microgeometry of gears in a job file, and the files it names, to the deviations of their flanks."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...base.files import read_numbers
from ...base.tables.gearbox import NamedGear, NamedMesh
from ...base.tables.microgeometry import ENDS, STARTS, FlankTable, GearMicrogeometryTable
from ...base.typing import Array, IntArray
from . import pitch_errors
from .deviation import Deviation
from .face import ToothDeviations
from .modifications import FlankModification, Relief, Waviness, tooth_deviations
from .pair import Gear, GearPair
from .pitch_errors import seen_from_behind

#: Roles of the gears of a mesh, in results.
GEARS = ("pinion", "wheel")


def deviations_of(
    mesh: NamedMesh, pair: GearPair, folder: str | Path = ".", *, flank: str | None = None
) -> tuple[ToothDeviations, ToothDeviations]:
    """Return the deviations of the driving flanks of a pair's driver and driven gear.

    Where the right flanks drive, those of the pair seen from the other side, whose left ones they are.

    Parameters
    ----------
    mesh : NamedMesh
        The mesh of the job file.
    pair : GearPair
        Its gears.
    folder : path
        Where files that the tables name are looked for.
    flank
        ``left`` or ``right``; None: what the mesh says.

    Raises
    ------
    InputError
        For every mistake, in the file's own keys.
    """
    side = flank or mesh.flank
    driver, driven = (
        ToothDeviations()
        if gear.microgeometry is None
        else flank_deviations(FlankOf(mesh, pair, g, side, Path(folder), mirrored=side == "right"))
        for g, gear in enumerate(mesh.gears)
    )
    return driver, driven


@dataclass(frozen=True)
class FlankOf:
    """One side of the teeth of a pair's gear.

    Attributes
    ----------
    mesh, pair
        The mesh of the job file, and its gears.
    number
        0 for the driver, 1 for the driven gear.
    side
        ``left`` or ``right``.
    folder
        Of the files that the tables name.
    mirrored
        Whether the pair is seen from the other side, where right flanks are left ones.
    """

    mesh: NamedMesh
    pair: GearPair
    number: int
    side: str
    folder: Path
    mirrored: bool = False

    @property
    def named(self) -> NamedGear:
        """The gear of the job file."""
        return self.mesh.gears[self.number]

    @property
    def teeth(self) -> GearMicrogeometryTable:
        """The gear's table, of both sides of its teeth."""
        return self.named.microgeometry or GearMicrogeometryTable()

    @property
    def own(self) -> FlankTable:
        """What holds on this side."""
        return self.teeth.flank(self.side)

    @property
    def gear(self) -> Gear:
        """The gear."""
        return (self.pair.pinion, self.pair.wheel)[self.number]

    @property
    def where(self) -> str:
        """Name of the table in messages."""
        return self.named.microgeometry_where

    @property
    def active(self) -> tuple[float, float]:
        """Roll lengths (m) between which it touches the mate."""
        return active_rolls(self.pair)[self.number]


def active_rolls(pair: GearPair) -> tuple[tuple[float, float], tuple[float, float]]:
    """Roll lengths (m) between which pinion and wheel touch on the path of contact."""
    start, end = pair.path_limits(rounded=True)
    return (start, end), (pair.tangent_length - end, pair.tangent_length - start)


def flank_deviations(one: FlankOf) -> ToothDeviations:
    """Deviations of one side of a gear's teeth."""
    made = modification(one)
    try:
        index = _index_deviations(one.teeth, one.side, one.gear, one.where, one.folder)
        turn = pitch_errors.turns(one.gear, index) if index.any() else (0.0,)
        if one.mirrored and len(turn) > 1:
            turn = seen_from_behind(turn, wheel=one.number == 1)
        return tooth_deviations(one.gear, made, turn)
    except InputError as error:
        raise _named(error, one.where, one.own) from None


def pitch_errors_of(
    named: NamedGear, gear: Gear, folder: str | Path = "."
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return how much earlier the flanks of each tooth touch by their pitch errors.

    Parameters
    ----------
    named : NamedGear
        The gear of the job file.
    gear : Gear
        The gear.
    folder : path
        Where files of the table are looked for.

    Returns
    -------
    left, right : tuple of float
        Along the line of action (m), teeth counted from 0 counter-clockwise; empty for flanks without pitch errors.

    Raises
    ------
    InputError
        For every mistake, in the table's own keys.
    """
    table, where = named.microgeometry, named.microgeometry_where
    if table is None:
        return (), ()
    made = []
    for side in ("left", "right"):
        try:
            index = _index_deviations(table, side, gear, where, Path(folder))
            turn = pitch_errors.turns(gear, index) if index.any() else ()
        except InputError as error:
            raise _named(error, where, table.flank(side)) from None
        made.append(tuple(gear.base_radius * e for e in turn))
    return made[0], made[1]


def modification(one: FlankOf) -> FlankModification:
    """Modifications of one side of a gear's teeth, in SI."""
    table, gear, active, where = one.own, one.gear, one.active, one.where
    extra: list[Deviation] = []
    measured: tuple[Deviation, ...] = ()
    if table.points_mm_um:
        s, h = np.array(table.points_mm_um).T
        if gear.internal:  # with the standard's sign, or without
            s = -np.abs(s)
        extra.append(_covering(1e-3 * s, 1e-6 * h, active, f"{where}.points_mm_um", straight=True))
    if table.measured_csv is not None:
        found = _measured(table.measured_csv, gear, active, f"{where}.measured_csv", one.folder)
        if len(found) == 1:
            extra += found
        else:
            measured = seen_from_behind(found, wheel=one.number == 1) if one.mirrored else tuple(found)
    return FlankModification(
        tip_relief=_relief(table, gear, where, "tip"),
        root_relief=_relief(table, gear, where, "root"),
        crowning=1e-6 * table.profile_crowning_um,
        slope=1e-6 * table.profile_slope_um,
        waviness=tuple(Waviness(1e-6 * w.amplitude_um, w.waves, math.radians(w.phase_deg)) for w in table.waviness),
        extra=tuple(extra),
        measured=measured,
    )


def _relief(table: FlankTable, gear: Gear, where: str, end: str) -> Relief | None:
    name = f"{end}_relief"
    amount = getattr(table, f"{name}_um")
    length, start, diameter = (getattr(table, f"{name}_{key}") for key in STARTS)
    given = next((f"{name}_{key}" for key in STARTS if getattr(table, f"{name}_{key}") is not None), None)
    if amount is None:
        if given is not None:
            raise InputError(f"{where}.{name}_um", None, f"is required with {given}", "add the amount")
        return None
    if given is None:
        cure = f"add {name}_length_mm, {name}_start_mm or {name}_start_diameter_mm"
        raise InputError(f"{where}.{name}_length_mm", None, "is required with a relief", cure)
    if length is not None:
        roll = gear.profile.tip_roll - 1e-3 * length if end == "tip" else gear.form_roll + 1e-3 * length
    elif start is not None:
        roll = gear.sign * 1e-3 * abs(start)
    else:
        roll = gear.roll_length(0.5e-3 * abs(diameter))
    ends = (gear.form_roll, min(gear.profile.round_roll, gear.profile.tip_roll))
    if not ends[0] < roll < ends[1]:
        if length is not None:
            zero = gear.profile.tip_roll if end == "tip" else gear.form_roll
            limits = [1e3 * abs(one - zero) for one in ends]
        else:
            limits = [1e3 * abs(one) if start is not None else 2e3 * math.hypot(gear.base_radius, one) for one in ends]
        low, high = sorted(limits)
        problem = f"starts off the active flank: must be > {low:.5g} and < {high:.5g} mm"
        value = next(one for one in (length, start, diameter) if one is not None)
        raise InputError(f"{where}.{given}", value, problem, "start it between form point and tip round")
    last, across = (getattr(table, f"{name}_{key}") for key in ENDS)
    until = None if last is None else gear.sign * 1e-3 * abs(last)
    if across is not None:
        until = gear.roll_length(0.5e-3 * abs(across))
    return Relief(1e-6 * amount, roll, getattr(table, f"{name}_shape"), until)


def _index_deviations(table: GearMicrogeometryTable, side: str, gear: Gear, where: str, folder: Path) -> Array:
    """Index deviations (m) of the flanks of one side, > 0 out of their material, teeth counted counter-clockwise.

    A list of the gear displaces its teeth, > 0 counter-clockwise: out of the material of left flanks, into that of
    right ones. A list of one side is of its flanks, each out of its material.
    """
    flank: FlankTable = getattr(table, side) or FlankTable()
    index = _listed(flank, gear, where, folder)
    if index is None:
        displaced = _listed(table, gear, where, folder)
        index = np.zeros(gear.tooth_count) if displaced is None else displaced if side == "left" else -displaced
    amplitude, phase = flank.run_out_um, flank.run_out_phase_deg
    if amplitude or phase:  # of these flanks; what they do not give is the gear's
        amplitude, phase = amplitude or table.run_out_um, phase or table.run_out_phase_deg
        return index + pitch_errors.sine(gear.tooth_count, 1e-6 * amplitude, math.radians(phase))
    left, right = pitch_errors.run_out(gear, 1e-6 * table.run_out_um, math.radians(table.run_out_phase_deg))
    return index + (left if side == "left" else right)


def _listed(table: FlankTable, gear: Gear, where: str, folder: Path) -> Array | None:
    """Index deviations (m) of all teeth that a table lists, names or draws; None without."""
    if table.pitch_um:
        listed = 1e-6 * np.array(table.pitch_um)
    elif table.single_pitch_um:
        listed = pitch_errors.from_single(1e-6 * np.array(table.single_pitch_um))
    elif table.pitch_csv is not None:
        field = f"{where}.pitch_csv"
        columns = read_numbers(folder / table.pitch_csv, field, ("tooth", "pitch_um"), others=False)
        listed = 1e-6 * columns["pitch_um"][_teeth(columns["tooth"], gear, field, table.pitch_csv)]
    elif table.pitch_class is not None:
        listed = pitch_errors.sampled(gear, table.pitch_class, table.pitch_seed)
    else:
        return None
    if len(listed) != gear.tooth_count:
        key = "pitch_um" if table.pitch_um else "single_pitch_um"
        problem = f"must have one entry for each of the {gear.tooth_count} teeth, has {len(listed)}"
        raise InputError(f"{where}.{key}", list(getattr(table, key)), problem, "give as many as the gear has teeth")
    return listed


def _measured(name: str, gear: Gear, active: tuple[float, float], field: str, folder: Path) -> list[Deviation]:
    """One deviation, or one a tooth."""
    optional = ("roll_length_mm", "diameter_mm", "tooth")
    columns = read_numbers(folder / name, field, ("deviation_um",), optional, others=False)
    if "roll_length_mm" in columns:
        roll = 1e-3 * columns["roll_length_mm"]
        roll = -np.abs(roll) if gear.internal else roll
    elif "diameter_mm" in columns:
        roll = rolls_at(gear, columns["diameter_mm"], field)
    else:
        raise InputError(field, name, "has neither of the columns roll_length_mm and diameter_mm", "add one")
    height = 1e-6 * columns["deviation_um"]
    if "tooth" not in columns:
        return [_covering(roll, height, active, field)]
    teeth = columns["tooth"]
    _teeth(np.unique(teeth), gear, field, name)
    return [
        _covering(roll[teeth == t], height[teeth == t], active, f"{field}, tooth {t}") for t in range(gear.tooth_count)
    ]


def rolls_at(gear: Gear, diameters: Array, field: str) -> Array:
    """Return the roll lengths (m) at measured diameters (mm), which may be negative on an internal gear.

    Raises
    ------
    InputError
        For diameters without an involute: inside of the base circle, or negative on an external gear.
    """
    base = 2e3 * gear.base_radius
    sizes = np.abs(diameters) if gear.internal else diameters
    lost = diameters[sizes < base * (1.0 - 1e-9)]
    if len(lost):
        problem = f"no involute there: must be >= {base:.6g} mm, the base circle"
        raise InputError(f"{field}, diameter_mm", float(lost[0]), problem, "is it a diameter in mm?")
    return np.array([gear.roll_length(0.5e-3 * size) for size in sizes])


def _covering(
    roll: Array, height: Array, active: tuple[float, float], field: str, *, straight: bool = False
) -> Deviation:
    order = np.argsort(roll, kind="stable")
    try:
        made = (Deviation.straight if straight else Deviation.through)(roll[order], height[order])
    except InputError as error:
        raise InputError(field, None, error.problem, error.cure) from None
    low, high = made.breaks[0], made.breaks[-1]
    if low > active[0] + 1e-9 or high < active[1] - 1e-9:
        problem = (
            f"covers {1e3 * low:.5g} to {1e3 * high:.5g} mm of roll length: must cover {1e3 * active[0]:.5g} to "
            f"{1e3 * active[1]:.5g} mm, the path of contact"
        )
        raise InputError(field, None, problem, "give more points; nothing is extrapolated")
    return made


def _teeth(numbers: Array, gear: Gear, field: str, name: str) -> IntArray:
    """Order that sorts the teeth, each of which must be there once."""
    order = np.argsort(numbers, kind="stable")
    if len(numbers) != gear.tooth_count or not np.array_equal(numbers[order], np.arange(gear.tooth_count)):
        problem = f"must have the teeth 0 to {gear.tooth_count - 1}, each once: it has {len(numbers)}"
        raise InputError(field, name, problem, "list all teeth; tooth 0 stands on the line of centres at angle 0")
    return order


def _named(error: InputError, where: str, table: FlankTable) -> InputError:
    """The same error in the words of the job file."""
    if error.field.startswith(where):
        return error
    given = [key for key in ("pitch_um", "single_pitch_um", "pitch_csv", "pitch_class") if getattr(table, key)]
    names = {
        "tip_relief.amount": "tip_relief_um",
        "tip_relief.start": "tip_relief_start_mm",
        "tip_relief.end": "tip_relief_end_mm",
        "root_relief.amount": "root_relief_um",
        "root_relief.start": "root_relief_start_mm",
        "root_relief.end": "root_relief_end_mm",
        "crowning": "profile_crowning_um",
        "slope": "profile_slope_um",
        "extra[0]": "points_mm_um" if table.points_mm_um else "measured_csv",
        "extra[1]": "measured_csv",
        "pitch errors": (given or ["run_out_um"])[0],
    }
    key, value = error.field, error.value
    if key.startswith("waviness"):
        key = f"{key}_um"
    key = names.get(key, "measured_csv" if key.startswith("measured") else key)
    if isinstance(value, float):
        value = float(f"{(1e3 if key.endswith('_mm') else 1e6) * value:.6g}")
    return InputError(f"{where}.{key}", value, error.problem, error.cure)
