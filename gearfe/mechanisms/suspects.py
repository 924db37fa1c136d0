"""Values of a mechanism file that look as if they were in another unit than their key says: remarks, no errors."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator
from typing import Any

from ..errors import shown

#: A length so many times the median of all lengths is suspected: a millimetre is 1000 times too long as a metre.
FAR = 200.0
#: Keys in metres that are no sizes of the mechanism.
_OTHER = ("mesh_unit_m",)


def _numbers(value: Any, name: str, key: str) -> Iterator[tuple[str, str, float]]:
    """Each number of a table: its full name, the key with the unit, the number."""
    if isinstance(value, dict):
        for inner, item in value.items():
            # names of points stand below the key that has the unit
            yield from _numbers(item, f"{name}.{inner}" if name else inner, key if key.endswith("_m") else inner)
    elif isinstance(value, list):
        for i, item in enumerate(value):
            yield from _numbers(item, f"{name}[{i}]", key)
    elif isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e75:
        yield name, key, float(value)


def suspects(raw: dict[str, Any]) -> list[str]:
    """Return sentences about angles in rad that may be degrees, and lengths in m that may be millimetres.

    Parameters
    ----------
    raw
        Parsed tables of a mechanism file.
    """
    sentences = []
    lengths = []
    for name, key, number in _numbers(raw, "", ""):
        if key == "angle_rad" and abs(number) > 2.0 * math.pi:
            turns = abs(number) / (2.0 * math.pi)
            degrees = name.removesuffix("_rad") + "_deg"
            sentences.append(
                f"{shown(name)[1:-1]} = {number:g} is {turns:.3g} turns; "
                f"if it is in degrees, write {degrees} = {number:g}"
            )
        if key.endswith("_m") and not key.endswith("N_m") and key not in _OTHER and number != 0.0:
            lengths.append((name, abs(number)))
    if len(lengths) > 2:
        middle = statistics.median(length for _, length in lengths)
        far = [(name, length) for name, length in lengths if length > FAR * middle]
        if far:
            name, length = max(far, key=lambda item: item[1])
            sentences.append(
                f"{shown(name)[1:-1]} = {length:g} m is {length / middle:.0f} times the median of all lengths, "
                f"{middle:.3g} m; if it is in millimetres, write {1e-3 * length:g}"
            )
    return sentences
