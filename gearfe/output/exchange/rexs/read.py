"""Read REXS files: XML (.rexs), JSON (.rexsj) and archives of either (.rexsz), all of them input from strangers.

No file makes the reader follow a reference, expand an entity, open another file or write one. Sizes, depths and
numbers of parts are bounded before anything is built. Layout: the schema rexs-file.xsd and the JSON classes of the REXS
API (https://github.com/fva-net/rexs-api-java); https://spec.rexs.info, "Interface structure", "ZIP file format".
"""

from __future__ import annotations

import base64
import binascii
import io
import json
import math
import re
import struct
import zipfile
import zlib
from collections.abc import Iterable, Mapping
from decimal import Decimal, InvalidOperation
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple
from xml.parsers import expat

from ....base.errors import InputError, shown, unknown_name
from ....base.files import read_bytes
from .model import Attribute, Component, LoadCase, LoadSpectrum, Model, Relation, whole
from .schema import CUSTOM, OLD_ROLES, OLD_SIDE, RENAMED_COMPONENTS, VERSIONS, AttributeType, schema
from .units import check_unit

FIELD = "REXS file"
#: Bytes of a model (an archive's after it is unpacked), of an archive, entries in it, depth of XML, and elements of it
#: or values of JSON.
LARGEST, LARGEST_ARCHIVE, MOST_ENTRIES, DEEPEST, MOST_ELEMENTS = 2**26, 2**28, 1000, 12, 4_000_000
#: Endings of models in an archive.
ENDINGS = (".rexs", ".rexsj", ".rexs.xml", ".rexs.json")
#: Most digits and largest power of ten of a number, and most characters of a name.
MOST_DIGITS, LARGEST_POWER, LONGEST_NAME = 60, 300, 1000
#: Codes of binary arrays -> format of one number.
_CODES = {"float64": "d", "float32": "f", "int32": "i"}
_DEVICE = re.compile(r"[A-Za-z]:")


class _Element(NamedTuple):
    """An XML element: its name without namespace, attributes, text and children."""

    tag: str
    attributes: dict[str, str]
    text: list[str]
    children: list[_Element]

    def all(self, tag: str) -> list[_Element]:
        """Children of this name."""
        return [child for child in self.children if child.tag == tag]

    @property
    def content(self) -> str:
        """Text without blanks around it."""
        return "".join(self.text).strip()


def read_rexs(path: str | Path) -> Model:
    """Return the model of a REXS file of version 1.0 to 2.0.

    Raises
    ------
    InputError
        For a file that is no REXS, is too large, or holds entities or paths outside of the archive. For numbers of
        components that are missing or given twice, and relations to components that do not exist. For values of a wrong
        type, and units that do not exist or measure something else.
    """
    return read_model(read_bytes(path, FIELD, LARGEST_ARCHIVE), str(path))


def read_model(raw: bytes, path: str) -> Model:
    """Return the model of the content of a file; `path` names it in messages. Errors are those of `read_rexs`."""
    notes: list[str] = []
    if raw.startswith(b"PK\x03\x04") or raw.startswith(b"PK\x05\x06"):
        raw, notes = _unpacked(raw, path)
    if len(raw) > LARGEST:
        raise InputError(FIELD, path, f"is larger than {LARGEST >> 20} MB", "is it the right file?")
    start = raw.removeprefix(b"\xef\xbb\xbf").lstrip()[:1]
    if start == b"{":
        model = _from_json(raw, path)
    elif start == b"<" or raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        model = _from_xml(raw, path)
    else:
        problem = "is no REXS file: must be XML (.rexs), JSON (.rexsj) or a ZIP archive of one (.rexsz)"
        raise InputError(FIELD, path, problem, "export it as REXS")
    return _checked(_with_notes(model, notes))


def _with_notes(model: Model, notes: list[str]) -> Model:
    return Model(
        model.version, model.application, model.date, model.components, model.relations, model.spectra, tuple(notes)
    )


# --- ZIP ------------------------------------------------------------------------------------------------------------


