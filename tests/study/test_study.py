"""Studies: parameters, designs, expressions, statistics against theory."""

from __future__ import annotations

import itertools
import math
import tomllib

import numpy as np
import pytest
from scipy.stats import norm, qmc, sobol_indices, truncnorm

from gearfe.base.config import build, read_toml, set_key
from gearfe.base.errors import InputError
from gearfe.base.tables.study import StudyTable
from gearfe.base.tables.text import toml_document
from gearfe.study.design import saltelli, study_cases
from gearfe.study.expressions import Answer, read_output, value_of
from gearfe.study.job import read_study, run_study
from gearfe.study.parameters import read_parameters
from gearfe.study.statistics import pareto_set, proportion, spread
from tests.makers.studies import written
from tests.places import GEOMETRY

PAIR = {"pair": {"pinion": {"teeth": 20}, "wheel": {"teeth": 40}}}  # tables that the base job of a study has

# ------------------------------------------------------------------------------------------ parameters and designs


def test_distributions_have_their_quantiles():
    given = {
        "pair.addendum": {"low": 0.9, "high": 1.1},
        "pair.dedendum": {"mean": 1.25, "standard_deviation": 0.05},
        "pair.tip_round_mm": {"mean": 0.1, "standard_deviation": 0.05, "low": 0.0, "high": 0.2},
        "pair.pinion.teeth": {"low": 18, "high": 20},
        "stiffness.plane": ["strain", "stress"],
    }
    even, normal, cut, whole, listed = read_parameters(given, "stiffness", PAIR)
    share = np.array([0.05, 0.3, 0.5, 0.95])
    np.testing.assert_allclose(even.at(share), 0.9 + 0.2 * share)
    np.testing.assert_allclose(normal.at(share), norm(1.25, 0.05).ppf(share))
    np.testing.assert_allclose(cut.at(share), truncnorm(-2.0, 2.0, 0.1, 0.05).ppf(share))
    assert whole.at(np.array([0.0, 0.34, 0.99])) == [18, 19, 20]
    assert all(isinstance(value, int) for value in whole.at(share))
    assert listed.at(np.array([0.1, 0.9])) == ["strain", "stress"]


def test_slopes_of_a_class_are_within_its_tolerance():
    """f_HaT of 40 teeth of 3 mm in class 6: (0.001 d + 0.4 m + 4) sqrt(2) um."""
    wheel = {"teeth": 40, "pitch_diameter_mm": 120.0, "bore_diameter_mm": 20.0}
    pinion = {"teeth": 20, "pitch_diameter_mm": 60.0, "bore_diameter_mm": 20.0}
    base = {"pair": {"pressure_angle_deg": 20.0, "face_width_mm": 10.0, "pinion": pinion, "wheel": wheel}}
    given = {"microgeometry.wheel.left.profile_slope_um": {"iso_class": 6, "mean": 2.0}}
    (slope,) = read_parameters(given, "loadmap", base)
    allowed = (0.12 + 1.2 + 4.0) * math.sqrt(2.0)
    share = np.array([1e-9, 0.3, 0.5, 1.0 - 1e-9])
    np.testing.assert_allclose(slope.at(share), truncnorm(-3.0, 3.0, 2.0, allowed / 3.0).ppf(share), atol=1e-6)
    helix = {"microgeometry.wheel.helix_slope_um": {"iso_class": 6}}
    (slope,) = read_parameters(helix, "loadmap", base)  # f_HbT, face width 10 mm
    allowed = (0.05 * math.sqrt(120.0) + 0.35 * math.sqrt(10.0) + 4.0) * math.sqrt(2.0)
    np.testing.assert_allclose(slope.at(share), truncnorm(-3.0, 3.0, 0.0, allowed / 3.0).ppf(share), atol=1e-6)
    for key, told in (
        ("microgeometry.wheel.profile_crowning_um", "no tolerance"),
        ("pair.pinion.teeth", "no tolerance"),
    ):
        with pytest.raises(InputError, match=told):
            read_parameters({key: {"iso_class": 6}}, "loadmap", base)


