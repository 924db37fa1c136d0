"""The curve as a table: round trips to 15 digits, foreign files, mistakes."""

import csv
import math

import numpy as np
import pytest

from gearfe import StiffnessCurve
from gearfe.base.errors import InputError
from gearfe.gears.gearmesh.curve import NO_CYCLE, as_text, numbers

#: The first columns of the file, in the order that is promised to readers.
PROMISED = (
    "pinion_angle_deg,wheel_angle_deg,twist_deg,torque_wheel_Nm,torque_pinion_Nm,k_torsional_Nm_per_rad,k_mesh_N_per_m,"
    "transmission_error_um,teeth_in_contact,peak_pressure_MPa,iterations,status"
)


def invented(n=20, failed=()):
    """A curve of random numbers with all 53 bits in use."""
    rng = np.random.default_rng(7)
    status = np.array(["converged"] * n, dtype="<U20")
    status[list(failed)] = "not_converged"
    bad = status != "converged"

    def numbers(scale):
        return np.where(bad, np.nan, scale * rng.uniform(0.1, 1.0, n))

    share, stiffness, radius = rng.uniform(0, 1, n), numbers(1e8), 33.98654e-3
    twist = numbers(1e-3)
    return StiffnessCurve(
        pinion_angle=np.arange(n) * math.radians(18) / n,
        wheel_angle=-rng.uniform(0, 1, n),
        twist=twist,
        torque_wheel=numbers(100),
        torque_pinion=numbers(70),
        torque_wheel_reaction=numbers(100),
        k_torsional=stiffness * radius**2,
        k_mesh=stiffness,
        k_tangent=numbers(1e8),
        transmission_error=twist * radius,
        transmission_error_unloaded=rng.uniform(0, 1e-6, n),
        leading_pair=np.where(bad, np.nan, np.arange(n) % 3 - 1.0),
        load_share=np.where(bad[:, None], np.nan, np.stack([share, 1 - share], axis=1)),
        teeth_in_contact=np.where(bad, -1, 2),
        peak_pressure=numbers(1e9),
        iterations=rng.integers(1, 9, n),
        status=status,
        mesh_cycle=math.radians(18),
        base_radius=radius,
        lost_motion=1.234e-4,
    )


#: What a rounding to 15 digits changes at most, and two roundings of doubles with it.
DIGITS = 5e-15 * 1.1


def same(one, two):
    for name in StiffnessCurve.__dataclass_fields__:
        if name in ("timings", "error"):
            continue
        a, b = getattr(one, name), getattr(two, name)
        if np.asarray(a).dtype.kind == "f":
            np.testing.assert_allclose(b, a, rtol=DIGITS, err_msg=name)
        else:
            np.testing.assert_array_equal(a, b, err_msg=name, strict=name in ("teeth_in_contact", "iterations"))


@pytest.mark.parametrize("failed", [(), (3, 11)])
def test_a_table_read_and_written_is_the_same_text(tmp_path, failed):
    curve = invented(failed=failed)
    curve.to_csv(tmp_path / "curve.csv")
    back = StiffnessCurve.from_csv(tmp_path / "curve.csv")
    same(curve, back)
    back.to_csv(tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "curve.csv").read_bytes()


def test_promised_columns_come_first(tmp_path):
    invented(failed=(2,)).to_csv(tmp_path / "curve.csv")
    header, *rows = (tmp_path / "curve.csv").read_text().splitlines()
    assert header.startswith(PROMISED + ",")
    with open(tmp_path / "curve.csv", newline="") as stream:
        table = list(csv.DictReader(stream))
    assert len(rows) == len(table) == 20
    assert table[2]["status"] == "not_converged"
    assert math.isnan(float(table[2]["k_mesh_N_per_m"]))
    assert math.isnan(float(table[2]["teeth_in_contact"]))
    assert table[3]["teeth_in_contact"] == "2"


