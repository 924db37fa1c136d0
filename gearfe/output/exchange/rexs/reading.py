"""Hold the state of a conversion: the model, its frames, the names in the job, the list of values."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable
from typing import Any

from ....base.errors import InputError
from .frames import Axes, Frame, axes_along, frames_of
from .ledger import DEFAULTED, DERIVED, IGNORED, READ, Entry, plain
from .model import Attribute, Component, Model
from .schema import OWN

#: Type of a component -> table of a job that it becomes an entry of.
TABLES = {
    "material": "materials",
    "cylindrical_gear": "gears",
    "ring_gear": "gears",
    "cylindrical_stage": "meshes",
    "shaft": "shafts",
    "rolling_bearing_with_catalog_geometry": "bearings",
    "rolling_bearing_with_detailed_geometry": "bearings",
    "concept_bearing": "bearings",
    "coupling": "couplings",
    "switchable_coupling": "couplings",
    "additional_mass": "machines",
}
#: Types of components that modify flanks.
MODIFICATIONS = (
    "tip_relief", "root_relief", "end_relief_datum_face", "end_relief_non_datum_face", "profile_crowning",
    "helix_crowning", "profile_slope", "helix_slope", "profile_twist", "triangular_tip_relief",
    "triangular_root_relief", "profile_deviation", "helix_deviation", "topographical_modification",
)  # fmt: skip
#: Types of components that a job takes something from.
TAKEN = {
    *TABLES, *MODIFICATIONS, "gear_unit", "gear_casing", "external_load", "lubricant", "shaft_section", "gear_body",
    "cylindrical_gear_flank", "cylindrical_stage_gear_data", "cylindrical_gear_manufacturing_settings",
    "rack_shaped_tool", "cutter_wheel_tool", "rolling_bearing_row", "rolling_element", "planetary_stage",
    "planet_carrier",
}  # fmt: skip
#: Names that this program wrote.
_NAME = re.compile(r"[^\W_][\w-]{0,79}")
#: Longest name of a part.
LONGEST = 60


class Reading:
    """A conversion under way.

    Attributes
    ----------
    model
        The model.
    frames
        Number of a component -> its coordinate system.
    axes
        Axes of the job.
    entries
        The list.
    used
        Numbers of components, and (component, attribute), that became part of the job or of the list.
    names, numbers
        Number of a component -> name of its part of the job; (table, name) -> number.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.frames: dict[int, Frame] = frames_of(model)
        shafts = [self.frames[item.number] for item in model.of_kind("shaft") if item.number in self.frames]
        self.axes: Axes = axes_along(shafts[0].u if shafts else (1.0, 0.0, 0.0))
        self.entries: list[Entry] = []
        self.used: set[tuple[int, str]] = set()
        self.relations: set[int] = set()
        self.names: dict[int, str] = {}
        self.numbers: dict[tuple[str, str], int] = {}
        self._taken: set[tuple[str, str]] = set()

    def name(self, component: Component) -> str:
        """Return the name of the part of the job that a component becomes: letters, digits, _ and -; each one once."""
        if component.number in self.names:
            return self.names[component.number]
        # FVA-Workbench: NAME [number], and for planets NAME [number of the first one] @ angle @ angle @ angle
        text, turned, _ = component.name.removesuffix(f"[{component.number}]").partition(" @ ")
        text = re.sub(r"\s*\[\d+\]$", "", text) if turned else text
        text = unicodedata.normalize("NFKC", text)
        name = re.sub(r"[^\w-]+", "_", text).strip("_-")[:LONGEST].strip("_-")
        own = self.text(component, f"{OWN}name")
        name = own if _NAME.fullmatch(own) else name or f"{component.kind}_{component.number}"
        table = TABLES.get(component.kind, component.kind)
        for candidate in (name, f"{name}_{component.number}", f"{component.kind}_{component.number}"):
            if (table, candidate.casefold()) not in self._taken:
                self._taken.add((table, candidate.casefold()))
                self.names[component.number] = candidate
                self.numbers[table, candidate] = component.number
                return candidate
        raise InputError("name of a component", component.name, "cannot be made unique", "rename it")

    def part(self, table: str, name: str) -> Component:
        """Return the component that an entry of a table is."""
        return self.model.components[self.numbers[table, name]]

    def attribute(self, component: Component | None, name: str) -> Attribute | None:
        """Return an attribute with a value, and note that it is used; None: there is none."""
        if component is None:
            return None
        found = component.attributes.get(name)
        if found is None or found.value is None:
            return None
        self.used.add((component.number, name))
        return found

    def number(self, component: Component | None, name: str, unit: str, key: str = "", rule: str = "") -> float | None:
        """Return an attribute in a unit; None without it.

        Parameters
        ----------
        component, name
            Component and attribute.
        unit
            Unit of the number that is returned.
        key
            Key of the job that it is read into, for the list; empty: the caller notes it.
        rule
            How the key follows from it; empty: it is the number.
        """
        found = self.attribute(component, name)
        if found is None or component is None:
            return None
        if key:
            self.note(DERIVED if rule else READ, component, name, key, rule)
        return found.number(unit)

    def integer(self, component: Component, name: str, key: str = "") -> int | None:
        """Return a whole number."""
        found = self.attribute(component, name)
        if found is None:
            return None
        if key:
            self.note(READ, component, name, key)
        return int(found.value)

    def text(self, component: Component | None, name: str) -> str:
        """Return a text or a value of an enumeration; empty without it."""
        found = self.attribute(component, name)
        return "" if found is None else str(found.value)

    def flag(self, component: Component, name: str) -> bool | None:
        """Return a truth value; of an array, that of the engaged gear of the gear unit; None without it."""
        found = self.attribute(component, name)
        if found is None:
            return None
        if not isinstance(found.value, list):
            return bool(found.value)
        units = self.model.of_kind("gear_unit")
        engaged = self.attribute(units[0], "gear_shift_index") if units else None
        number = 1 if engaged is None else int(engaged.value)
        return bool(found.value[min(max(number, 1), len(found.value)) - 1])

    def note(self, kind: str, component: Component | None, attribute: str, key: str = "", rule: str = "") -> None:
        """Add a line to the list.

        Parameters
        ----------
        kind
            One of `gearfe.output.exchange.rexs.ledger.KINDS`.
        component, attribute
            What it is about; None: the whole model.
        key
            Key of the job.
        rule
            How it follows, or why it is ignored.
        """
        of = ("", 0) if component is None else (component.kind, component.number)
        self.entries.append(Entry(kind, of[0], of[1], attribute, key, plain(rule)))

    def derived(self, component: Component | None, attribute: str, key: str, rule: str) -> None:
        """Note a value that follows from others.

        Parameters
        ----------
        component, attribute
            What it follows from.
        key
            Key of the job.
        rule
            How.
        """
        self.note(DERIVED, component, attribute, key, rule)

    def defaulted(self, component: Component | None, key: str, rule: str) -> None:
        """Note a value that the file does not give."""
        self.note(DEFAULTED, component, "", key, rule)

    def ignored(self, component: Component, attribute: str, rule: str) -> None:
        """Note an attribute that has no place in the job."""
        self.used.add((component.number, attribute))
        self.note(IGNORED, component, attribute, "", rule)

    def parts(self, component: Component, relation: str, role: str, other: str, *kinds: str) -> list[Component]:
        """Return the partners of a component in relations, and note that the relations are used.

        Parameters
        ----------
        component
            The component.
        relation
            Type of the relations.
        role, other
            Role of the component, and of its partners.
        *kinds
            Types of the partners; none: any.
        """
        found = []
        for item in self.model.joined(relation, role, component.number):
            partner = self.model.components[item.roles[other]] if other in item.roles else None
            if partner is not None and (not kinds or partner.kind in kinds):
                self.relations.add(item.number)
                found.append(partner)
        return found

    def place(self, component: Component) -> tuple[float, float, float] | None:
        """Return x, y, z (mm) of a component's origin in the axes of the job; None if unknown."""
        frame = self.frames.get(component.number)
        if frame is None:
            return None
        self.used |= {(component.number, name) for name in POSE}
        return self.axes.of(frame.origin)

    def leftovers(self, why: Callable[[Component, str, Any], str]) -> None:
        """Note every attribute and relation that no line of the list names yet."""
        named = {(entry.number, word) for entry in self.entries for word in re.findall(r"\w+", entry.attribute)}
        for number in sorted(self.model.components):
            component = self.model.components[number]
            if component.kind not in TAKEN:
                self.note(IGNORED, component, "component", "", f"a job has nothing for a {component.kind}")
            for name, attribute in component.attributes.items():
                if attribute.assumed and attribute.value is not None:
                    self.note(DEFAULTED, component, f"unit of {name}", "", f"{attribute.unit}, that of the standard")
                if (number, name) in named:
                    continue
                if (number, name) not in self.used:
                    self.note(IGNORED, component, name, "", why(component, name, attribute.value))
                elif name in POSE:
                    self.note(READ, component, name, "", "place and direction")
                else:
                    self.note(READ, component, name, "", "taken into account")
        for relation in self.model.relations:
            if relation.number not in self.relations:
                kinds = ", ".join(sorted({self.model.components[item].kind for item in relation.roles.values()}))
                rule = f"of {kinds}: nothing in the job follows from it"
                self.entries.append(Entry(IGNORED, "relation", relation.number, relation.kind, "", plain(rule)))


#: Attributes of the place of a component.
POSE = ("reference_component_for_position", "support_vector", "u_axis_vector", "w_axis_vector")