def test_names_may_be_tables_within_tables_or_quoted():
    nested = read_parameters({"pair": {"pinion": {"profile_shift": {"low": 0.0, "high": 0.3}}}}, "stiffness", PAIR)
    quoted = read_parameters({"pair.pinion.profile_shift": {"low": 0.0, "high": 0.3}}, "stiffness", PAIR)
    assert nested == quoted


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"pair.pinion.teth": [20]}, "did you mean 'teeth'"),
        ({"pear.pinion.teeth": [20]}, "did you mean 'pair'"),
        ({"pair.pinion": [20]}, "is a table, not a key"),
        ({"pair.pinion.teeth": [20], "pair": {"pinion": {"teeth": [21]}}}, "occurs twice"),
        ({"train.meshes": [[]], "train.meshes.0.backlash_um": [20.0]}, "is an entry of train.meshes, which is varied"),
        ({"loadmap.positions": [20]}, "is no table that a stiffness job reads"),
        ({"pair.addendum": []}, "is empty"),
        ({"pair.addendum": 1.0}, "must be a list of values or a distribution"),
        ({"pair.addendum": {"low": 1.0, "hgih": 2.0}}, "did you mean 'high'"),
        ({"pair.addendum": {"low": 2.0, "high": 1.0}}, "must be > low"),
        ({"pair.addendum": {"mean": 2.0}}, "is required with mean"),
        ({"pair.addendum": {"iso_class": 6, "low": 2.0}}, "conflicts with iso_class"),
        ({"pair.addendum": {"iso_class": 12}}, "iso_class"),
        ({"pair.pinion.teeth": {"low": 18.2, "high": 18.8}}, "holds no whole number"),
        ({"stiffness.plane": {"low": 0, "high": 1}}, "is no number"),
        ({"microgeometry.pinion.waviness.first.waves": [1]}, "an entry has a number"),
    ],
)
def test_wrong_parameters_are_named(given, told):
    with pytest.raises(InputError, match=told):
        read_parameters(given, "vibration" if "train.meshes" in given else "stiffness", PAIR)


def table(**keys) -> StudyTable:
    given = {"job": "stiffness", "outputs": {"k": "mean(k_mesh_N_per_m)"}, **keys}
    return build(StudyTable, given, "study")


def test_designs_are_those_of_their_seed(tmp_path):
    keys = {"pair.addendum": {"low": 0.9, "high": 1.1}, "pair.pinion.teeth": {"low": 18, "high": 40}}
    for design in ("latin_hypercube", "sobol", "saltelli"):
        made = [
            study_cases(table(design=design, cases=16, seed=seed, parameters=keys), tmp_path, PAIR)[1]
            for seed in (1, 1, 2)
        ]
        assert made[0] == made[1] != made[2]
    one = [case[0] for case in study_cases(table(cases=50, parameters=keys), tmp_path, PAIR)[1]]
    assert sorted(int((value - 0.9) / 0.2 * 50) for value in one) == list(range(50))  # one in each of 50 equal parts


def test_factorial_is_all_combinations(tmp_path):
    keys = {
        "pair.addendum": {"low": 0.9, "high": 1.1, "count": 3},
        "pair.pinion.teeth": {"low": 18, "high": 20},
        "stiffness.plane": ["strain", "stress"],
    }
    cases = study_cases(table(design="factorial", parameters=keys), tmp_path, PAIR)[1]
    assert cases == list(itertools.product([0.9, 1.0, 1.1], [18, 19, 20], ["strain", "stress"]))
    with pytest.raises(InputError, match="no levels"):
        study_cases(table(design="factorial", parameters={"pair.addendum": {"low": 0.9, "high": 1.1}}), tmp_path, PAIR)


def test_rows_come_from_a_table(tmp_path):
    (tmp_path / "rows.csv").write_text(
        "pair.pinion.teeth,pair.addendum,stiffness.plane\n20,1.0,strain\n21,1.1,stress\n"
    )
    parameters, cases = study_cases(table(design="rows", rows_csv="rows.csv"), tmp_path, PAIR)
    assert [one.name for one in parameters] == ["pair.pinion.teeth", "pair.addendum", "stiffness.plane"]
    assert cases == [(20, 1.0, "strain"), (21, 1.1, "stress")]
    assert isinstance(cases[0][0], int)


def test_a_key_is_set_where_it_stands():
    raw = {"train": {"meshes": [{"driver": "a"}, {"driver": "b"}]}}
    set_key(raw, "train.meshes.1.backlash_um", 20.0, "x")
    set_key(raw, "pair.pinion.teeth", 21, "x")
    assert raw == {
        "train": {"meshes": [{"driver": "a"}, {"driver": "b", "backlash_um": 20.0}]},
        "pair": {"pinion": {"teeth": 21}},
    }
    with pytest.raises(InputError, match="has 2 entries"):
        set_key(raw, "train.meshes.2.backlash_um", 20.0, "x")


