"""animation.html: places of the drawing against those of the mechanism, and texts of strangers as texts."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np

from gearfe.cli.main import main
from gearfe.mechanisms import load_mechanism
from gearfe.mechanisms.solve import solve
from tests.makers.files import mechanism_file

FOUR_BAR = """
title = "</script><b>four bar"
[run]
end_s = 1.0
step_s = 0.1
frames = 11
[ground.points_m]
A = [0.0, 0.0]
D = [0.4, 0.0]
[bodies.crank]
mass_kg = 1.0
inertia_kg_m2 = 0.01
points_m = { A = [0.0, 0.0], B = [0.1, 0.0] }
[bodies.coupler]
mass_kg = 1.0
inertia_kg_m2 = 0.01
position_m = [0.1, 0.0]
angle_deg = 50.0
points_m = { B = [0.0, 0.0], C = [0.35, 0.0], tip = [0.2, 0.1] }
[bodies.rocker]
mass_kg = 1.0
inertia_kg_m2 = 0.01
position_m = [0.4, 0.0]
angle_deg = 100.0
points_m = { D = [0.0, 0.0], C = [0.3, 0.0] }
[joints]
A = { type = "hinge", body = "crank", point = "A", to_point = "A" }
B = { type = "hinge", body = "crank", point = "B", to = "coupler", to_point = "B" }
C = { type = "hinge", body = "coupler", point = "C", to = "rocker", to_point = "C" }
D = { type = "hinge", body = "rocker", point = "D", to_point = "D" }
drive = { type = "prescribed", body = "crank", coordinate = "angle", motion_rad = "6*time" }
"""


def test_lines_are_where_the_links_are(tmp_path: Path) -> None:
    file = mechanism_file(tmp_path, FOUR_BAR)
    assert main(["mechanism", str(file), "--animation", "--out", str(tmp_path / "out"), "--no-estimate"]) == 0
    page = (tmp_path / "out" / "animation.html").read_text(encoding="utf-8")
    assert page.count("</script>") == 2
    assert "&lt;b&gt;four bar" in page
    assert "http" not in page.replace('"http://www.w3.org/2000/svg"', "").replace("http-equiv", "")
    found = re.search(r'id="data">(.*?)</script>', page)
    assert found is not None
    data = json.loads(found[1])
    np.testing.assert_allclose([float(time) for time in data["times"]], np.linspace(0.0, 1.0, 11))
    mechanism = load_mechanism(file)
    results = solve(mechanism).results
    assert results is not None
    names = ("crank.A", "crank.B", "coupler.B", "coupler.C", "coupler.tip", "rocker.D", "rocker.C")
    needed: set[tuple[str, str | None]] = {(kind, name) for kind in ("x", "y") for name in names}
    values = mechanism.values(needed, results.trajectory.q)
    exact = np.array([values["x", name] - 1j * values["y", name] for name in names]).T
    links = [np.array(line["places"], dtype=float) for line in data["lines"] if len(line["places"]) > 1]
    drawn = np.concatenate([line[:, 0::2] + 1j * line[:, 1::2] for line in links], axis=1)
    scale = (drawn[0, 1] - drawn[0, 0]) / (exact[0, 1] - exact[0, 0])
    np.testing.assert_allclose(drawn - drawn[:, :1], scale * (exact - exact[:, :1]), rtol=0.0, atol=4.0)
    assert abs(scale.imag) < 0.01 * scale.real
