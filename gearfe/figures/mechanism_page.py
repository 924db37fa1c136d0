"""animation.html: a mechanism in motion, with a slider over the time; one file without links to others."""

from __future__ import annotations

import html
import json
from pathlib import Path
from typing import Any

import numpy as np

from ..base.files import whole_file
from ..base.progress import stage
from ..base.typing import Array, ComplexArray
from ..mechanisms.model import Mechanism
from ..multibody import Trajectory
from .mechanism_scene import (
    body_colours,
    coupled,
    drawn_states,
    link_places,
    path_points,
    place_of,
    rigid_ends,
)
from .style import GREY

#: Width of the drawing in its own unit, which places are rounded to: a tenth of a pixel.
WIDTH = 8000
#: Most nodes of the edge of a link of finite elements.
MOST_NODES = 400

_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta http-equiv="Content-Security-Policy"
 content="default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'">
<title>{title}</title>
<style>body{{font:15px sans-serif;margin:1em auto;max-width:60em;padding:0 1em}}
svg{{width:100%;max-height:75vh;border:1px solid #e5e7eb}}
.bar{{display:flex;gap:1em;align-items:center}}input{{flex:1}}output{{min-width:7em;text-align:right}}</style></head><body>
<h1 style="font-size:1.2em">{title}</h1>
<svg viewBox="{box}" id="scene" role="img" aria-label="the mechanism"></svg>
<div class="bar"><button id="play">Play</button>
<input id="at" type="range" min="0" max="{last}" value="0" aria-label="time"><output id="time"></output></div>
<p>{legend}</p>
<script type="application/json" id="data">{data}</script>
<script>
const data = JSON.parse(document.getElementById("data").textContent), scene = document.getElementById("scene");
const at = document.getElementById("at"), time = document.getElementById("time");
const play = document.getElementById("play");
const lines = data.lines.map(line => {{
  const drawn = document.createElementNS("http://www.w3.org/2000/svg", line.closed ? "polygon" : "polyline");
  for (const [key, value] of Object.entries(line.style)) drawn.setAttribute(key, value);
  return scene.appendChild(drawn);
}});
function show() {{
  const frame = Number(at.value);
  data.lines.forEach((line, i) => {{
    lines[i].setAttribute("points", line.places[line.places.length > 1 ? frame : 0].join(" "));
  }});
  time.textContent = data.times[frame] + " s";
}}
let running = 0;
play.onclick = () => {{
  if (running) {{ clearInterval(running); running = 0; play.textContent = "Play"; return; }}
  play.textContent = "Stop";
  running = setInterval(() => {{ at.value = (Number(at.value) + 1) % data.times.length; show(); }}, 40);
}};
at.oninput = show;
show();
</script></body></html>
"""


@stage("animation")
def write_page(folder: Path, mechanism: Mechanism, trajectory: Trajectory) -> None:
    """Write ``animation.html`` with the number of frames of the file.

    Parameters
    ----------
    folder : Path
        Where to write it.
    mechanism : Mechanism
        The mechanism.
    trajectory : Trajectory
        Its motion.
    """
    times = np.linspace(trajectory.time[0], trajectory.time[-1], mechanism.file.run.frames)
    lines = _lines(mechanism, trajectory.dense(times), drawn_states(mechanism, trajectory))
    every = np.concatenate([places.ravel() for places, _ in lines])
    low, size = complex(every.real.min(), every.imag.max()), float(max(np.ptp(every.real), np.ptp(every.imag), 1e-12))
    scale, pad = WIDTH / size, 0.06 * WIDTH
    box = (-pad, -pad, scale * float(np.ptp(every.real)) + 2 * pad, scale * float(np.ptp(every.imag)) + 2 * pad)
    drawn = [{**style, "places": _rounded(scale * (places - low))} for places, style in lines]
    title = mechanism.file.title or mechanism.path.stem or "mechanism"
    rigid = [name for name in mechanism.file.bodies if name not in mechanism.elastic]
    kinds = (rigid, mechanism.links, mechanism.plates)
    named = [pair for names in kinds for pair in zip(names, body_colours(mechanism), strict=False)]
    legend = " ".join(f'<b style="color:{colour}">{html.escape(name)}</b>' for name, colour in named)
    data = json.dumps({"times": [f"{time:.4g}" for time in times], "lines": drawn}, separators=(",", ":"))
    text = _PAGE.format(
        title=html.escape(title),
        box=" ".join(f"{value:.0f}" for value in box),
        last=len(times) - 1,
        legend=legend,
        data=data.replace("<", "\\u003c"),
    )
    with whole_file(folder / "animation.html") as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def _rounded(places: ComplexArray) -> list[list[int]]:
    """Whole numbers x, y, x, y, ... of each frame, y downwards; a line that rests has one frame."""
    if (places == places[:1]).all():
        places = places[:1]
    pairs = np.stack([places.real, -places.imag], axis=-1)
    return [list(map(int, row)) for row in np.rint(pairs).reshape(len(places), -1).astype(int)]


def _lines(mechanism: Mechanism, q: Array, path: Array) -> list[tuple[ComplexArray, dict[str, Any]]]:
    """Places (frames, points) of all that is drawn, as complex numbers (m), and how it is drawn."""
    factor, width = mechanism.file.figure.magnification, WIDTH / 250
    colours = body_colours(mechanism)
    lines: list[tuple[ComplexArray, dict[str, Any]]] = []

    def add(places: Any, colour: str, thickness: float = 1.0, *, filled: bool = False) -> None:
        fill = {"fill": colour, "fill-opacity": 0.12} if filled else {"fill": "none"}
        line = {"stroke": colour, "stroke-width": round(thickness * width, 1), "stroke-linejoin": "round"}
        lines.append((np.atleast_2d(places), {"closed": filled, "style": {**fill, **line, "stroke-linecap": "round"}}))

    for _, body, point in path_points(mechanism):
        add(place_of(path, body, point)[None, :], GREY, 0.3)
    for _, one, other in coupled(mechanism, q):
        add(np.stack([one, other], axis=1), GREY, 0.5)
    for (body, points), colour in zip(rigid_ends(mechanism), colours, strict=False):
        ends = np.stack([place_of(q, body, (p.real, p.imag)) for p in points], axis=1)
        add(ends, colour, filled=len(points) > 2)
    for link, colour in zip(mechanism.links.values(), colours, strict=False):
        add(link_places(link, link.smooth, q, factor), colour)
    for plate, colour in zip(mechanism.plates.values(), colours, strict=False):
        places = plate.exaggerated(q, factor)
        for loop in _loops(plate.border):
            add(places[:, loop[:: 1 + len(loop) // MOST_NODES]], colour, 0.5, filled=True)
    every = np.concatenate([places.ravel() for places, _ in lines]) if lines else np.zeros(1, dtype=complex)
    mark = 0.012 * max(float(np.ptp(every.real)), float(np.ptp(every.imag)))
    for x, y in mechanism.file.ground.points_m.values():
        add(complex(x, y) + mark * np.array([[-1 - 1j, 1 - 1j, 1j]]), "black", 0.3, filled=True)
    return lines


def _loops(border: Array) -> list[list[int]]:
    """Closed lines of nodes, from sides (end, middle, end) in turn."""
    following = {int(first): (int(middle), int(last)) for first, middle, last in border}
    loops = []
    while following:
        node = next(iter(following))
        loop: list[int] = []
        while node in following:
            middle, after = following.pop(node)
            loop += [node, middle]
            node = after
        loops.append(loop)
    return loops