def _unpacked(raw: bytes, path: str) -> tuple[bytes, list[str]]:
    """Return the only model of an archive, read in memory, and notes on the other files."""
    # before ZipFile builds an object for each; an end record may lie, but each entry begins with its signature
    count = raw.count(b"PK\x01\x02")
    if count > MOST_ENTRIES:
        raise InputError(FIELD, path, f"has {count} files: must be {MOST_ENTRIES} or less", "repack it")
    try:
        with zipfile.ZipFile(io.BytesIO(raw)) as archive:
            entries = archive.infolist()
            for entry in entries:
                _check_entry(entry, path)
            models = [entry for entry in entries if entry.filename.lower().endswith(ENDINGS)]
            if len(models) != 1:
                names = ", ".join(entry.filename[:80] for entry in models[:6]) or "none"
                problem = f"must hold one model ({', '.join(ENDINGS)}): it has {len(models)} ({names})"
                raise InputError(FIELD, path, problem, "take the others out, or give the model itself")
            with archive.open(models[0]) as stream:
                content = stream.read(LARGEST + 1)
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError, NotImplementedError) as error:
        if isinstance(error, InputError):
            raise
        reason = str(error) or type(error).__name__
        raise InputError(FIELD, path, f"is no sound ZIP archive ({reason[:200]})", "export it again") from None
    if len(content) > LARGEST:
        problem = f"unpacks to more than {LARGEST >> 20} MB"
        raise InputError(FIELD, path, problem, "is it the right file? An honest model is a few MB")
    others = [entry.filename for entry in entries if entry is not models[0] and not entry.is_dir()]
    return content, [f"file {name[:200]} of the archive: not read" for name in others]


def _check_entry(entry: zipfile.ZipInfo, path: str) -> None:
    """Raise `InputError` for a name outside of the archive, an encrypted entry, a method that is not deflate."""
    name = entry.filename
    parts = PurePosixPath(name.replace("\\", "/"))
    if parts.is_absolute() or ".." in parts.parts or _DEVICE.match(name) or "\0" in name:
        problem = f"holds a file with the path {shown(name)}, outside of the archive"
        raise InputError(FIELD, path, problem, "repack it with relative paths")
    if entry.flag_bits & 1:
        raise InputError(FIELD, path, f"is encrypted ({shown(name)})", "unpack it, and give the model itself")
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        problem = f"is packed by a method that REXS does not have ({shown(name)})"
        raise InputError(FIELD, path, problem, "repack it with deflate")


# --- XML ------------------------------------------------------------------------------------------------------------


def _from_xml(raw: bytes, path: str) -> Model:
    root = _parsed(raw, path)
    if root.tag != "model":
        raise InputError(FIELD, path, f"is no REXS: its first element is <{root.tag[:80]}>, not <model>", "export it")
    components = [_xml_component(item) for group in root.all("components") for item in group.all("component")]
    relations = []
    for group in root.all("relations"):
        for item in group.all("relation"):
            refs = [(ref.attributes.get("role", ""), ref.attributes.get("id"), ref.attributes.get("hint", ""))
                    for ref in item.all("ref")]  # fmt: skip
            relations.append(_relation(item.attributes, refs))
    spectra = [
        LoadSpectrum(
            _number(spectrum.attributes.get("id", "1"), "load_spectrum id"),
            tuple(_load_case(case.attributes.get("id"), map(_xml_component, case.all("component")))
                  for case in spectrum.all("load_case")),
            tuple(_xml_component(item) for group in spectrum.all("accumulation") for item in group.all("component")),
        )
        for spectrum in root.all("load_spectrum")
    ]  # fmt: skip
    return _model(root.attributes, components, relations, spectra, path)


