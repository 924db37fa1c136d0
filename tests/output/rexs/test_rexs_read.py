"""REXS files as strangers send them: three forms of one model, and every fault refused with field, value and cure."""

from __future__ import annotations

import base64
import re
import struct
import zipfile
from decimal import Decimal
from random import Random

import pytest

from gearfe.base.errors import InputError
from gearfe.output.exchange.rexs import read as reading
from gearfe.output.exchange.rexs import read_rexs, rexs_job
from gearfe.output.exchange.rexs.frames import frames_of
from tests.makers.rexs_models import json_of, pose, saved, spur_pair, with_attributes, xml_of, zip_of

PARTS, JOINTS = spur_pair()
XML = xml_of(PARTS, JOINTS)


def test_xml_json_and_zip_hold_the_same_model(tmp_path):
    one = read_rexs(saved(tmp_path, XML))
    two = read_rexs(saved(tmp_path, json_of(PARTS, JOINTS), "model.rexsj"))
    three = read_rexs(saved(tmp_path, zip_of({"model.rexs": XML, "cad/housing.step": "x"}), "model.rexsz"))
    for other in (two, three):
        assert other.components == one.components
        assert other.relations == one.relations
    assert three.notes == ("file cad/housing.step of the archive: not read",)
    assert one.components[5].attributes["normal_module"].number("mm") == 2.0


def test_byte_order_mark_namespace_and_comments_do_not_matter(tmp_path):
    text = XML.replace("<model ", '<r:model xmlns:r="http://www.rexs.info" ').replace("</model>", "</r:model>")
    text = text.replace("<components>", "<components><!-- gears -->")
    assert (
        read_rexs(saved(tmp_path, b"\xef\xbb\xbf" + text.encode())).components
        == read_rexs(saved(tmp_path, XML)).components
    )


@pytest.mark.parametrize("version", ["1.0", "1.1", "1.2", "1.3", "1.4", "1.5", "1.6", "1.7", "2.0", "2.0.0"])
def test_all_versions_are_read(tmp_path, version):
    assert read_rexs(saved(tmp_path, xml_of(PARTS, JOINTS, version))).version == version[:3]


def test_names_of_older_versions_become_those_of_2_0(tmp_path):
    bearing = {"static_capacity": (11.4, "kN"), "radial_backlash": (5.0, "mum"), "name": ("6305", "none")}
    parts = [(1, "rolling_bearing_with_catalog_geometry", "A", bearing), (2, "lubricant", "oil", {"name": "VG 100"})]
    model = read_rexs(saved(tmp_path, xml_of(parts, version="1.0")))
    assert set(model.components[1].attributes) == {
        "radial_static_load_rating", "operating_radial_bearing_clearance", "catalogue_designation",
    }  # fmt: skip
    assert set(model.components[2].attributes) == {"name"}  # a lubricant keeps its name


def test_binary_arrays_are_little_endian(tmp_path):
    code = base64.b64encode(struct.pack("<3d", 1.0, -2.5, 1e3)).decode()
    text = xml_of([(1, "shaft", "a", {})]).replace(
        'name="a">',
        f'name="a"><attribute id="support_vector" unit="mm"><array code="float64">{code}</array></attribute>',
    )
    found = read_rexs(saved(tmp_path, text)).components[1].attributes["support_vector"]
    assert found.numbers("mm") == (1.0, -2.5, 1000.0)


# --- attacks ----------------------------------------------------------------------------------------------------------


def refused(path, *words: str) -> str:
    with pytest.raises(InputError) as caught:
        read_rexs(path)
    for word in words:
        assert word in str(caught.value), str(caught.value)
    assert caught.value.cure
    return str(caught.value)


