"""A REXS model: components with attributes, relations between them, load cases; without any meaning yet.

What components and attributes mean: https://www.rexs.info. A value is kept as the file has it: numbers as `Decimal`,
texts, truth values, lists of these; `Attribute.number` converts.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from typing import Any

from ....base.errors import InputError
from .units import converted


@dataclass(frozen=True)
class Attribute:
    """One attribute of a component.

    Attributes
    ----------
    name
        Identifier in REXS 2.0.0.
    value
        `Decimal`, int, bool, str, or lists of them; None: the file gives the attribute without a value.
    unit
        Unit of the value.
    written
        Identifier that the file has.
    known
        Whether the schema of 2.0.0 has it for its component.
    assumed
        Whether the file gives no unit: it is that of the schema.
    """

    name: str
    value: Any
    unit: str = "none"
    written: str = ""
    known: bool = True
    assumed: bool = False

    def number(self, unit: str) -> float:
        """Return the value as a float in a unit."""
        return converted(self.value, self.unit, unit)

    def numbers(self, unit: str) -> tuple[float, ...]:
        """Return the values of an array in a unit."""
        return tuple(converted(item, self.unit, unit) for item in self.value)


@dataclass(frozen=True)
class Component:
    """A machine element or a part of one."""

    number: int
    kind: str
    name: str = ""
    attributes: Mapping[str, Attribute] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """Return type, number and name, for messages and comments."""
        name = self.name.removesuffix(f"[{self.number}]").strip()
        return f"{self.kind} {self.number}" + (f" ({name})" if name else "")


@dataclass(frozen=True)
class Relation:
    """Relation of components: role -> number of the component with this role."""

    number: int
    kind: str
    roles: Mapping[str, int]
    order: int | None = None


@dataclass(frozen=True)
class LoadCase:
    """Attributes that components have in one load case."""

    number: int
    components: tuple[Component, ...]


@dataclass(frozen=True)
class LoadSpectrum:
    """Load cases, and components with what was accumulated over them."""

    number: int
    cases: tuple[LoadCase, ...]
    accumulation: tuple[Component, ...] = ()


@dataclass(frozen=True)
class Model:
    """A file.

    Attributes
    ----------
    version
        Version of REXS, ``1.0`` to ``2.0``.
    application, date
        Program that wrote it, and when.
    components
        Number -> component.
    relations, spectra
        Relations and load spectra in the order of the file.
    notes
        What the reader of the file ignored, as files beside the model in an archive.
    """

    version: str
    application: str
    date: str
    components: Mapping[int, Component]
    relations: tuple[Relation, ...]
    spectra: tuple[LoadSpectrum, ...] = ()
    notes: tuple[str, ...] = ()

    def of_kind(self, *kinds: str) -> list[Component]:
        """Return all components of these types, in the order of their numbers."""
        return [self.components[number] for number in sorted(self.components) if self.components[number].kind in kinds]

    def joined(self, kind: str, role: str, number: int) -> Iterator[Relation]:
        """Yield the relations of a type in which a component has a role, ordered ones in their order."""
        found = [item for item in self.relations if item.kind == kind and item.roles.get(role) == number]
        yield from sorted(found, key=lambda item: (item.order is None, item.order or 0))

    def partners(self, kind: str, role: str, number: int, other: str) -> list[Component]:
        """Return the components with another role in the relations in which a component has a role.

        Parameters
        ----------
        kind
            Type of the relations.
        role, number
            Role and number of the component.
        other
            Role of its partners.
        """
        return [self.components[item.roles[other]] for item in self.joined(kind, role, number) if other in item.roles]


def whole(value: Any, where: str) -> int:
    """Return a whole number.

    Raises
    ------
    InputError
        For anything else.
    """
    if isinstance(value, (int, Decimal)) and not isinstance(value, bool) and value == int(value):
        return int(value)
    raise InputError(where, value, "must be a whole number", "correct it in the file")
