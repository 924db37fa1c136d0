"""One tooth sector of a gear as second-order curved triangles, with the nodes of its outline on the exact profile.

The outline is divided into edges: sizes are graded along it, and nodes lie at chosen arc lengths of the exact curves.
gmsh fills it with straight triangles. Mid-edge nodes are then placed on the exact profile along the outline, and in the
middle elsewhere. gmsh works in millimetres; metres leave this module. Default sizes are in proportion to the module.

The sector of an internal gear lies about the -x axis. Its tooth points to +x, as others do, and the outside of the rim
takes the place of the bore.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...base.cache import cached_arrays
from ...base.errors import InputError
from ...base.typing import Array, BoolArray, ComplexArray, IntArray
from ...fem.meshing.session import gmsh_session
from ...fem.plane import least_jacobian, second_order
from ..geometry.curves import coordinates
from ..geometry.gear_data import Web
from ..geometry.mesh_geometry import MeshGeometry
from ..geometry.spur_gear import Gear

#: Raised whenever the recipe's meaning changes, so that stored meshes are not mistaken for new ones.
RECIPE_NUMBER = 3

#: Factor on the sizes of a boundary beside which elements are inside out, and how often a sector is filled at most.
FINER, MOST_FILLINGS = 0.7, 12

#: Sizes of the recipe that cut a curved boundary into edges; the cuts between sectors are straight.
SIZES = {
    "flank_left": ("flank", "strip"), "flank_right": ("back",), "root_left": ("root",), "root_right": ("root",),
    "tip": ("back",), "bore": ("bore",), "rim": ("bore",),
}  # fmt: skip

#: Boundary of the pieces of a half profile that are no flank.
GROUPS = {"root_circle": "root", "trochoid": "root", "fillet": "root", "tip": "tip"}

#: Fewer second-order edges round the whole bore stiffen the gear measurably (0.3 % with seven).
MINIMUM_BORE_EDGES = 24


@dataclass(frozen=True)
class SectorRecipe:
    """Element sizes of a tooth sector (m).

    Parameters
    ----------
    flank
        On the driving flank, the left one in the convention of this package.
    strip
        At the tip and at the start of active profile of the driving flank, where the mate's tip corner bears.
    strip_length
        Length of those strips along the flank (m).
    active_start
        Roll length of the start of active profile (m): where the mate's tip begins to bear.
    back
        On the flank that carries nothing.
    root, body, bore
        On root fillet and root circle, inside the gear body, round the bore or the rim.
    deepening
        Growth of the size inside the body per depth below the root circle (-): far from the teeth the field is smooth.
    growth
        Largest change of size per length along the outline (-).
    """

    flank: float
    strip: float
    strip_length: float
    active_start: float
    back: float
    root: float
    body: float
    bore: float
    growth: float = 0.35
    deepening: float = 0.2

    def scaled(self, factor: float) -> SectorRecipe:
        """The recipe with every size multiplied by `factor` (the strips keep their length)."""
        sizes = ("flank", "strip", "back", "root", "body", "bore")
        return replace(self, **{name: factor * getattr(self, name) for name in sizes})


@dataclass(frozen=True)
class SectorMesh:
    """Second-order triangles of one tooth sector, in the frame whose x axis is the tooth's centreline.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        Node positions (m).
    triangles : ndarray, shape (m, 6)
        Corner nodes counter-clockwise, then the nodes in the middle of edges 01, 12, 20.
    boundaries : dict of str to ndarray, shape (k, 3)
        Outline edges (start, middle, end node), in order counter-clockwise round the sector. Their names are
        ``cut_right``, ``root_right``, ``flank_right``, ``tip``, ``flank_left``, ``root_left``, ``cut_left``, ``bore``
        (``rim`` of an internal gear). Tip rounds belong to the flanks.
    cut_right, cut_left : ndarray, shape (c,)
        Nodes of the two cut sides from outside to bore; node k of one is node k of the other turned by the pitch angle.
    teeth
        Number of such sectors in the whole gear.
    internal
        Whether the next sector lies clockwise.
    free
        Whether bore or rim are elastic, and only their mean displacement and turn are held.
    """

    points: Array
    triangles: IntArray
    boundaries: dict[str, IntArray]
    cut_right: IntArray
    cut_left: IntArray
    teeth: int
    internal: bool = False
    free: bool = False

    @property
    def pitch(self) -> float:
        """Angle (rad) from one sector to the next."""
        return (-2.0 if self.internal else 2.0) * math.pi / self.teeth

    @property
    def held(self) -> IntArray:
        """Edges (start, middle, end node) of the bore, or of the rim of an internal gear, shape (k, 3)."""
        return self.boundaries["rim" if self.internal else "bore"]

    def contact_edges(self) -> IntArray:
        """Edges of the driving (left) flank that can touch the mate, from root to tip, each (root side, middle, tip
        side).

        They are the flank with its tip round and the upper half of the fillet, which the tip of a bent mate can reach.
        The node on the cut side is never among them.
        """
        root = self.boundaries["root_left"]
        ends = self.points[root[:, 2]]
        depth = np.abs(np.linalg.norm(self.points[root[0, 0]]) - np.linalg.norm(ends, axis=1))
        reachable = int(np.count_nonzero(depth < 0.5 * depth.max()))
        return np.concatenate([self.boundaries["flank_left"], root[: min(reachable, len(root) - 1)]])[::-1, ::-1]


def web_triangles(points: Array, triangles: IntArray, web: Web) -> BoolArray:
    """Return which triangles of a section about the origin are of the web, shape (m,)."""
    centre = np.linalg.norm(points[triangles[:, :3]].mean(axis=1), axis=1)
    outer, *inner = web.radii
    return np.asarray((centre < outer) & (centre > max(inner, default=0.0)))


def sector_mesh(gear: Gear, recipe: SectorRecipe, *, cache: bool = True) -> SectorMesh:
    """Mesh of one tooth of `gear`; taken from the mesh cache when the same was made before.

    Parameters
    ----------
    gear
        Geometry.
    recipe
        Element sizes.
    cache
        ``False`` neither reads nor writes the cache.
    """
    if not cache:
        return _unpack(_make(gear, recipe), gear)
    plan = {"number": RECIPE_NUMBER, "gear": gear, "sizes": recipe}
    return _unpack(cached_arrays("tooth-sector", plan, lambda: _make(gear, recipe)), gear)


def _unpack(arrays: dict[str, NDArray[np.generic]], gear: Gear) -> SectorMesh:
    boundaries = {name[3:]: value.astype(np.int64) for name, value in arrays.items() if name.startswith("on_")}
    return SectorMesh(
        points=arrays["points"].astype(np.float64),
        triangles=arrays["triangles"].astype(np.int64),
        boundaries=boundaries,
        cut_right=_cut_nodes(boundaries["cut_right"], reverse=True),
        cut_left=_cut_nodes(boundaries["cut_left"], reverse=False),
        teeth=gear.tooth_count,
        internal=gear.internal,
        free=gear.rim == "free",
    )


def _cut_nodes(edges: IntArray, *, reverse: bool) -> IntArray:
    nodes = np.concatenate([edges[:, :2].ravel(), edges[-1:, 2]])
    return nodes[::-1] if reverse else nodes


# ---- outline ---------------------------------------------------------------------------------------------------------


def _outline(gear: Gear, recipe: SectorRecipe) -> dict[str, ComplexArray]:
    """Return the outline of the sector by boundary name, counter-clockwise from the bore (or rim) end of the right cut.
    It has the nodes of the edges, end, middle, end, ..., end, as complex numbers (m).
    """
    left = _half_profile(gear, recipe, fine=True)
    right = _half_profile(gear, recipe, fine=False)
    half, held = np.pi / gear.teeth, gear.held_radius
    around = 2 * abs(half) * held
    edges = max(1, round(around / recipe.bore), int(np.ceil(MINIMUM_BORE_EDGES / gear.tooth_count)))
    depth = abs(gear.root_radius - held)
    marks = [0.0, *(gear.root_radius - radius for radius in web_radii(gear)), depth]
    place = np.union1d(np.linspace(0, depth, 400), marks)
    size = np.minimum(recipe.body + recipe.deepening * place, depth)
    size[0], size[-1] = min(recipe.root, depth), min(recipe.bore, around / edges, depth)
    size = _limited(place, size, 2 * recipe.growth)
    cuts = [(place >= a) & (place <= b) for a, b in itertools.pairwise(marks)]
    ends = [np.zeros(1), *(place[cut][0] + _nodes(place[cut] - place[cut][0], size[cut])[1:] for cut in cuts)]
    # negative radii for an internal gear, whose sector lies about the -x axis
    radii = gear.sign * gear.root_radius - np.concatenate(ends)
    cut = _polar(_interleaved(radii, _middles(radii)), half)
    return {
        "cut_right": cut[::-1].conj(),
        "root_right": right["root"].conj(),
        "flank_right": right["flank"].conj(),
        "tip": np.concatenate([right["tip"].conj(), left["tip"][-2::-1]]),
        "flank_left": left["flank"][::-1],
        "root_left": left["root"][::-1],
        "cut_left": cut,
        "rim" if gear.internal else "bore": _polar(gear.sign * held, np.linspace(half, -half, 2 * edges + 1)),
    }


def web_radii(gear: Gear) -> tuple[float, ...]:
    """Return the radii (m) at which the web of a gear ends, the outer one first; none without a web."""
    return () if gear.narrow_web is None else gear.narrow_web.radii


def _polar(radius: Array | float, angle: Array | float) -> ComplexArray:
    return np.asarray(radius * np.cos(angle) + 1j * (radius * np.sin(angle)))


def _middles(ends: Array) -> Array:
    return 0.5 * (ends[1:] + ends[:-1])


def _interleaved(ends: Array, middles: Array) -> Array:
    made = np.empty(len(ends) + len(middles), dtype=ends.dtype)
    made[::2], made[1::2] = ends, middles
    return made


def _half_profile(gear: Gear, recipe: SectorRecipe, *, fine: bool) -> dict[str, ComplexArray]:
    """Root, flank and tip of the left half, from the middle of the space to the tip's centreline."""
    profile = gear.profile
    segments, involute = profile.segments, profile.segment("involute")
    starts = np.cumsum([0.0, *(s.length for s in segments)])
    place = np.unique(np.concatenate([np.linspace(a, b, 200) for a, b in itertools.pairwise(starts)]))
    size = np.full(len(place), recipe.root)
    flank = [i for i, s in enumerate(segments) if s.name in ("involute", "tip_round")]
    low, high = starts[flank[0]], starts[flank[-1] + 1]
    on_flank = (place >= low) & (place <= high)
    size[place > high] = recipe.back
    size[on_flank] = recipe.flank if fine else recipe.back
    if fine:
        start = low + float(involute.arc_length_at(profile.flank.parameter(recipe.active_start)))
        near_start = abs(place - start) <= recipe.strip_length
        near_tip = on_flank & (place >= high - recipe.strip_length)
        size[(near_start & on_flank) | near_tip] = recipe.strip
    size = _limited(place, size, recipe.growth)
    chains: dict[str, ComplexArray] = {}
    for segment, a, b in zip(segments, starts, starts[1:], strict=False):
        inside = (place >= a) & (place <= b)
        arc = _nodes(place[inside] - a, size[inside])
        arc[-1] = segment.length
        ends, middles = (segment.points(segment.parameter_at(s)) @ [1, 1j] for s in (arc, _middles(arc)))
        group, nodes = GROUPS.get(segment.name, "flank"), _interleaved(ends, middles)
        chains[group] = np.concatenate([chains[group], nodes[1:]]) if group in chains else nodes
    return chains


