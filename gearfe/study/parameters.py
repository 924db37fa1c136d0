"""Parameters of a study: keys of the job by dotted names, and the values that they take."""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.config import build, check_size, type_hints
from ..base.errors import InputError, given, unknown_name
from ..base.tables.gearbox import NamedGear
from ..base.tables.jobs import NAMED, OF_GEARS, TABLES, gearbox_of, table_class
from ..base.tables.mechanism import MechanismFile
from ..base.tables.study import DistributionTable
from ..base.typing import Array
from ..gears.geometry.pair import gear_of
from ..gears.geometry.tolerances import helix_tolerances, tolerances

_KEYS = {field.name for field in dataclasses.fields(DistributionTable)}
WHERE = "study.parameters"
#: Whole numbers are exact as floats up to this size.
WHOLE = 2.0**53
_OF_TRAINS = (*OF_GEARS, "stiffness", "housing", "train")
#: Kind of job -> the tables that decide it.
READ = {
    "stiffness": (*OF_GEARS, "stiffness"),
    "loadmap": (*OF_GEARS, "stiffness", "loadmap"),
    "vibration": (*_OF_TRAINS, "spectrum"),
    "runup": (*_OF_TRAINS, "runup"),
    "modes": (*_OF_TRAINS, "runup", "modes"),
}


@dataclass(frozen=True)
class Parameter:
    """A key of the job and its distribution.

    Attributes
    ----------
    name
        Dotted name of the key.
    whole
        Whether it takes whole numbers only.
    values
        The values it takes, each as likely; empty with a distribution.
    distribution
        In the unit of the key; None with values.
    also
        Further keys that take the same value.
    """

    name: str
    whole: bool
    values: tuple[Any, ...] = ()
    distribution: DistributionTable | None = None
    also: tuple[str, ...] = ()

    @property
    def path(self) -> list[str]:
        """Names from the job's table down to the key; numbers count entries of lists."""
        return self.name.split(".")

    @property
    def ends(self) -> tuple[float, float]:
        """Least and largest value.

        Raises
        ------
        InputError
            For a parameter without two ends.
        """
        d = self.distribution
        if d is None or d.low is None or d.high is None:
            cure = "write { low = a, high = b }"
            raise InputError(f"{WHERE}.{self.name}", None, "has no two ends to search between", cure)
        return d.low, d.high

    def at(self, share: Array) -> list[Any]:
        """Values below which the distribution has these shares: its inverse cumulative distribution, (n,) in [0, 1)."""
        d = self.distribution
        if d is None:
            return [self.values[i] for i in _steps(share, len(self.values))]
        if d.mean is None:
            least, most = given(d.low, f"{self.name}.low"), given(d.high, f"{self.name}.high")
            if self.whole:
                first = math.ceil(least)
                return [first + int(i) for i in _steps(share, math.floor(most) - first + 1)]
            return (least + (most - least) * share).tolist()
        from scipy.special import ndtr, ndtri

        deviation = given(d.standard_deviation, f"{self.name}.standard_deviation")
        low, high = (None if end is None else (end - d.mean) / deviation for end in (d.low, d.high))
        below, upto = 0.0 if low is None else ndtr(low), 1.0 if high is None else ndtr(high)
        # a share of 0 has no value in a tail without an end
        inside = np.clip(below + (upto - below) * share, np.finfo(float).tiny, 1.0 - np.finfo(float).epsneg)
        values = d.mean + deviation * ndtri(inside)
        clipped = np.clip(values, d.low, d.high) if low is not None or high is not None else values
        return [round(v) for v in clipped.tolist()] if self.whole else clipped.tolist()

    def levels(self) -> Sequence[Any]:
        """Values for a factorial design."""
        d = self.distribution
        if d is None:
            return self.values
        if d.mean is None and d.low is not None and d.high is not None:
            if d.count is not None and not self.whole:
                return np.linspace(d.low, d.high, d.count).tolist()
            if self.whole and d.count is None:
                return range(math.ceil(d.low), math.floor(d.high) + 1)
        cure = "give a list of values, or low, high and count (whole numbers: low and high)"
        raise InputError(f"{WHERE}.{self.name}", None, "has no levels for a factorial design", cure)


def _steps(share: Array, count: int) -> Array:
    return np.minimum((np.asarray(share) * count).astype(int), count - 1)