@pytest.mark.parametrize("column", ["angle_deg", "error_um", "radius_mm", "pressure_MPa", "torque_Nm"])
def test_any_double_keeps_15_digits_and_its_text(column):
    rng = np.random.default_rng(3)
    values = rng.uniform(-1, 1, 5000) * 10.0 ** rng.integers(-12, 12, 5000)
    values = np.concatenate([values, [0.0, math.radians(0.5), math.nan]])
    text = as_text(values, column)
    again = numbers({column: text}, column, "a file")
    np.testing.assert_allclose(again, values, rtol=DIGITS)
    assert as_text(again, column) == text
    assert max(len(cell.strip("-0.").split("e")[0].replace(".", "")) for cell in text) == 15


def test_everyday_numbers_read_as_such():
    assert as_text([math.radians(0.5)], "twist_deg") == ["0.5"]
    for whole in range(360):
        assert as_text([math.radians(whole)], "pinion_angle_deg") == [str(whole)]
    assert as_text([25e-6, math.inf], "error_um") == ["25", "nan"]


def test_a_foreign_table(tmp_path):
    path = tmp_path / "measured.csv"
    path.write_text("k_mesh_N_per_m,pinion_angle_deg\n1e8,0\n1.2e8,4.5\n,9\n1.1e8,13.5\n")
    with pytest.raises(InputError, match="mesh cycle"):
        StiffnessCurve.from_csv(path)
    curve = StiffnessCurve.from_csv(path, mesh_cycle=math.radians(18))
    assert list(curve.failed) == [False, False, True, False]
    with pytest.raises(InputError, match="does not cover"):
        curve.interpolate(0.0)
    path.write_text(path.read_text().replace("1.1e8,13.5", "1.3e8,9.0\n1.1e8,13.5"))
    curve = StiffnessCurve.from_csv(path, mesh_cycle=math.radians(18))
    value = curve.interpolate(np.radians([4.5, 22.5, 9.0])).value
    np.testing.assert_allclose(value, [1.2e8, 1.2e8, 1.3e8], rtol=1e-12)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "there is no such file"),
        ("pinion_angle_deg,k_mesh_N_per_m\n", "has no rows"),
        ("pinion_angle_deg,k\n1,2\n", "has no column k_mesh_N_per_m"),
        ("pinion_angle_deg,k_mesh_N_per_m\n1,2,3\n", "line 2 has 3 cells"),
        ("pinion_angle_deg,k_mesh_N_per_m\n1,stiff\n", "'stiff', which is no finite number"),
        ("pinion_angle_deg,k_mesh_N_per_m\none,1\n", "'one', which is no finite number"),
    ],
)
def test_mistakes_in_a_table(tmp_path, content, message):
    path = tmp_path / "curve.csv"
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError, match=message):
        StiffnessCurve.from_csv(path, mesh_cycle=0.3)


def test_interpolation_leaves_failed_positions_out():
    curve = invented(failed=(5,))
    interpolant = curve.interpolant()
    assert np.abs(interpolant.nodes - curve.pinion_angle[5]).min() > 1e-3
    assert np.isfinite(interpolant(np.linspace(0, 1, 100)).value).all()
    value, slope = curve.interpolate(curve.pinion_angle[8] + 4 * curve.mesh_cycle, "torque_wheel")
    assert float(value) == pytest.approx(curve.torque_wheel[8])
    assert np.shape(slope) == ()


def test_an_array_of_another_length_is_no_unknown_one():
    angles = np.linspace(0.0, 0.3, 5)
    known = StiffnessCurve(pinion_angle=angles, k_mesh=np.ones(5), mesh_cycle=0.3)
    assert np.isnan(known.torque_wheel).all()
    with pytest.raises(InputError, match=r"k_mesh.*has 4 entries, the curve 5 positions"):
        StiffnessCurve(pinion_angle=angles, k_mesh=np.ones(4), mesh_cycle=0.3)
    with pytest.raises(InputError, match=r"load_share.*has 4 entries, the curve 5 positions"):
        StiffnessCurve(pinion_angle=angles, load_share=np.ones((4, 2)), mesh_cycle=0.3)


def test_unknown_quantity():
    with pytest.raises(InputError, match="did you mean 'k_mesh'"):
        invented().interpolate(0.0, "k_mehs")


