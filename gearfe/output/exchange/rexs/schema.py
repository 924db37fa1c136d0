"""Components, attributes, units and relations of REXS 2.0.0, and the names that older versions give them.

The file ``table.txt`` next to this module holds the identifiers of the schema of the REXS API
(https://github.com/fva-net/rexs-api-java).
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources

#: Version that is written, and those that are read.
VERSION = "2.0"
VERSIONS = ("1.0", "1.1", "1.2", "1.3", "1.4", "1.5", "1.6", "1.7", "2.0")
#: Attributes of other programs, which the specification allows beside its own, and those of gearfe.
CUSTOM, OWN = "custom_", "custom_gearfe_"
#: Component types that are gone -> type in 2.0.0; of stages and gears that are not cylindrical they stay unknown.
RENAMED_COMPONENTS = {
    "flank_geometry": "cylindrical_gear_flank",
    "stage_gear_data": "cylindrical_stage_gear_data",
    "fixed_coupling": "coupling",
}
#: Relation of version 1.0 that is a ``side`` later, and its roles.
OLD_SIDE, OLD_ROLES = "coupling", {"side_1": "inner_part", "side_2": "outer_part"}


@dataclass(frozen=True)
class AttributeType:
    """One attribute of the schema.

    Attributes
    ----------
    name
        Identifier.
    kind
        Type of its value: ``floating_point``, ``integer``, ``enum``, ..., with ``_array`` or ``_matrix`` for several.
    unit
        Unit by its name in REXS; ``none`` without one.
    choices
        Values of an enumeration; empty: any.
    """

    name: str
    kind: str
    unit: str
    choices: tuple[str, ...] = ()


@dataclass(frozen=True)
class Schema:
    """The table.

    Attributes
    ----------
    attributes
        Identifier -> its type.
    components
        Component type -> identifiers of its attributes.
    relations
        Relation type -> pairs and triples of (component type, role) that it may join.
    ordered
        Relation types that need an order.
    renamed
        Identifier of an attribute in an older version -> in 2.0.0.
    """

    attributes: Mapping[str, AttributeType]
    components: Mapping[str, frozenset[str]]
    relations: Mapping[str, frozenset[frozenset[tuple[str, str]]]]
    ordered: frozenset[str]
    renamed: Mapping[str, str]

    def attribute(self, component: str, name: str) -> AttributeType | None:
        """Return the attribute of a component type; None: the schema has none of this name."""
        return self.attributes[name] if name in self.components.get(component, ()) else None

    def current(self, component: str, name: str) -> str:
        """Return the name in 2.0.0 of an attribute of a component type, which may be that of an older version."""
        known = self.components.get(component, frozenset())
        new = self.renamed.get(name, name)
        return new if name not in known and new in known else name


@functools.cache
def schema() -> Schema:
    """Return the table of REXS 2.0.0."""
    text = resources.files(__package__).joinpath("table.txt").read_text(encoding="utf-8")
    attributes: dict[str, AttributeType] = {}
    components: dict[str, frozenset[str]] = {}
    relations: dict[str, frozenset[frozenset[tuple[str, str]]]] = {}
    ordered, renamed, names = set(), {}, []
    for line in text.splitlines():
        if line.startswith("#"):
            continue
        kind, name, *fields = line.split("\t")
        if kind == "attribute":
            choices = tuple(fields[2].split(",")) if len(fields) > 2 else ()
            attributes[name] = AttributeType(name, fields[0], fields[1], choices)
            names.append(name)
        elif kind == "component":
            components[name] = frozenset(names[int(number)] for number in fields[0].split())
        elif kind == "relation":
            if fields[0] == "ordered":
                ordered.add(name)
            relations[name] = frozenset(_joined(text) for text in fields[1].split())
        else:
            renamed[name] = fields[0]
    return Schema(attributes, components, relations, frozenset(ordered), renamed)


def _joined(text: str) -> frozenset[tuple[str, str]]:
    pairs = [item.split(":") for item in text.split("+")]
    return frozenset((component, role) for component, role in pairs)