def read_parameters(given: Mapping[str, Any], kind: str, base: Mapping[str, Any]) -> tuple[Parameter, ...]:
    """Parameters of a job of this kind; `base` are its tables, whose gears tolerances are of.

    Raises
    ------
    InputError
        Names of keys that do not exist, with the near match, or that clash; values that are no distribution.
    """
    made, flat = [], _flat(given, "")
    for name, spec in flat.items():
        whole_key = next((other for other in flat if name.startswith(f"{other}.")), None)
        if whole_key is not None:
            raise InputError(
                f"{WHERE}.{name}", None, f"is an entry of {whole_key}, which is varied, too", "leave one out"
            )
        hint, label = key_hint(kind, name, base), f"{WHERE}.{name}"
        whole = int in _options(hint) and float not in _options(hint)
        if isinstance(spec, list):
            if not spec:
                raise InputError(label, [], "is empty", "give at least one value")
            for value in spec:
                _check_sizes(value, label)
            made.append(Parameter(name, whole, tuple(spec)))
            continue
        distribution = build(DistributionTable, spec, label)
        also = distribution.also
        if not {int, float} & set(_options(hint)):
            raise InputError(label, None, "is no number: low, high, mean do not apply", "give a list of values")
        if distribution.iso_class is not None:
            distribution = _of_class(distribution, distribution.iso_class, name, base)
        for end in ("low", "high", "mean", "standard_deviation") if whole else ():
            if abs(getattr(distribution, end) or 0.0) > WHOLE:
                problem = f"must be of a size up to {WHOLE:.3g}, for the key takes whole numbers"
                raise InputError(f"{label}.{end}", getattr(distribution, end), problem, "take a smaller one")
        if (
            whole
            and distribution.low is not None
            and distribution.high is not None
            and math.ceil(distribution.low) > distribution.high
        ):
            raise InputError(label, (distribution.low, distribution.high), "holds no whole number", "widen it")
        for other in also:
            key_hint(kind, other, base)
        made.append(Parameter(name, whole, distribution=distribution, also=also))
    return tuple(made)


def _check_sizes(value: Any, label: str) -> None:
    """Numbers of a value, within lists and tables too, are such as a key can have."""
    if isinstance(value, (list, dict)):
        for inner in value.values() if isinstance(value, dict) else value:
            _check_sizes(inner, label)
    elif isinstance(value, (int, float)):
        check_size(value, label, "change that value of the list")


def _of_class(found: DistributionTable, class_: int, name: str, base: Mapping[str, Any]) -> DistributionTable:
    """Normal, with three standard deviations to the tolerance f_HaT or f_HbT of the slope, and truncated there."""

    parts = name.split(".")
    slopes = ("profile_slope_um", "helix_slope_um")
    named = _gear_named(parts, base) if parts[-1] in slopes else None
    if named is None:
        cure = f"use it for {' and '.join(slopes)}; pitch errors of a class: pitch_class, and vary pitch_seed"
        raise InputError(f"{WHERE}.{name}.iso_class", class_, "has no tolerance for this key", cure)
    gear = gear_of(named)
    of_helix = parts[-1] == "helix_slope_um"
    slope = helix_tolerances(gear, class_).helix_slope if of_helix else tolerances(gear, class_).slope
    allowed = 1e6 * slope
    mean = found.mean or 0.0
    return DistributionTable(mean=mean, standard_deviation=allowed / 3.0, low=mean - allowed, high=mean + allowed)


def _gear_named(parts: Sequence[str], base: Mapping[str, Any]) -> NamedGear | None:
    """The gear that a key of a microgeometry is of: [microgeometry.pinion] or [gears.NAME.microgeometry]."""
    if parts[0] == "microgeometry" or parts[2:3] == ["microgeometry"]:
        return gearbox_of(dict(base), "the base job").gears.get(parts[1])
    return None