def _parsed(raw: bytes, path: str) -> _Element:
    """Tree of XML without a document type, hence without entities of its own."""
    top = _Element("", {}, [], [])
    stack, count = [top], 0
    parser = expat.ParserCreate()
    parser.buffer_text = True

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if count > MOST_ELEMENTS or len(stack) > DEEPEST:
            problem = (
                f"has more than {MOST_ELEMENTS} elements" if count > MOST_ELEMENTS else "nests its elements too deep"
            )
            raise InputError(FIELD, path, problem, "is it the right file?")
        element = _Element(name.rpartition(":")[2], attributes, [], [])
        stack[-1].children.append(element)
        stack.append(element)

    def add(text: str) -> None:
        stack[-1].text.append(text)

    def refuse(*_: Any) -> None:
        problem = "has a document type (<!DOCTYPE ...>), which REXS has not: entities in it could grow without bound"
        raise InputError(FIELD, path, problem, "take that line out, or export it again")

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: stack.pop()
    parser.CharacterDataHandler = add
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(raw, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        problem = f"is no valid XML ({reason}, line {error.lineno})"
        raise InputError(FIELD, path, problem, "export it again") from None
    except (LookupError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(FIELD, path, f"is no valid XML ({str(error)[:200]})", "save it as UTF-8") from None
    return top.children[0]


def _xml_component(item: _Element) -> Component:
    values = []
    for attribute in item.all("attribute"):
        nested = next(
            (child for child in attribute.children if child.tag in ("array", "matrix", "array_of_arrays")), None
        )
        value: Any = attribute.content
        if nested is not None and nested.tag == "array":
            value = _xml_array(nested)
        elif nested is not None and nested.tag == "matrix":
            code = nested.attributes.get("code")
            value = (_decoded(code, nested.content, "matrix") if code
                     else [[cell.content for cell in row.all("c")] for row in nested.all("r")])  # fmt: skip
        elif nested is not None:
            value = [_xml_array(child) for child in nested.all("array")]
        values.append((attribute.attributes.get("id", ""), attribute.attributes.get("unit"), value))
    return _component(item.attributes, values)


def _xml_array(element: _Element) -> list[Any]:
    code = element.attributes.get("code")
    return _decoded(code, element.content, "array") if code else [cell.content for cell in element.all("c")]


def _decoded(code: str, text: str, where: str) -> list[Any]:
    """Numbers of a binary array: little-endian, in base 64."""
    if code not in _CODES:
        raise unknown_name(f"code of an {where}", code, _CODES)
    size = struct.calcsize(_CODES[code])
    try:
        content = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        raise InputError(f"{where} in base 64", text, "is damaged", "export the file again") from None
    if len(content) % size:
        problem = f"has {len(content)} bytes, no multiple of {size}"
        raise InputError(f"{where} in base 64", None, problem, "export the file again")
    return list(struct.unpack(f"<{len(content) // size}{_CODES[code]}", content))


# --- JSON -----------------------------------------------------------------------------------------------------------


def _from_json(raw: bytes, path: str) -> Model:
    # before any is built: each value after the first one of all follows one of these, blanks and a key aside
    if sum(raw.count(mark) for mark in (b",", b"[", b"{")) > MOST_ELEMENTS:
        raise InputError(FIELD, path, f"has more than {MOST_ELEMENTS} values", "is it the right file?")
    try:
        tree = json.loads(
            raw.decode("utf-8-sig"), parse_float=_decimal_of_json, parse_constant=_no_number, object_pairs_hook=_once
        )
    except RecursionError:
        raise InputError(FIELD, path, "nests its lists too deep", "export it again") from None
    except UnicodeDecodeError:
        raise InputError(FIELD, path, "is no UTF-8 text", "save it as UTF-8") from None
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(FIELD, path, f"is no valid JSON ({str(error)[:200]})", "export it again") from None
    head = _object(tree.get("model", None), "model")
    components = [_json_component(item) for item in _listed(head.get("components", []), "components")]
    relations = []
    for item in _listed(head.get("relations", []), "relations"):
        entry = _object(item, "relation")
        refs = [_object(ref, "ref") for ref in _listed(entry.get("refs", []), "refs")]
        relations.append(_relation(entry, [(ref.get("role", ""), ref.get("id"), ref.get("hint", "")) for ref in refs]))
    given = head.get("load_spectrum") or []
    spectra = []
    for item in given if isinstance(given, list) else [given]:
        entry = _object(item, "load_spectrum")
        cases = [_object(case, "load_case") for case in _listed(entry.get("load_cases", []), "load_cases")]
        sums = _object(entry.get("accumulation") or {}, "accumulation")
        spectra.append(
            LoadSpectrum(
                _number(entry.get("id", 1), "load_spectrum id"),
                tuple(
                    _load_case(case.get("id"), map(_json_component, _listed(case.get("components", []), "components")))
                    for case in cases
                ),
                tuple(_json_component(part) for part in _listed(sums.get("components", []), "components")),
            )
        )
    return _model(head, components, relations, spectra, path)


def _decimal_of_json(text: str) -> Decimal:
    return _decimal(text, "number")


def _no_number(text: str) -> Any:
    raise InputError("number", text, "is no finite number", "correct it in the file")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    entries: dict[str, Any] = {}
    for key, value in pairs:
        if key in entries:
            raise InputError("key of JSON", key, "occurs twice in an object", "correct the file")
        entries[key] = value
    return entries


def _object(value: Any, name: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise InputError(name, value, "must be an object of JSON", "export the file again")
    return value


def _listed(value: Any, name: str) -> list[Any]:
    if not isinstance(value, list):
        raise InputError(name, value, "must be a list of JSON", "export the file again")
    return value


def _json_component(item: Any) -> Component:
    entry, values = _object(item, "component"), []
    for attribute in _listed(entry.get("attributes", []), "attributes"):
        given = dict(_object(attribute, "attribute"))
        name, unit = given.pop("id", ""), given.pop("unit", None)
        if len(given) > 1:
            problem = f"has several values ({', '.join(list(given)[:6])})"
            raise InputError(
                f"attribute {shown(name)} of component {shown(entry.get('id'))}", None, problem, "keep one"
            )
        kind, value = next(iter(given.items()), ("", None))
        if kind.endswith("_coded") and value is not None:
            coded = _object(value, kind)
            value = _decoded(str(coded.get("code")), str(coded.get("value", "")), "array")
        values.append((name, unit, value))
    return _component(entry, values)


# --- what both have -------------------------------------------------------------------------------------------------


def _model(
    head: Mapping[str, Any],
    components: list[Component],
    relations: list[Relation],
    spectra: list[LoadSpectrum],
    path: str,
) -> Model:
    version = str(head.get("version", ""))
    short = ".".join(version.split(".")[:2])
    if short not in VERSIONS:
        problem = f"must be {VERSIONS[0]} to {VERSIONS[-1]}"
        raise InputError("version of the REXS model", version, problem, f"export it as REXS {VERSIONS[-1]}")
    numbered: dict[int, Component] = {}
    for component in components:
        if component.number in numbered:
            problem = f"is that of {numbered[component.number].label} and of {component.label}"
            raise InputError("number of a component", component.number, problem, "export it again: numbers are unique")
        numbered[component.number] = component
    if not numbered:
        raise InputError(FIELD, path, "has no components", "export it again")
    program = f"{head.get('applicationId', '')} {head.get('applicationVersion', '')}".strip()
    return Model(short, program[:200], str(head.get("date", ""))[:60], numbered, tuple(relations), tuple(spectra))


def _number(value: Any, where: str) -> int:
    if isinstance(value, str) and re.fullmatch(r"[+-]?[0-9]{1,18}", value.strip()):
        return int(value)
    if value is None:
        raise InputError(where, None, "is missing", "export the file again")
    return whole(value, where)


def _relation(head: Mapping[str, Any], refs: list[tuple[str, Any, str]]) -> Relation:
    number = _number(head.get("id"), "id of a relation")
    where = f"relation {number}"
    roles: dict[str, int] = {}
    for given, target, _ in refs:
        role = str(given)
        if role in roles:
            raise InputError(where, role, "is a role of two components: must be one", "export the file again")
        roles[role] = _number(target, f"id of a ref of {where}")
    if not roles:
        raise InputError(where, None, "refers to no component", "export the file again")
    order, kind = head.get("order"), str(head.get("type", ""))
    if kind == OLD_SIDE:
        kind, roles = "side", {OLD_ROLES.get(role, role): target for role, target in roles.items()}
    return Relation(number, kind, roles, None if order is None else _number(order, f"{where} order"))


def _load_case(number: Any, components: Iterable[Component]) -> LoadCase:
    return LoadCase(_number(number, "id of a load case"), tuple(components))


def _component(head: Mapping[str, Any], values: list[tuple[Any, Any, Any]]) -> Component:
    number = _number(head.get("id"), "id of a component")
    name, kind = str(head.get("name") or "")[:LONGEST_NAME], str(head.get("type") or "")
    return Component(number, kind, name, {f"{i}": Attribute(str(a), v, u) for i, (a, u, v) in enumerate(values)})


def _checked(model: Model) -> Model:
    """Return the model with types from the schema, names of 2.0.0 and typed values, references checked."""
    components = {number: _typed(component) for number, component in model.components.items()}
    for relation in model.relations:
        for role, target in relation.roles.items():
            if target not in components:
                where = f"relation {relation.number} ({relation.kind}), role {role}"
                raise InputError(where, target, "refers to a component that does not exist", "export the file again")
    spectra = []
    for spectrum in model.spectra:
        seen: set[int] = set()
        for case in spectrum.cases:
            if case.number in seen:
                raise InputError("id of a load case", case.number, "occurs twice", "export the file again")
            seen.add(case.number)
        cases = [
            LoadCase(
                case.number, tuple(_of_case(item, components, f"load case {case.number}") for item in case.components)
            )
            for case in spectrum.cases
        ]
        sums = tuple(_of_case(item, components, "accumulation") for item in spectrum.accumulation)
        spectra.append(LoadSpectrum(spectrum.number, tuple(cases), sums))
    return Model(model.version, model.application, model.date, components, model.relations, tuple(spectra), model.notes)


def _of_case(part: Component, components: Mapping[int, Component], where: str) -> Component:
    """Component of a load case with the type and name that it has in the model."""
    if part.number not in components:
        raise InputError(f"component of {where}", part.number, "does not exist", "export the file again")
    whole_one = components[part.number]
    return _typed(Component(part.number, whole_one.kind, whole_one.name, part.attributes))


def _typed(component: Component) -> Component:
    kind = RENAMED_COMPONENTS.get(component.kind, component.kind)
    table, attributes = schema(), {}
    for raw in component.attributes.values():
        name = table.current(kind, raw.name)
        where = f"{name} of {component.label}"
        if name in attributes:
            raise InputError(where, None, "occurs twice", "keep one of them")
        known = table.attribute(kind, name)
        value = _value(known, raw.value, where)
        unit = (known.unit if known else "none") if raw.unit is None else str(raw.unit)
        if known is not None and value is not None:
            check_unit(unit, known.unit, where)
        assumed = raw.unit is None and unit != "none"
        attributes[name] = Attribute(name, value, unit, raw.name, known is not None or name.startswith(CUSTOM), assumed)
    return Component(component.number, kind, component.name, attributes)


def _value(known: AttributeType | None, raw: Any, where: str) -> Any:
    """Typed value; None for an empty one."""
    if raw is None or raw in ("", []):
        return None
    if known is None:
        return raw
    kind = known.kind
    if kind.endswith("_matrix") or kind == "array_of_integer_arrays":
        if not isinstance(raw, list):
            raise InputError(where, raw, "must be a matrix", "correct it in the file")
        one = "integer" if kind.startswith("array") else kind.removesuffix("_matrix")
        return [[_scalar(one, item, where) for item in (row if isinstance(row, list) else [row])] for row in raw]
    if kind.endswith("_array"):
        if not isinstance(raw, list):
            raise InputError(where, raw, "must be an array", "correct it in the file")
        return [_scalar(kind.removesuffix("_array"), item, where) for item in raw]
    return _scalar(kind, raw, where)


def _scalar(kind: str, raw: Any, where: str) -> Any:
    if isinstance(raw, (list, dict)):
        raise InputError(where, raw, f"must be one value ({kind})", "correct it in the file")
    if kind == "floating_point":
        if isinstance(raw, bool):
            raise InputError(where, raw, "must be a number", "correct it in the file")
        return _decimal(repr(raw) if isinstance(raw, float) else str(raw), where)
    if kind in ("integer", "reference_component"):
        return _number(str(raw) if not isinstance(raw, (bool, Decimal)) else raw, where)
    if kind == "boolean":
        text = str(raw).strip().lower()
        if text not in ("true", "false"):
            raise InputError(where, raw, "must be true or false", "correct it in the file")
        return text == "true"
    return str(raw)


def _decimal(text: str, where: str) -> Decimal:
    """Finite number of a text in ASCII digits, of a size that a float can have."""
    text = text.strip()
    cure = "correct it in the file"
    if "_" in text or not text.isascii():  # Decimal takes 5_0, and digits of all scripts
        raise InputError(where, text, "must be a number", cure)
    try:
        number = Decimal(text)
    except InvalidOperation:
        raise InputError(where, text, "must be a number", cure) from None
    if not number.is_finite() or (number and not -LARGEST_POWER < number.adjusted() < LARGEST_POWER):
        raise InputError(where, text, "must be a finite number", cure)
    if len(number.as_tuple().digits) > MOST_DIGITS:
        number = +number
    assert math.isfinite(float(number))
    return number
