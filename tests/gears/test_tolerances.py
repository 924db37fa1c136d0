"""ISO 1328-1: tolerances of both editions, and the sizes and backlash of the tooth thickness, as reports print them."""

from __future__ import annotations

import math

import pytest

from gearfe import Gear, GearPair, InputError
from gearfe.gears.geometry.balls import over_balls, touching_ball
from gearfe.gears.geometry.measures import backlash_limits, span_of
from gearfe.gears.geometry.tolerances import helix_tolerances, tolerances, tolerances_um
from tests.makers.rated import helical_stage, spur_stage

#: Gear -> grade 6 of ISO 1328-1:1995 as the report prints it (um).
PRINTED = {
    "helical pinion": (14, 50, 15, 18, 23, 40, 18, 18, 25),
    "helical wheel": (17, 78, 18, 22, 28, 63, 19, 19, 27),
    "spur pinion": (18, 54, 17, 21, 27, 43, 21, 21, 29),
    "spur wheel": (19, 67, 19, 23, 30, 53, 21, 21, 30),
}
NAMES = ("f_pT", "F_pT", "f_HalphaT", "f_falphaT", "F_alphaT", "F_rT", "f_HbetaT", "f_fbetaT", "F_betaT")


def report_gear(name: str) -> Gear:
    stage = helical_stage() if name.startswith("helical") else spur_stage()
    return stage.pinion if name.endswith("pinion") else stage.wheel


@pytest.mark.parametrize("name", PRINTED)
def test_grades_of_1995_as_a_report_prints_them(name: str) -> None:
    found = tolerances_um(report_gear(name), 6, 1995)
    assert tuple(found[symbol] for symbol in NAMES) == PRINTED[name]


def test_classes_of_2013_by_hand() -> None:
    """d = 120 mm, m = 3 mm, b = 25 mm in class 7: twice class 5."""
    gear = Gear(40, 3e-3, math.radians(20), 25e-3, 20e-3)
    pitch, helix = tolerances(gear, 7), helix_tolerances(gear, 7)
    assert 1e6 * pitch.run_out == pytest.approx(0.9 * 2 * (0.24 + 0.55 * math.sqrt(120) + 2.1 + 12))
    assert 1e6 * helix.helix_slope == pytest.approx(2 * (0.05 * math.sqrt(120) + 0.35 * 5 + 4))
    assert 1e6 * helix.helix_form == pytest.approx(2 * (0.07 * math.sqrt(120) + 0.45 * 5 + 4))
    assert helix.helix_total == pytest.approx(math.hypot(helix.helix_slope, helix.helix_form))
    assert set(tolerances_um(gear, 7)) == set(NAMES)


def test_widths_beyond_the_standard_leave_the_helix_out() -> None:
    narrow = Gear(40, 3e-3, math.radians(20), 3e-3, 20e-3)
    assert set(tolerances_um(narrow, 7)) == set(NAMES[:6])
    with pytest.raises(InputError, match=r"face_width_mm = 3.*4 to 1200"):
        helix_tolerances(narrow, 7)


@pytest.mark.parametrize(
    ("edition", "class_", "message"), [(2013, 12, "1 to 11"), (1995, 13, "0 to 12"), (2000, 6, "1995")]
)
def test_classes_that_there_are_not(edition: int, class_: int, message: str) -> None:
    with pytest.raises(InputError, match=message):
        tolerances(report_gear("spur pinion"), class_, edition)


#: Ball (mm), nominal size over balls, sizes at both allowances (um); teeth spanned, nominal span, spans: as printed.
SIZES = {
    "helical pinion": (28, 397.284, (397.035, 396.921), (130, 190), 4, 154.167, (154.045, 153.989)),
    "helical wheel": (25, 1404.574, (1403.997, 1403.756), (240, 340), 13, 542.490, (542.264, 542.171)),
    "spur pinion": (45, 466.306, (466.079, 465.974), (130, 190), 3, 165.869, (165.747, 165.690)),
    "spur wheel": (40, 836.492, (836.128, 835.961), (175, 255), 5, 296.803, (296.638, 296.563)),
}