def _flat(given: Mapping[str, Any], above: str) -> dict[str, Any]:
    """Dotted name -> list or distribution; names may be quoted or be tables within tables."""
    flat: dict[str, Any] = {}
    for key, value in given.items():
        name = f"{above}{key}"
        if isinstance(value, list) or (isinstance(value, dict) and value and set(value) <= _KEYS):
            flat |= _once(flat, {name: value})
        elif isinstance(value, dict) and value:
            near = [k for k in value if k in _KEYS and not isinstance(value[k], (dict, list))]
            if near:
                wrong = next(k for k in value if k not in _KEYS)
                raise unknown_name(f"{WHERE}.{name}", wrong, _KEYS)
            flat |= _once(flat, _flat(value, f"{name}."))
        else:
            cure = "write [a, b, c], { low = a, high = b }, { mean = a, standard_deviation = b } or { iso_class = 6 }"
            raise InputError(f"{WHERE}.{name}", value, "must be a list of values or a distribution", cure)
    return flat


def _once(found: Mapping[str, Any], more: dict[str, Any]) -> dict[str, Any]:
    for name in more:
        if name in found:
            raise InputError(f"{WHERE}.{name}", None, "occurs twice, quoted and as tables", "leave one out")
    return more


def key_hint(kind: str, name: str, base: Mapping[str, Any]) -> Any:
    """Type of the key with this dotted name in a job of this kind; `base` are its tables.

    Raises
    ------
    InputError
        When there is no such key, with the nearest that exists.
    """
    parts = name.split(".")
    where, rest = WHERE, parts
    hint: Any
    if kind == "mechanism":
        hint = MechanismFile
        given = base.get("parameters", {})
        if parts[0] == "parameters" and len(parts) == 2 and parts[1] not in given:  # no entry of the file uses it
            raise unknown_name(f"{where}.parameters", parts[1], given)
    else:
        if parts[0] in (*TABLES, *NAMED) and parts[0] not in READ[kind]:
            problem = f"is no table that a {kind} job reads: it would change nothing"
            raise InputError(where, parts[0], problem, "vary keys of " + ", ".join(READ[kind]))
        if parts[0] not in READ[kind]:
            raise unknown_name(where, parts[0], READ[kind])
        if parts[0] in ("pair", *NAMED) and parts[0] not in base:  # a table of one key would be no gear
            problem = f"is no table of the base job, so {name} has nothing to vary"
            raise InputError(where, parts[0], problem, "vary keys of " + ", ".join(t for t in READ[kind] if t in base))
        hint, where, rest = table_class(parts[0]), f"{where}.{parts[0]}", parts[1:]
        if parts[0] in NAMED:
            hint = dict[str, hint]
        if not rest:
            raise InputError(where, None, "is a table, not a key", "name a key in it")
    there: Any = base if rest is parts else base.get(parts[0])
    for part in rest:
        named = [option for option in _options(hint) if typing.get_origin(option) is dict]
        if isinstance(there, Mapping) and part not in there and any(map(_of_tables, named)):
            raise unknown_name(where, part, there)  # a body, say: a new one would have no other keys
        hint, there = _below(hint, part, where), there.get(part) if isinstance(there, Mapping) else None
        where = f"{where}.{part}"
    if all(dataclasses.is_dataclass(option) for option in _options(hint)):  # a number may be a function of time, too
        raise InputError(where, None, "is a table, not a key", "name a key in it")
    return hint


def _below(hint: Any, part: str, where: str) -> Any:
    """Type of what is named `part` in something of type `hint`."""
    for option in _options(hint):
        origin, inside = typing.get_origin(option), typing.get_args(option)
        if dataclasses.is_dataclass(option):
            hints = type_hints(typing.cast(Any, option))
            names = [field.name for field in dataclasses.fields(option)]
            if part not in names:
                raise unknown_name(where, part, names)
            return hints[part]
        if origin is dict:
            return inside[1]
        if origin is tuple:
            if not part.isdigit():
                raise InputError(where, part, "is a list: an entry has a number, from 0 on", f"write {where}.0")
            if inside[1:] == (Ellipsis,):
                return inside[0]
            if int(part) < len(inside):
                return inside[int(part)]
            raise InputError(where, part, f"has {len(inside)} entries, 0 to {len(inside) - 1}", "choose one")
        if option is Any:
            return Any
    raise InputError(where, part, "has nothing below it", "name the key itself")


def _of_tables(hint: Any) -> bool:
    return any(dataclasses.is_dataclass(option) for option in _options(typing.get_args(hint)[1]))


def _options(hint: Any) -> tuple[Any, ...]:
    """Types that a key may have, without None."""
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        return tuple(option for option in typing.get_args(hint) if option is not type(None))
    return (hint,)