def test_entities_are_refused_before_they_grow(tmp_path):
    bomb = '<?xml version="1.0"?><!DOCTYPE model [<!ENTITY a "aaaaaaaaaa">' + "".join(
        f'<!ENTITY {b} "{10 * f"&{a};"}">' for a, b in zip("abcdefgh", "bcdefghi", strict=True)
    )
    refused(saved(tmp_path, bomb + f"]>{XML[XML.index('<model') :].replace('pinion', '&i;')}"), "document type")
    outside = '<?xml version="1.0"?><!DOCTYPE model [<!ENTITY a SYSTEM "file:///etc/passwd">]><model>&a;</model>'
    refused(saved(tmp_path, outside), "document type")
    refused(saved(tmp_path, '<?xml version="1.0"?><!DOCTYPE model SYSTEM "http://x/y.dtd"><model/>'), "document type")


def test_sizes_are_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr(reading, "LARGEST", 10_000)
    refused(saved(tmp_path, XML + " " * 10_000), "larger than")
    archive = zip_of({"model.rexs": XML + " " * 1_000_000})
    assert len(archive) < 10_000
    refused(saved(tmp_path, archive, "a.rexsz"), "unpacks to more than")
    monkeypatch.setattr(reading, "MOST_ENTRIES", 3)
    refused(saved(tmp_path, zip_of({f"{i}.txt": "" for i in range(4)}), "a.rexsz"), "has 4 files")
    monkeypatch.setattr(reading, "LARGEST", 2**26)
    refused(saved(tmp_path, f"<model>{'<a>' * 50}{'</a>' * 50}</model>"), "nests its elements too deep")
    monkeypatch.setattr(reading, "MOST_ELEMENTS", 20)
    refused(saved(tmp_path, XML), "more than 20 elements")


def test_sizes_are_bounded_before_anything_is_built(tmp_path, monkeypatch):
    """Entries of an archive before its directory is read, whatever its end record says; values of JSON before them."""
    archive, text = zip_of({f"{i}.txt": "" for i in range(4)}), json_of(PARTS, JOINTS)
    end = archive.rindex(b"PK\x05\x06")
    monkeypatch.setattr(reading, "MOST_ENTRIES", 3)
    monkeypatch.setattr(reading.zipfile, "ZipFile", lambda *_: pytest.fail("the directory was read"))
    monkeypatch.setattr(reading.json, "loads", lambda *_, **__: pytest.fail("values were built"))
    refused(saved(tmp_path, archive, "a.rexsz"), "has 4 files")
    lies = archive[: end + 8] + bytes([1, 0, 1, 0]) + archive[end + 12 :]
    refused(saved(tmp_path, lies, "a.rexsz"), "has 4 files")
    monkeypatch.setattr(reading, "MOST_ELEMENTS", 100)
    refused(saved(tmp_path, text), "more than 100 values")


def test_each_key_of_an_object_is_looked_up_once():
    """A hash table, not a list that each key is counted in: the number of comparisons does not grow with the square."""

    class Key(str):
        compared = 0

        def __eq__(self, other: object) -> bool:
            Key.compared += 1
            return str.__eq__(self, other)

        __hash__ = str.__hash__

    pairs = [(Key(i), i) for i in range(1000)]
    assert len(reading._once(pairs)) == 1000
    with pytest.raises(InputError, match="occurs twice"):
        reading._once([*pairs, (Key(999), 0)])
    assert Key.compared < 10_000


@pytest.mark.parametrize("name", ["../evil.rexs", "/etc/model.rexs", "a/../../b.txt", "C:\\model.rexs", "..\\up.txt"])
def test_paths_outside_of_an_archive_are_refused(tmp_path, name):
    refused(saved(tmp_path, zip_of({"model.rexs": XML, name: "x"}), "a.rexsz"), "outside of the archive", "relative")
    assert [path.name for path in tmp_path.iterdir()] == ["a.rexsz"]  # nothing was unpacked