@pytest.mark.parametrize("name", SIZES)
def test_sizes_over_balls_and_spans_as_printed(name: str) -> None:
    gear, (ball, nominal, limits, thinning, teeth, span, spans) = report_gear(name), SIZES[name]
    assert 1e3 * over_balls(gear, 1e-3 * ball) == pytest.approx(nominal, abs=6e-4)
    assert [1e3 * over_balls(gear, 1e-3 * ball, 1e-6 * t) for t in thinning] == pytest.approx(limits, abs=6e-4)
    assert gear.span_teeth == teeth
    assert 1e3 * gear.span_size(teeth) == pytest.approx(span, abs=6e-4)
    assert [1e3 * span_of(gear, teeth, 1e-6 * t) for t in thinning] == pytest.approx(spans, abs=6e-4)


@pytest.mark.parametrize(("name", "printed"), [("spur pinion", 41.072), ("spur wheel", 38.726)])
def test_theoretical_balls_as_printed(name: str, printed: float) -> None:
    assert 1e3 * touching_ball(report_gear(name)) == pytest.approx(printed, abs=5e-4)


def test_the_theoretical_ball_touches_where_it_should() -> None:
    """Of a helical gear, too: roll length of the contact from the ball's centre, less its radius along the normal."""
    gear = report_gear("helical pinion")
    ball = touching_ball(gear)
    centre = 0.5 * (over_balls(gear, ball) - ball)  # an even number of teeth
    roll = math.sqrt(centre**2 - gear.base_radius**2) - 0.5 * ball * math.cos(gear.base_helix_angle)
    touch = math.hypot(gear.base_radius, roll)
    assert touch == pytest.approx(gear.reference_radius + gear.profile_shift * gear.module, rel=1e-9)


def test_balls_that_fall_to_the_root() -> None:
    assert math.isnan(over_balls(report_gear("spur pinion"), 20e-3))


def test_backlash_of_allowances_as_printed() -> None:
    """j_wt of both stages; normal to the flanks it is j_wt cos(alpha_wt) cos(beta_b), where the report takes the
    angles of the reference circle, 0.529 and 0.332, 0.460 and 0.266 mm.
    """
    helical = backlash_limits(helical_stage(), ((-130e-6, -190e-6), (-240e-6, -340e-6)), (28e-6, -28e-6))
    spur = backlash_limits(spur_stage(), ((-130e-6, -190e-6), (-175e-6, -255e-6)), (35e-6, -35e-6))
    assert [1e3 * j for j in helical.circumferential] == pytest.approx((0.571, 0.359), abs=6e-4)
    assert [1e3 * j for j in spur.circumferential] == pytest.approx((0.490, 0.283), abs=6e-4)
    angles = math.cos(math.radians(20)) * math.cos(math.radians(10))
    assert [1e3 * j * angles for j in helical.circumferential] == pytest.approx((0.529, 0.332), abs=6e-4)
    normal = math.cos(helical_stage().working_pressure_angle) * math.cos(helical_stage().pinion.base_helix_angle)
    for along, across in zip(helical.normal, helical.circumferential, strict=True):
        assert along / across == pytest.approx(normal, rel=2e-3)  # the angle varies with the centre distance


def test_nominal_teeth_at_their_own_distance_have_no_backlash() -> None:
    found = backlash_limits(helical_stage(), ((0.0, 0.0), (0.0, 0.0)))
    assert found.circumferential == pytest.approx((0.0, 0.0), abs=1e-12)


def test_allowances_the_wrong_way_round() -> None:
    with pytest.raises(InputError, match="upper allowance"):
        backlash_limits(spur_stage(), ((-190e-6, -130e-6), (0.0, 0.0)))


def test_backlash_of_internal_pairs() -> None:
    """That of the pair itself between the allowances; a wider centre distance leaves less."""
    form = {"module": 3e-3, "pressure_angle": math.radians(20), "face_width": 20e-3}
    ring = Gear(-60, **form, addendum=0.8, tooth_thinning=50e-6, rim_diameter=0.21)
    pair = GearPair(Gear(20, **form, bore_diameter=20e-3, addendum=0.8, tooth_thinning=80e-6), ring)
    exact = backlash_limits(pair, ((-80e-6, -80e-6), (-50e-6, -50e-6)))
    assert exact.normal == pytest.approx((pair.normal_backlash,) * 2, rel=1e-9)
    both = backlash_limits(pair, ((-80e-6, -80e-6), (-50e-6, -50e-6)), (20e-6, -20e-6))
    moved = 2 * 20e-6 * math.tan(pair.working_pressure_angle)
    assert both.circumferential == pytest.approx(
        (exact.circumferential[0] + moved, exact.circumferential[1] - moved), rel=2e-3
    )