@pytest.mark.parametrize("name", ["gear_train.toml", "microgeometry.toml", "andrews.toml", "slider_crank.toml"])
def test_a_job_that_is_written_reads_the_same(name):
    raw = read_toml(GEOMETRY / name)
    assert tomllib.loads(toml_document(raw)) == raw


# ----------------------------------------------------------------------------------------------------- expressions


ANSWER = Answer(
    {"cells": {"torque_Nm": [50.0, 100.0, 100.0], "te_um": ["1.5", "nan", "4"], "status": ["ok", "no", "ok"]},
     "orders": {"order": [0, 1], "at_50_um": np.array([3.0, 0.5])}},
    {"mesh": {"mean": 7.0}, "by": [1.0, 2.0], "none": None, "zero": 0.0},
)  # fmt: skip


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("ptp(te_um)", 2.5),  # the gap is left out
        ("mean(te_um[torque_Nm == 50]) - 1", 0.5),
        ("max(cells.te_um[(torque_Nm > 60) & (status == 'ok')])", 4.0),
        ("orders.at_50_um[orders.order == 1]", 0.5),
        ("summary.mesh.mean**2 / summary['by'][1]", 24.5),
        ("interp(75, [50, 100][0] if False else torque_Nm, torque_Nm)", None),
        ("count(te_um > 2)", 1.0),
        ("rms(orders.at_50_um)", math.sqrt((9.0 + 0.25) / 2)),
        ("-abs(-summary.by[0])", -1.0),
        ("max(summary.by[0], atan2(0, -1) / pi * 5) + log10(1e3)", 8.0),
    ],
)
def test_outputs_are_arithmetic_on_tables(text, value):
    if value is None:
        with pytest.raises(InputError, match="cannot read"):
            value_of(read_output(text, "y"), ANSWER)
    else:
        assert value_of(read_output(text, "y"), ANSWER) == pytest.approx(value)
    assert math.isnan(value_of(read_output("summary.none", "y"), ANSWER))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("te_mu", "did you mean 'te_um'"),
        ("summary.mash.mean", "did you mean 'mesh'"),
        ("te_um", "gives 3 values"),
        ("maen(te_um)", "did you mean 'mean'"),
        ("__import__('os')", "unknown name"),
        ("te_um.__class__", "has nothing below it"),
        ("(lambda: 1)()", "cannot read"),
        ("mean(te_um, 2)", "takes 1 argument"),
        ("1 / summary.zero", "1 / 0 has no value"),
        ("summary.by[0.5]", "not an index of a column"),
        ("mean(", "is not an expression"),
        ("summary.by[7]", "has no value"),
    ],
)
def test_what_is_no_output_is_named(text, told):
    with pytest.raises(InputError, match=told):
        value_of(read_output(text, "y"), ANSWER)


# ------------------------------------------------------------------------------------------------------ statistics


def test_intervals_of_shares_and_quantiles():
    # none of n: upper end 1 - (alpha/2)^(1/n), closed form of Clopper and Pearson
    none = proportion(0, 30)
    assert none["interval"] == pytest.approx([0.0, 1.0 - 0.025 ** (1.0 / 30)])
    rng = np.random.default_rng(5)
    held = 0
    for _ in range(300):
        low, high = spread(rng.standard_normal(80))["quantiles"]["50 %"]["interval"]
        held += low <= 0.0 <= high
    assert held >= 0.95 * 300 - 3 * math.sqrt(300 * 0.95 * 0.05)  # three deviations of the binomial count


def test_pareto_set_is_that_of_the_definition():
    values = np.random.default_rng(2).integers(0, 6, (60, 3)).astype(float)
    values[7] = np.inf
    beaten = [
        any((b <= a).all() and (b < a).any() for b in values) for a in values
    ]  # fmt: skip
    expected = [i for i, lost in enumerate(beaten) if not lost and i != 7]
    assert pareto_set(values).tolist() == expected


def ishigami(x1, x2, x3):
    return np.sin(x1) + 7.0 * np.sin(x2) ** 2 + 0.1 * x3**4 * np.sin(x1)