def _limited(place: Array, size: Array, growth: float) -> Array:
    """Largest size function below `size` whose slope along the curve stays within `growth`."""
    size = size.copy()
    step = growth * np.diff(place)
    for i in range(len(step)):
        size[i + 1] = min(size[i + 1], size[i] + step[i])
    for i in range(len(step) - 1, -1, -1):
        size[i] = min(size[i], size[i + 1] + step[i])
    return size


def _nodes(place: Array, size: Array) -> Array:
    """Node positions along a curve such that each edge spans the same share of int ds / size."""
    cells = np.concatenate([[0.0], np.cumsum(np.diff(place) * 0.5 * (1 / size[1:] + 1 / size[:-1]))])
    count = max(1, int(np.ceil(cells[-1] - 1e-6)))
    return np.interp(np.linspace(0, cells[-1], count + 1), cells, place)


# ---- filling ---------------------------------------------------------------------------------------------------------


def _make(gear: Gear, recipe: SectorRecipe) -> dict[str, NDArray[np.generic]]:
    """Mesh the sector: name -> array, the boundaries under ``on_<name>``.

    Long edges of a bent outline may bulge through the triangles behind them; there the outline is cut finer.

    Raises
    ------
    InputError
        When elements stay inside out.
    """
    for _ in range(MOST_FILLINGS):
        made = _filled(gear, recipe)
        wrong = np.flatnonzero(~(least_jacobian(made["points"], made["triangles"]) > 0))
        if len(wrong) == 0:
            return made
        bulging = np.unique(made["triangles"][wrong])
        named = {name[3:] for name in made if name.startswith("on_") and np.isin(made[name][:, 1], bulging).any()}
        finer = {size for name in named for size in SIZES.get(name, ())}
        if not finer:
            break
        recipe = replace(recipe, **{size: FINER * getattr(recipe, size) for size in finer})
    problem = f"{len(wrong)} elements of the gear with {gear.teeth} teeth are inside out"
    raise InputError("mesh", None, problem, "use smaller elements: coarsen or flank_coarsen")