def test_archives_with_no_or_two_models_or_damage_are_refused(tmp_path):
    refused(saved(tmp_path, zip_of({"readme.txt": "x"}), "a.rexsz"), "must hold one model", "it has 0")
    refused(saved(tmp_path, zip_of({"a.rexs": XML, "b.rexsj": "{}"}), "a.rexsz"), "it has 2")
    whole = zip_of({"model.rexs": XML})
    refused(saved(tmp_path, whole[: len(whole) // 2], "a.rexsz"), "no sound ZIP archive")
    refused(saved(tmp_path, whole.replace(whole[60:90], bytes(30), 1), "a.rexsz"))
    path = tmp_path / "b.rexsz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_BZIP2) as archive:
        archive.writestr("model.rexs", XML)
    refused(path, "method that REXS does not have")


def test_what_is_no_rexs_is_refused(tmp_path):
    refused(saved(tmp_path, "module_mm = 2"), "no REXS file")
    refused(saved(tmp_path, "<html></html>"), "<html>")
    refused(saved(tmp_path, "<model version='2.0'><component></model>"), "no valid XML", "line 1")
    refused(saved(tmp_path, '{"model": {"version": "2.0", "components": [}'), "no valid JSON")
    refused(saved(tmp_path, "{}"), "must be an object")
    refused(saved(tmp_path, '{"model": ' + "[" * 100_000 + "}"), "too deep")
    refused(saved(tmp_path, '{"model": {"version": "2.0", "version": "1.0"}}'), "occurs twice")
    refused(saved(tmp_path, '{"model": {"version": "2.0", "components": [{"id": NaN}]}}'), "no finite number")
    refused(saved(tmp_path, XML.replace('version="2.0" app', 'version="3.1" app')), "1.0 to 2.0", "'3.1'")
    refused(saved(tmp_path, "<model version='2.0'/>"), "no components")
    refused(tmp_path / "lost.rexs", "no such file")
    text = json_of(PARTS, JOINTS).replace('"role": "part"', '"role": [1]', 1)
    assert "[1]" in read_rexs(saved(tmp_path, text)).relations[0].roles


# --- faults of the model ----------------------------------------------------------------------------------------------


def test_numbers_of_components_are_unique_and_exist(tmp_path):
    refused(saved(tmp_path, xml_of([*PARTS, (5, "shaft", "twin", {})])), "5", "cylindrical_gear 5 (pinion)", "shaft 5")
    refused(saved(tmp_path, xml_of(PARTS, [("assembly", {"assembly": 3, "part": 99})])), "99", "does not exist")
    refused(saved(tmp_path, XML.replace('component id="5"', 'component id="five"')), "whole number")
    refused(saved(tmp_path, XML.replace('component id="5" ', "component ")), "id of a component", "missing")
    spectrum = '<load_spectrum id="1"><load_case id="1"><component id="98" type="shaft"/></load_case></load_spectrum>'
    refused(saved(tmp_path, xml_of(PARTS, JOINTS, more=spectrum)), "98", "load case 1")
    twice = '<load_spectrum id="1"><load_case id="1"/><load_case id="1"/></load_spectrum>'
    refused(saved(tmp_path, xml_of(PARTS, JOINTS, more=twice)), "load case", "twice")


@pytest.mark.parametrize(
    ("attribute", "value", "words"),
    [
        ("number_of_teeth", "twenty", ("must be a whole number", "cylindrical_gear 5 (pinion)")),
        ("number_of_teeth", "20.5", ("must be a whole number",)),
        ("normal_module", "two", ("must be a number",)),
        ("normal_module", "nan", ("must be a finite number",)),
        ("normal_module", "5_0", ("must be a number",)),
        ("normal_module", "\u0665", ("must be a number",)),
        ("number_of_teeth", "\u0662\u0660", ("must be a whole number",)),
        ("normal_module", "1e999999", ("must be a finite number",)),
        ("normal_module", "9" * 10_000, ("must be a finite number",)),
        ("normal_module", [1.0, 2.0], ("must be one value",)),
        ("support_vector", 1.0, ("must be an array",)),
        ("normal_module", (2.0, "furlong"), ("furlong", "no unit of REXS", "write it in mm")),
        ("normal_module", (2.0, "kN"), ("unit of force", "length in mm")),
        ("number_of_teeth", (20, "mm"), ("unit of length", 'write unit="none"')),
        ("face_width", (20.0, ""), ("no unit of REXS",)),
    ],
)
def test_wrong_values_and_units_name_component_and_attribute(tmp_path, attribute, value, words):
    message = refused(saved(tmp_path, xml_of(with_attributes(PARTS, 5, **{attribute: value}), JOINTS)), *words)
    assert f"{attribute} of cylindrical_gear 5 (pinion)" in message
    assert len(message) < 600


def test_truth_values_are_true_or_false(tmp_path):
    refused(saved(tmp_path, xml_of(with_attributes(PARTS, 3, defines_speed="yes"))), "must be true or false", "'yes'")


def test_an_attribute_stands_once(tmp_path):
    text = XML.replace('<attribute id="number_of_teeth"', '<attribute id="number_of_teeth" unit="none">7</attribute>'
                       + '<attribute id="number_of_teeth"', 1)  # fmt: skip
    refused(saved(tmp_path, text), "number_of_teeth of cylindrical_gear 5", "occurs twice")


def test_circles_of_references_are_refused(tmp_path):
    parts = [
        (1, "gear_unit", "unit", pose(0.0, 0.0, 0.0)),
        (2, "shaft", "a", {**pose(0.0, 0.0, 0.0), "reference_component_for_position": 3}),
        (3, "shaft", "b", {**pose(0.0, 0.0, 0.0), "reference_component_for_position": 2}),
    ]
    with pytest.raises(InputError, match="goes in a circle: 2 -> 3 -> 2"):
        frames_of(read_rexs(saved(tmp_path, xml_of(parts))))
    chain = [
        (i, "shaft", "", {**pose(0.0, 0.0, 0.0), "reference_component_for_position": i + 1}) for i in range(1, 5000)
    ]
    chain.append((5000, "gear_unit", "", {**pose(0.0, 0.0, 0.0), "reference_component_for_position": 5000}))
    with pytest.raises(InputError, match="more than 200 components"):
        frames_of(read_rexs(saved(tmp_path, xml_of(chain))))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"support_vector": [1.0, 2.0]}, "three numbers"),
        ({"u_axis_vector": [2.0, 0.0, 0.0]}, "length 1"),
        ({"w_axis_vector": [1.0, 0.0, 0.0]}, "right angle"),
        ({"reference_component_for_position": 77}, "does not exist"),
        ({"reference_component_for_position": 2}, "no support_vector"),
    ],
)
def test_places_that_are_none_are_refused(tmp_path, change, words):
    with pytest.raises(InputError, match=words):
        frames_of(read_rexs(saved(tmp_path, xml_of(with_attributes(PARTS, 5, **change)))))