def test_a_file_that_contradicts_itself_one_mesh_cycle_on(tmp_path) -> None:
    """Rows 18 and 20 deg, of a pinion with 20 teeth, are those of 0 and 2 deg."""
    rows = dict.fromkeys(range(0, 18, 2), 100000000.0) | {18: 5e8, 20: 1e7}
    path = tmp_path / "curve.csv"
    text = "pinion_angle_deg,k_mesh_N_per_m\n" + "".join(f"{a},{k:g}\n" for a, k in rows.items())
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"row 1 \(0 deg: 1e\+08\) against row 10 \(18 deg: 5e\+08\)"):
        StiffnessCurve.from_csv(path, mesh_cycle=math.radians(18.0))
    path.write_text(text.replace("18,5e+08\n20,1e+07", "18,1.001e+08\n20,1e+08"), encoding="utf-8")
    assert StiffnessCurve.from_csv(path, mesh_cycle=math.radians(18.0)).interpolant().mean == pytest.approx(1e8)


@pytest.mark.parametrize(
    ("column", "cells", "message"),
    [
        ("mesh_cycle_deg", ("18", "18", "20"), r"mesh_cycle_deg holds 18 and 20, but the whole curve has one value"),
        ("wheel_base_radius_mm", ("30", "", "31"), r"wheel_base_radius_mm holds 30 and 31"),
        ("contact_law", ("half_plane", "half_plane", "penalty"), r"contact_law holds half_plane and penalty"),
        # 1e8 N/m at a base radius of 30 mm are 9e4 N m/rad
        ("k_torsional_Nm_per_rad", ("9e4", "9e4", "1.8e5"), r"row 3 has k_torsional 180000 N m/rad and k_mesh 1e\+08"),
        # 1 mrad at a base radius of 30 mm is 30 um
        ("transmission_error_um", ("30", "30", "33"), r"row 3 has transmission_error 33 um, but .* is 30 um"),
        ("load_share_1", ("1", "", "0.7"), r"row 3 has load shares that add up to 0.7, not to 1"),
        ("status", ("converged", "", "not_converged"), r"row 3 has a stiffness and the status 'not_converged'"),
        ("mesh_cycle_deg", ("18", "", "-18"), r"mesh_cycle_deg holds 18 and -18"),
        ("teeth_in_contact", ("2", "", "1.5"), r"teeth_in_contact holds 1.5, which is no whole number"),
    ],
)
def test_columns_that_contradict_each_other(column, cells, message, tmp_path) -> None:
    path = tmp_path / "curve.csv"
    table = {"pinion_angle_deg": ("0", "6", "12"), "k_mesh_N_per_m": ("1e8",) * 3, "mesh_cycle_deg": ("18",) * 3}
    table |= {"wheel_base_radius_mm": ("30",) * 3, "twist_deg": (f"{math.degrees(1e-3):.15g}",) * 3, column: cells}
    lines = [",".join(row) for row in (table, *zip(*table.values(), strict=True))]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    with pytest.raises(InputError, match=message):
        StiffnessCurve.from_csv(path)
    table[column] = cells[:1] * 3
    lines = [",".join(row) for row in (table, *zip(*table.values(), strict=True))]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert StiffnessCurve.from_csv(path).mesh_cycle == pytest.approx(math.radians(18.0))


@pytest.mark.parametrize("cycle", ["-18", "0"])
def test_a_mesh_cycle_of_the_file_is_not_replaced_where_it_is_impossible(cycle, tmp_path):
    """A train fills in the cycle of its driver only where a file has none."""
    path = tmp_path / "curve.csv"
    path.write_text(f"pinion_angle_deg,k_mesh_N_per_m,mesh_cycle_deg\n0,1e8,{cycle}\n5,1e8,\n10,1e8,\n")
    with pytest.raises(InputError, match=f"mesh cycle of {cycle} deg, which must be finite and > 0") as failure:
        StiffnessCurve.from_csv(path)
    assert failure.value.problem != NO_CYCLE