def _filled(gear: Gear, recipe: SectorRecipe) -> dict[str, NDArray[np.generic]]:
    chains = _outline(gear, recipe)
    ring = coordinates(np.concatenate([nodes[:-1:2] for nodes in chains.values()]))
    depth = abs(gear.root_radius - gear.held_radius)
    arcs = _arcs(gear, chains)
    corners, triangles = _fill(ring, recipe.body + recipe.deepening * depth, arcs)
    points, quadratic, edges = second_order(corners, triangles)
    keys = edges[:, 0] * len(corners) + edges[:, 1]

    def middles(start: IntArray, end: IntArray) -> IntArray:
        key = np.minimum(start, end) * len(corners) + np.maximum(start, end)
        return np.asarray(len(corners) + np.searchsorted(keys, key))

    arrays: dict[str, NDArray[np.generic]] = {}
    first = 0
    for name, nodes in chains.items():
        count = len(nodes) // 2
        start = np.arange(first, first + count)
        end = (start + 1) % len(ring)
        middle = middles(start, end)
        points[middle] = coordinates(nodes[1::2])
        arrays["on_" + name] = np.stack([start, middle, end], axis=1)
        first += count
    first = len(ring)
    for arc in arcs:
        inner = np.arange(first, first + len(arc.nodes) // 2 - 1)
        along = np.array([arc.right, *inner, arc.left])
        points[middles(along[:-1], along[1:])] = coordinates(arc.nodes[1::2])
        first += len(inner)
    return {"points": points, "triangles": quadratic, **arrays}


@dataclass(frozen=True)
class _Arc:
    """Circle from the right cut to the left one that element edges follow.

    Attributes
    ----------
    right, left
        Numbers of its first and last node among the corners of the outline.
    nodes : ndarray of complex, shape (2 k + 1,)
        Ends and middles of its edges (m).
    """

    right: int
    left: int
    nodes: ComplexArray


def _arcs(gear: Gear, chains: dict[str, ComplexArray]) -> list[_Arc]:
    """Arcs at which the web of a gear ends, the outer one first, on nodes of both cuts."""
    right, left = np.abs(chains["cut_right"][::2]), np.abs(chains["cut_left"][::2])
    first = sum(len(nodes) // 2 for name, nodes in chains.items() if name not in ("cut_left", "bore"))
    half, arcs = math.pi / gear.teeth, []
    for radius in web_radii(gear):
        i, j = int(np.abs(right - radius).argmin()), int(np.abs(left - radius).argmin())
        size = max(right[i + 1] - right[i], right[i] - right[i - 1])
        edges = max(1, math.ceil(2.0 * half * radius / size), math.ceil(MINIMUM_BORE_EDGES / gear.tooth_count))
        arcs.append(_Arc(i, first + j, _polar(radius, np.linspace(-half, half, 2 * edges + 1))))
    return arcs


def _fill(ring: Array, largest: float, arcs: Sequence[_Arc] = ()) -> tuple[Array, IntArray]:
    """Return straight triangles of sizes up to `largest` (m) inside a closed ring of points, which keep their places
    and come first. Then come the corners within arcs across the ring, the outer arc first.

    Returns
    -------
    points : ndarray, shape (n, 2)
        Positions (m).
    triangles : ndarray, shape (m, 3)
        Counter-clockwise.
    """
    with gmsh_session("tooth sector") as gmsh:
        gmsh.option.setNumber("Mesh.Algorithm", 6)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 1)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 1e3 * largest)
        geo = gmsh.model.geo
        tags = [geo.addPoint(x, y, 0.0) for x, y in (1e3 * ring).tolist()]
        lines = [geo.addLine(a, b) for a, b in zip(tags, tags[1:] + tags[:1], strict=True)]
        chords = []
        for arc in arcs:
            inner = [geo.addPoint(x, y, 0.0) for x, y in (1e3 * coordinates(arc.nodes[2:-1:2])).tolist()]
            ends = [tags[arc.right], *inner, tags[arc.left]]
            chords.append([geo.addLine(a, b) for a, b in itertools.pairwise(ends)])
        right, left = [*(arc.right for arc in arcs), 0], [*(arc.left for arc in arcs), len(lines)]
        for i, chord in enumerate([*chords, []]):
            outer = lines[right[i] : left[i]]
            if i > 0:
                outer = [*lines[right[i] : right[i - 1]], *chords[i - 1], *lines[left[i - 1] : left[i]]]
            geo.addPlaneSurface([geo.addCurveLoop([*outer, *(-line for line in reversed(chord))])])
        geo.synchronize()
        for line in itertools.chain(lines, *chords):
            gmsh.model.mesh.setTransfiniteCurve(line, 2)
        gmsh.model.mesh.generate(2)
        node_tags, flat, _ = gmsh.model.mesh.getNodes()
        _, _, connectivity = gmsh.model.mesh.getElements(2)
    position = np.asarray(flat).reshape(-1, 3)[:, :2] * 1e-3
    number = np.empty(int(np.max(node_tags)) + 1, dtype=np.int64)
    number[np.asarray(node_tags, dtype=np.int64)] = np.arange(len(position))
    triangles = number[np.asarray(connectivity[0], dtype=np.int64)].reshape(-1, 3)
    ring = np.concatenate([ring, *(coordinates(arc.nodes[2:-1:2]) for arc in arcs)])
    # gmsh numbers mesh nodes on geometry points first, in the order of the points; the exact coordinates are put back
    if not np.allclose(position[: len(ring)], ring, rtol=0, atol=1e-12):
        raise RuntimeError("gmsh did not keep the outline's points")
    position[: len(ring)] = ring
    return position, triangles


