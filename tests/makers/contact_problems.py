"""Contact problems of blocks, rings and Hertz' bodies, held and loaded by boundaries."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from gearfe.base.typing import Array, IntArray
from gearfe.fem.plane import Material
from gearfe.gears.contact.flank import edge_shapes, gauss_rule
from gearfe.gears.contact.laws import ElementLaw
from gearfe.gears.contact.whole_gears.bodies import Bodies, ElasticBody
from gearfe.gears.contact.whole_gears.contact_state import contact_at
from gearfe.gears.contact.whole_gears.newton import ContactSolution, solve_contact
from gearfe.gears.contact.whole_gears.problem import ContactProblem, Surface
from tests.makers.structured import block

#: A prescribed displacement (m) or traction (Pa): a number, or a function of places, shape (n, 2), with values (n,).
Value = float | Callable[[Array], Array]


def chain(body: ElasticBody, name: str) -> IntArray:
    """Return the edges of a boundary as one open chain with the material on its right, shape (k, 3)."""
    edges = np.asarray(body.boundaries[name], dtype=np.int64)
    assert (edges[:-1, 2] == edges[1:, 0]).all()
    assert edges[0, 0] != edges[-1, 2]
    # counter-clockwise triangles have the material on the left of their edges
    element, side = np.argwhere(body.triangles[:, 3:] == edges[0, 1])[0]
    return edges[::-1, ::-1] if body.triangles[element, side] == edges[0, 0] else edges


def contact_problem(
    bodies: Bodies,
    facing: tuple[tuple[tuple[int, str], tuple[int, str]], ...],
    law: ElementLaw,
    *,
    prescribed: Mapping[tuple[int, str], tuple[Value | None, Value | None]],
    tractions: Mapping[tuple[int, str], tuple[Value, Value]] | None = None,
    **options: Any,
) -> ContactProblem:
    """Return the contact problem of undeformed bodies.

    Parameters
    ----------
    facing
        Couples of boundaries, each (number of the body, name).
    law
        Contact law; its side ``pinion`` is the first of each couple.
    prescribed
        Displacements (m) by (body, boundary); None leaves a component free.
    tractions
        Tractions (Pa) by (body, boundary), in global axes.
    options
        `points_per_edge`, `quadrature`, `kinematics` of `ContactProblem`.
    """

    def surface(part: int, name: str) -> Surface:
        edges = bodies.node_of[part][chain(bodies.parts[part], name)]
        return Surface(part, edges, np.arange(len(edges)))

    held: dict[int, float] = {}
    for edges, _, axis, value in _by_component(bodies, prescribed):
        nodes = np.unique(edges)
        at = np.broadcast_to(value(bodies.mesh.doflocs.T[nodes]) if callable(value) else value, len(nodes))
        held.update(zip(bodies.unknowns[nodes, axis].tolist(), at.tolist(), strict=True))
    loads = np.zeros(bodies.unknowns.size)
    xi, weight = gauss_rule(6)
    shapes, slopes, _ = edge_shapes(xi)
    for edges, part, axis, value in _by_component(bodies, tractions or {}):
        corners = bodies.mesh.doflocs.T[edges]
        where = shapes @ corners
        traction = value(where.reshape(-1, 2)).reshape(where.shape[:2]) if callable(value) else value
        load = part.thickness * traction * weight * np.linalg.norm(slopes @ corners, axis=-1)
        np.add.at(loads, bodies.unknowns[edges, axis], load @ shapes)
    couples = tuple((surface(*first), surface(*second)) for first, second in facing)
    width = min(part.thickness for part in bodies.parts)
    fixed, values = np.array(list(held), dtype=np.int64), np.array(list(held.values()))
    return ContactProblem(bodies, bodies.mesh, couples, law, width, fixed, values, loads, **options)


def solved(problem: ContactProblem, *, closing: float, tolerance: float = 1e-10) -> ContactSolution:
    """Solve a contact problem from undeformed bodies; gaps below `closing` (m) count as closed in the first step."""
    start = contact_at(problem, np.zeros(problem.unknowns.size), closing)
    return solve_contact(problem, start, tolerance=tolerance)


def _by_component(
    bodies: Bodies, given: Mapping[tuple[int, str], Any]
) -> Iterator[tuple[IntArray, ElasticBody, int, Value]]:
    for (part, name), components in given.items():
        edges = bodies.node_of[part][bodies.parts[part].boundaries[name]]
        yield from ((edges, bodies.parts[part], k, value) for k, value in enumerate(components) if value is not None)


SOFT, HARD = Material(70e9, 0.30), Material(210e9, 0.25)


HEIGHTS = (0.6, 0.5)  # of the upper and the lower block (m)


def two_blocks(law: ElementLaw, quadrature: str, *, load: dict, kinematics: str = "small") -> ContactProblem:
    """4 x 2 cells of the soft material on 3 x 2 of the hard one: middles and ends of the edges nowhere coincide."""
    upper = block((0, 1), (0, HEIGHTS[0]), 4, 2, SOFT)
    lower = block((0, 1), (-HEIGHTS[1], 0), 3, 2, HARD)
    walls = {(part, side): (0.0, None) for part in (0, 1) for side in ("left", "right")}
    held = walls | {(1, "bottom"): (None, 0.0)} | load.get("prescribed", {})
    return contact_problem(
        Bodies((upper, lower)),
        (((0, "bottom"), (1, "top")),),
        law,
        prescribed=held,
        tractions=load.get("tractions"),
        quadrature=quadrature,
        kinematics=kinematics,
    )


PRESSURE = 50e6


PRESS = {"tractions": {(0, "top"): (0.0, -PRESSURE)}}