def ishigamis_indices() -> tuple[list[float], list[float]]:
    """First order and total for a = 7, b = 0.1 (Saltelli et al., Global Sensitivity Analysis, 2008, section 4.6)."""
    a, b, pi4 = 7.0, 0.1, math.pi**4
    v1, v2, v13 = 0.5 * (1 + b * pi4 / 5) ** 2, a**2 / 8, b**2 * pi4**2 * (1 / 18 - 1 / 50)
    v = v1 + v2 + v13
    return [v1 / v, v2 / v, 0.0], [(v1 + v13) / v, v2 / v, v13 / v]


@pytest.mark.parametrize(("n", "close"), [(64, 0.5), pytest.param(1024, 0.04, marks=pytest.mark.slow)])
def test_ishigami_through_the_whole_machinery(n, close, tmp_path):
    """The study's indices are those of the function at the study's points; with many points, those of theory."""
    study = read_study(written(tmp_path, "saltelli", n))
    found = run_study(study, tmp_path, jobs=1).summary()["outputs"]["y"]["sobol"]
    y = ishigami(*np.array(study.cases).T)
    parts = {"f_A": y[None, :n], "f_B": y[None, n : 2 * n], "f_AB": y[2 * n :].reshape(3, 1, n)}
    direct = sobol_indices(func=parts, n=n)
    for order, known in zip(("first_order", "total_order"), ishigamis_indices(), strict=True):
        values = list(found[order].values())
        np.testing.assert_allclose(values, getattr(direct, order).ravel(), rtol=1e-12)
        np.testing.assert_allclose(values, known, atol=close)


def test_points_for_the_indices_give_those_of_theory():
    """Of Ishigami's function."""
    n = 1 << 14
    shares = saltelli(qmc.Sobol(6, rng=np.random.default_rng(3)).random_base2(14))
    y = ishigami(*((2.0 * shares - 1.0) * math.pi).T)
    parts = {"f_A": y[None, :n], "f_B": y[None, n : 2 * n], "f_AB": y[2 * n :].reshape(3, 1, n)}
    found = sobol_indices(func=parts, n=n)
    first, total = ishigamis_indices()
    np.testing.assert_allclose(found.first_order.ravel(), first, atol=0.01)
    np.testing.assert_allclose(found.total_order.ravel(), total, atol=0.01)


def test_elementary_effects_of_a_linear_function_are_its_slopes(tmp_path):
    """y = 3 x1 - 2 x2 on ranges of 2 pi, x3 alone in a square: effects of the first are slopes times the range."""
    path = written(tmp_path, "morris", 6)
    path.write_text(
        path.read_text().split("[study.outputs]")[0] + '[study.outputs]\ny = "3*x1[0] - 2*x2[0] + x3[0]**2"\n'
    )
    study = read_study(path)
    assert len(study.cases) == 6 * 4
    found = run_study(study, tmp_path, jobs=1).summary()["outputs"]["y"]["morris"]
    first, second, third = found.values()
    assert first == pytest.approx({"mean": 6 * math.pi, "mean_size": 6 * math.pi, "deviation": 0.0}, abs=1e-9)
    assert second == pytest.approx({"mean": -4 * math.pi, "mean_size": 4 * math.pi, "deviation": 0.0}, abs=1e-9)
    # x3 goes from -3 pi/4 to pi/4 or from -pi/4 to 3 pi/4: its square changes by -pi^2/2 or pi^2/2
    assert third["mean_size"] == pytest.approx(math.pi**2)
    assert third["deviation"] > 0.0


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"outputs": {}}, "is empty"),
        ({"outputs": {"a b": "1"}}, "must be a word"),
        ({"limits": {"q": {"low": 1.0}}}, "unknown name 'q'"),
        ({"limits": {"k": {}}}, "give low, high or both"),
        ({"minimise": ["k"], "maximise": ["k"]}, "is also in minimise"),
        ({"design": "rows"}, "is required"),
        ({"design": "rows", "rows_csv": "a.csv", "parameters": {"a": [1]}}, "columns are the parameters"),
        ({"rows_csv": "a.csv"}, "conflicts with design"),
        ({"parameters": {}}, "is empty"),
        ({"design": "saltelli", "cases": 12}, "power of 2"),
        ({"job": "stifness"}, "did you mean 'stiffness'"),
    ],
)
def test_wrong_tables_are_named(keys, told, tmp_path):
    with pytest.raises(InputError, match=told):
        study_cases(table(**{"parameters": {"pair.addendum": {"low": 0.9, "high": 1.1}}, **keys}), tmp_path, PAIR)