#: Edges round the bore. A gear of 12 teeth with a bore of a tenth of its pitch diameter, near which most of its twist
#: is, was 0.5 % too stiff with 24 of them, 0.03 % with 48.
BORE_EDGES = 48
#: Longest edge of the bore in thicknesses of the rim between bore and root. Rims of 0.7 to 1.3 modules were 0.6 %
#: too stiff with edges twice as long, and on coarser meshes too; 0.05 % with these.
RIM_SHARE = 0.5


def sector_recipes(
    pair: MeshGeometry, *, coarsen: float = 1.0, flank_coarsen: float = 1.0
) -> tuple[SectorRecipe, SectorRecipe]:
    """Recipes for pinion and wheel.

    `coarsen` multiplies every size (2 is about a quarter of the unknowns), `flank_coarsen` besides those of the driving
    flanks.

    The sizes are those at which the stiffness of common pairs lies within 0.1 % of its limit at operating loads.
    """
    module = pair.pinion.module
    starts = (pair.path["A"].pinion_roll, pair.path["E"].wheel_roll)
    made = []
    for gear, start in zip((pair.pinion, pair.wheel), starts, strict=True):
        rim = abs(gear.root_radius - gear.held_radius)
        recipe = SectorRecipe(
            flank=0.028 * module,
            strip=0.008 * module,
            strip_length=0.16 * module,
            active_start=start,
            back=0.16 * module,
            root=0.12 * module,
            body=0.6 * module,
            bore=min(2.0 * math.pi * gear.held_radius / BORE_EDGES, RIM_SHARE * rim),
        )
        recipe = recipe.scaled(coarsen)
        made.append(replace(recipe, flank=flank_coarsen * recipe.flank, strip=flank_coarsen * recipe.strip))
    return made[0], made[1]