def test_numbers_keep_their_digits(tmp_path):
    text = "0.1234567890123456789012345"
    model = read_rexs(saved(tmp_path, xml_of(with_attributes(PARTS, 5, normal_module=text))))
    assert model.components[5].attributes["normal_module"].value == Decimal(text)


def test_damaged_models_are_read_or_refused_in_words():
    """Lines lost, doubled and with other values, units and numbers: a job, or an error that names the place."""
    random = Random(47)
    lines = XML.replace("><", ">\n<").split("\n")
    refused_files = 0
    for _ in range(60):
        damaged = list(lines)
        for _ in range(random.choice((1, 2, 4))):
            i = random.randrange(len(damaged))
            value = random.choice(("0", "-1", "1e308", "nan", "", "abc", "99999999999", "furlong", "mm", "none"))
            change = random.randrange(4)
            if change == 0:
                del damaged[i]
            elif change == 1:
                damaged.insert(i, random.choice(lines))
            elif change == 2:
                damaged[i] = re.sub(r">[^<]*<", f">{value}<", damaged[i], count=1)
            else:
                damaged[i] = re.sub(r'="[^"]*"', f'="{value}"', damaged[i], count=1)
        try:
            rexs_job(reading.read_model("\n".join(damaged).encode(), "damaged.rexs"))
        except InputError:
            refused_files += 1
    assert 10 < refused_files < 60
