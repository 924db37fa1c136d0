"""A mechanism file becomes a rigid system with names."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import InputError, given, unknown_name
from ..base.expressions import CONSTANTS, Node, compute, parse, quantities
from ..base.tables.kinds import FORCES, JOINTS
from ..base.tables.mechanism import FigureTable, MechanismFile, read_mechanism_file
from ..base.typing import Array
from ..multibody import GROUND, Forced, Linkage, Start, System, consistent_start
from ..multibody.core.mass_regularisation import free_motions
from .links import FlexibleLink, bent_start, flexible_links, link_of
from .loads import OF_SPAN, ExpressionLoad
from .parts import Links, body_of, known_until, part_of
from .plates import PlateLink, part_of_plate, plate_links
from .quantities import NAMED, OF_BODY, OF_JOINT, OF_LINK, OF_PLATE, OF_POINT, OF_SECTION, PLAIN, quantity_names
from .tables import read_table

Point = tuple[float, float]


@dataclass(frozen=True)
class Mechanism:
    """A planar mechanism with its named points, outputs and run.

    Parameters
    ----------
    file : MechanismFile
        The tables as read.
    system : System
        One linkage, a beam or an elastic body for each flexible link, and the frames of those bodies.
    outputs : dict
        Column name -> parsed expression.
    links, plates : dict
        Flexible links by name: beams, and plane finite elements.
    """

    file: MechanismFile
    system: System
    outputs: Mapping[str, Node] = field(repr=False)
    path: Path = Path()
    links: Mapping[str, FlexibleLink] = field(default_factory=dict, repr=False)
    plates: Mapping[str, PlateLink] = field(default_factory=dict, repr=False)
    known_until: float = math.inf  # end of the tables that are functions of time (s)
    unbent: bool = False  # made for the start of one with flexible links: nothing in it need be free to move

    def __repr__(self) -> str:
        tables = {name: ", ".join(getattr(self.file, name)) for name in ("bodies", "joints", "forces")}
        kept = "\n".join(f"  {name}: {listed}" for name, listed in tables.items() if listed)
        return f"Mechanism of {self.system.size} coordinates, {self.system.rows} constraints\n{kept}"

    @property
    def linkage(self) -> Linkage:
        """Bodies, joints and forces: the first element of the system."""
        element = self.system.elements[0]
        assert isinstance(element, Linkage)
        return element

    @property
    def elastic(self) -> dict[str, FlexibleLink | PlateLink]:
        """All flexible links."""
        return {**self.links, **self.plates}

    @property
    def tolerance(self) -> float:
        """Tolerance of the run: asked for, or 1e-9, with flexible links 1e-5."""
        tolerance = self.file.run.tolerance
        return tolerance if tolerance is not None else (1e-5 if self.elastic else 1e-9)

    def point(self, where: str, label: str = "point") -> tuple[int, Point]:
        """Body number and coordinates relative to the mass centre of ``body.point``, ``body.centre`` or ``body``."""
        body, _, name = where.partition(".")
        index = self.linkage.body_index
        if body not in self.file.bodies and body != GROUND:
            raise unknown_name(label, body, [*self.file.bodies, GROUND])
        if body in self.links:
            link = self.links[body]
            node = link.node(name, label)
            return index[link.beam.link.node_names[node]], (0.0, link.points[name][1] if name in link.points else 0.0)
        if body in self.plates:
            node_name, place = self.plates[body].at(name, label)
            return index[node_name], place
        at = (0.0, 0.0) if name in ("", "origin") else None
        centre = self.linkage.assembly.centre[index[body]]
        if name == "centre":
            return index[body], (0.0, 0.0)
        if at is None:
            points = self.file.ground.points_m if body == GROUND else self.file.bodies[body].all_points
            if name not in points:
                raise unknown_name(f"{label}: points of {body}", name, [*points, "origin", "centre"])
            at = points[name]
        return index[body], (at[0] - centre[0], at[1] - centre[1])

    def values(
        self, needed: set[tuple[str, str | None]], q: Any, v: Any = None, a: Any = None, sections: Any = None
    ) -> Any:
        """Return quantities of bodies, joints, points and flexible links for n states.

        Parameters
        ----------
        needed : set of (str, str or None)
            Quantities by name and argument; those of the whole mechanism (`PLAIN`) are skipped.
        q : ndarray, shape (n, size)
            Coordinates (m, rad).
        v, a : ndarray, shape (n, size), optional
            Their first and second rates, for quantities that need them.
        sections : mapping, optional
            Stresses of flexible links by name, as in `Results.sections`; computed from the states by default.

        Returns
        -------
        values : dict
            (name, argument) -> ndarray, shape (n,), in SI units; reactions of joints are not among them.

        Raises
        ------
        InputError
            For unknown names, and for quantities that a link does not have.
        """
        values = {}
        for kind, what in needed:
            if kind in PLAIN:
                continue
            where = given(what, f"expression {kind}")
            if kind in OF_SECTION or kind in OF_LINK:
                values[kind, what] = self._of_link(kind, where, q, v, sections)
            elif kind in OF_JOINT:  # which follow from the multipliers, not from a state alone
                if where not in self.file.joints:
                    raise unknown_name(f"expression {kind}({where}): joints", where, self.file.joints)
            elif kind in OF_POINT:
                x, y = self._point_values(kind, where, q, v, a)
                values[kind, what] = x if kind.endswith("x") else y
            else:
                source = {"angle": q, "rate": v, "angular_acceleration": a}[kind]
                values[kind, what] = self._angle(where, source)
        return values

    def _angle(self, what: str, source: Array) -> Array:
        total = np.zeros(len(source))
        for body, sign in self.angle_of(what, "expression"):
            total = total + sign * source[:, 3 * body + 2]
        return total

    def angle_of(self, what: str, label: str) -> list[tuple[int, float]]:
        """Moving bodies, with signs, whose angles add up to that of a body, a point's section, or a joint."""
        ground = len(self.linkage.bodies)
        if what in self.file.joints:
            joint = self.file.joints[what]
            pair = [(joint.body, 1.0), (joint.to, -1.0)]
        elif what.partition(".")[0] in (*self.file.bodies, GROUND):
            pair = [(what, 1.0)]
        else:
            raise unknown_name(label, what, [*self.file.bodies, GROUND, *self.file.joints])
        bodies = [(self.point(body, label)[0], sign) for body, sign in pair]
        return [(body, sign) for body, sign in bodies if body != ground]

    def _of_link(self, kind: str, what: str, q: Any, v: Any, sections: Any) -> Any:
        name, _, point = what.partition(".")
        if name not in self.elastic and name in self.file.bodies and self.file.bodies[name].shape is not None:
            problem = f"link {name!r} is taken as rigid (flexible = false)"
            raise InputError(f"expression {kind}({what})", None, problem, "take it as flexible, or leave this out")
        if name not in self.elastic:
            raise unknown_name(f"expression {kind}({what}): flexible links", name, self.elastic)
        if kind == "elastic_energy":
            return self.elastic[name].elastic_energy(q)
        if name in self.plates:
            return self._of_plate(kind, what, q, v, sections)
        if kind in OF_PLATE:
            problem = f"link {name!r} is a beam"
            raise InputError(f"expression {kind}({what})", None, problem, f"use largest_edge_stress({name})")
        link = self.links[name]
        node = link.node(point, "expression")
        if kind in ("stretch", "deflection"):
            return link.offsets(q)[:, node, ("stretch", "deflection").index(kind)]
        if sections is None:
            stress = np.array([link.beam.stress(*state) for state in zip(q, v, strict=True)])
            sections = {name: link.beam.at_nodes(stress)}
        if kind == "largest_edge_stress":
            return link.edge_stress(sections[name], f"expression {kind}({what})").max(axis=1)
        forces = sections[name][:, node]
        if kind == "edge_stress":
            return link.edge_stress(forces, f"expression {kind}({what})")
        return forces[:, ("axial_force", "shear_force", "bending_moment").index(kind)]

    def _of_plate(self, kind: str, what: str, q: Any, v: Any, sections: Any) -> Any:
        name, _, point = what.partition(".")
        link = self.plates[name]
        if kind in ("stretch", "deflection"):
            offset = link.offset(q, point, "expression")
            return offset.real if kind == "stretch" else offset.imag
        if kind not in OF_PLATE:
            cure = f"use largest_von_mises({name}), or the reactions of its joints"
            raise InputError(f"expression {kind}({what})", None, f"link {name!r} is no beam", cure)
        stresses = link.stresses(q, v) if sections is None else sections[name]
        return link.largest_von_mises(stresses)

    def _point_values(self, kind: str, where: str, q: Any, v: Any, a: Any) -> tuple[Array, Array]:
        body, (lx, ly) = self.point(where, "expression")
        if body == len(self.linkage.bodies):
            zero = np.zeros(len(q))
            return (zero + lx, zero + ly) if kind in ("x", "y") else (zero, zero)
        k = 3 * body
        c, s = np.cos(q[:, k + 2]), np.sin(q[:, k + 2])
        rx, ry = c * lx - s * ly, s * lx + c * ly
        if kind in ("x", "y"):
            return q[:, k] + rx, q[:, k + 1] + ry
        w = v[:, k + 2]
        if kind in ("vx", "vy"):
            return v[:, k] - w * ry, v[:, k + 1] + w * rx
        d = a[:, k + 2]
        return a[:, k] - d * ry - w * w * rx, a[:, k + 1] + d * rx - w * w * ry

    def start(self, time: float = 0.0) -> Start:
        """Consistent start state with the forced values of the file.

        Raises
        ------
        InputError
            When a loop cannot close, forced values contradict the joints, or nothing is free to move.
        """
        if self.elastic:
            return self._bent_start(time)
        positions = [self._forced(text, target, 0) for text, target in self.file.start.positions.items()]
        velocities = [self._forced(text, target, 1) for text, target in self.file.start.velocities.items()]
        made = consistent_start(self.system, time, positions=positions, velocities=velocities)
        if self.unbent:
            return made
        self._check_loads(made)
        if made.freedoms.net <= 0 and not self.linkage.driven:
            count = f"{made.freedoms.coordinates} coordinates, {made.freedoms.constraints} constraints"
            freeing = " or ".join(map(repr, self._freeing(made)))
            without = f", without {freeing} something would be" if freeing else ""
            problem = f"nothing is free to move ({count}){without}"
            raise InputError("joints", None, problem, "remove a joint, or prescribe a motion")
        return made

    def _freeing(self, start: Start) -> list[str]:
        """Joints without which something could move: of those, the ones that hold least."""
        owner = np.array(self.linkage.assembly.row_joint)
        G = self.system.jacobian(start.time, start.q) * self.system.units / self.system.row_units[:, None]
        names = list(self.file.joints)
        joints = [j for j in range(len(names)) if free_motions(G[owner != j]).shape[1]]
        least = min(((owner == j).sum() for j in joints), default=0)
        return [names[j] for j in joints if (owner == j).sum() == least]

    def with_rigid_links(self) -> Mechanism:
        """The same joints between the same bodies, none of which bends, without forces; it need not be free to move."""
        bodies = {n: replace(b, flexible=False) if b.shape is not None else b for n, b in self.file.bodies.items()}
        file = replace(self.file, bodies=bodies, forces={}, outputs=(), figure=FigureTable())
        return replace(make_mechanism(file, self.path), unbent=True)

    def _bent_start(self, time: float) -> Start:
        """Flexible links start straight, with the velocities of the same mechanism with rigid ones."""
        rigid = self.with_rigid_links()
        known = rigid.start(time)
        q, v = bent_start(self.elastic, self.system, rigid.linkage, np.stack([known.q, known.v]))
        projected = consistent_start(self.system, time, q=q, v=v)
        self._check_loads(projected)
        return projected

    def _check_loads(self, start: Start) -> None:
        state = start.time, start.q, start.v
        if not np.isfinite(self.system.force(*state)).all() and (problem := self.system.load_problem(*state)):
            raise InputError("forces", None, f"have no value at the start: {problem}", "correct the expression")

    def _forced(self, text: str, target: float, level: int) -> Forced:
        label = f"start.{('positions', 'velocities')[level]} {text!r}"
        allowed = (("angle", "x", "y"), ("rate", "vx", "vy"))[level]
        node = parse(text, label, quantity_names(allowed, what="a value of the start", constants=self.file.parameters))
        needed = quantities(node)

        def position(q: Array) -> float:
            return float(np.asarray(compute(node, self.values(needed, q[None, :]))).reshape(-1)[0])

        def slope(q: Array) -> Array:
            steps = 1e-6 * np.diag(self.system.units)
            states = np.concatenate([q + steps, q - steps])
            ends = np.broadcast_to(compute(node, self.values(needed, states)), len(states))
            return (ends[: len(q)] - ends[len(q) :]) / (2e-6 * self.system.units)

        def rate_slope(q: Array) -> Array:
            n = len(q)
            states = np.broadcast_to(q, (n + 1, n))
            made = np.broadcast_to(
                compute(node, self.values(needed, states, np.vstack([np.eye(n), np.zeros(n)]))), n + 1
            )
            return made[:n] - made[n]

        here = self.system.start_q
        with np.errstate(all="ignore"):
            known = [position(here), *slope(here)] if level == 0 else rate_slope(here)
        if not np.isfinite(known).all():
            problem = "is not a finite number, or has no finite slope, at the start poses"
            raise InputError(label, None, problem, "force another expression, or give other start poses")
        if level == 0:
            return Forced(text, target, position, slope)
        offset = self._offset(node, needed, label)
        return Forced(text, target - offset, position, rate_slope)

    def _offset(self, node: Node, needed: set[tuple[str, str | None]], label: str) -> float:
        """Return the constant part of a velocity expression; raise for one that is not linear."""
        random = np.random.default_rng(2)
        q = np.broadcast_to(self.system.start_q, (5, self.system.size))
        v = random.standard_normal((5, self.system.size)) * self.system.units
        v[0], v[3], v[4] = 0.0, 2.0 * v[1] - 3.0 * v[2], -v[1]
        at = np.broadcast_to(compute(node, self.values(needed, q, v)), 5)
        part = at - at[0]
        rest = max(abs(part[3] - 2.0 * part[1] + 3.0 * part[2]), abs(part[4] + part[1]))
        if not np.isfinite(at).all() or rest > 1e-9 * float(np.abs(at).max()):
            raise InputError(label, None, "is not linear in the velocities", "force a sum of multiples of velocities")
        return float(at[0])


def load_mechanism(path: str | Path) -> Mechanism:
    """Read a mechanism file.

    Raises
    ------
    InputError
        If the file has a mistake; the message names the key and the cure.
    """
    return make_mechanism(read_mechanism_file(path), Path(path))


def make_mechanism(file: MechanismFile, path: Path = Path()) -> Mechanism:
    """Mechanism from its tables."""
    tables = {name: read_table(name, table, path.parent) for name, table in file.tables.items()}
    used = (*quantity_names().functions, *NAMED, *PLAIN, *CONSTANTS)
    for kind, names, others in (("tables", tables, used), ("parameters", file.parameters, (*used, *OF_SPAN, *tables))):
        for name in names:
            if name in others:
                problem = "is the name of a function or a quantity" + (", or of a table" if name in tables else "")
                raise InputError(kind, name, problem, "rename it")
    parts = {n: part_of_plate(n, table, path.parent) for n, table in file.bodies.items() if table.plate is not None}
    links = {n: link_of(file, n, table) for n, table in file.bodies.items() if table.bends and table.beam is not None}
    plates = {n: part for n, part in parts.items() if file.bodies[n].bends}
    held: Links = {**links, **plates}
    bodies = [
        b for n, t in file.bodies.items() for b in (held[n].nodes() if n in held else (body_of(file, n, t, parts),))
    ]
    if not bodies:
        raise InputError("bodies", None, "there is none", "add a table [bodies.NAME]")
    joints = tuple(
        part_of(file, held, tables, f"joints.{n}", n, table, JOINTS[table.type]) for n, table in file.joints.items()
    )
    forces = tuple(
        part_of(file, held, tables, f"forces.{n}", n, table, FORCES[table.type]) for n, table in file.forces.items()
    )
    planar = Linkage(tuple(bodies), joints, forces)
    flexible = flexible_links(file, planar, links)
    elastic = plate_links(file.bodies, planar, plates)
    bending = [link.beam for link in flexible.values()], [link.element for link in elastic.values()]
    system = System([planar, *bending[0], *bending[1], *(link.joint for link in elastic.values())])
    outputs: dict[str, Node] = {}
    mechanism = Mechanism(file, system, outputs, path, flexible, elastic, known_until(file, tables))
    system.start_rule = mechanism.start  # so that `integrate(mechanism.system, times)` starts as the file says
    for _, load in planar.assembly.state_loads:
        if isinstance(load, ExpressionLoad):
            load.bind(mechanism)
    zero = np.zeros((1, system.size))
    has_links = any(body.shape is not None for body in file.bodies.values())  # those taken as rigid say so themselves
    of_links = (*OF_SECTION, *OF_LINK) if has_links else ()
    known = quantity_names((*PLAIN, *OF_BODY, *OF_POINT, *OF_JOINT, *of_links), tables, "an output", file.parameters)
    for i, output in enumerate(file.outputs):
        if output.name in outputs or output.name == "time_s":
            raise InputError(f"outputs[{i}].name", output.name, "is used twice", "rename the column")
        node = parse(output.value, f"outputs[{i}].value", known)
        try:
            mechanism.values(quantities(node), zero, zero, zero)  # names exist
        except InputError as error:
            place = error.field.removeprefix("expression").strip()
            problem = f"{place}: {error.problem}" if place else error.problem
            raise InputError(f"outputs[{i}].value", output.value, problem, error.cure) from None
        outputs[output.name] = node
    for path_table in file.paths:
        if isinstance(path_table.point, str):
            mechanism.point(f"{path_table.body}.{path_table.point}", "paths")
    for name in (*file.figure.curves, *file.figure.reference_columns):
        if name not in outputs:
            raise unknown_name("figure", name, outputs)
    return mechanism
