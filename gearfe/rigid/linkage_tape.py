"""A planar linkage on a tape: its rows, springs and loads, also those by expression."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from ..typing import Array, IntArray

if TYPE_CHECKING:
    from .linkage import Linkage
    from .tape import Tape


class Affine(NamedTuple):
    """A form of the variables of a tape."""

    terms: dict[int, float]
    constant: float


class BodyVariables:
    """Variables x, y, theta, cos theta, sin theta of the bodies of a linkage; the ground's are constants.

    Parameters
    ----------
    tape : Tape
        On which they are.
    places : ndarray of int, shape (3n,)
        Numbers of the coordinates.
    """

    def __init__(self, tape: Tape, places: IntArray) -> None:
        self.tape, self.places = tape, [int(p) for p in places]

    def affine(self, body: int, factors: Array | tuple[float, ...], into: Affine | None = None) -> Affine:
        """kx x + ky y + kt theta + kc cos theta + ks sin theta, added to another one."""
        terms, constant = (dict(into.terms), into.constant) if into is not None else ({}, 0.0)
        if 3 * body >= len(self.places):
            return Affine(terms, constant + float(factors[3]))
        own = self.places[3 * body : 3 * body + 3]
        turning = self.tape.turn(own[2]) if factors[3] or factors[4] else ()
        for variable, factor in zip((*own, *turning), factors, strict=False):
            if factor:
                terms[variable] = terms.get(variable, 0.0) + float(factor)
        return Affine(terms, constant)

    def point(
        self, body: int, weight: float, x: float, y: float, into: tuple[Affine, Affine] | None = None
    ) -> tuple[Affine, Affine]:
        """Components of ``weight (x, y) + R(theta) (x, y)``, added to others."""
        one, two = into if into is not None else (None, None)
        across = self.affine(body, (weight, 0.0, 0.0, x, -y), one)
        return across, self.affine(body, (0.0, weight, 0.0, y, x), two)


def write_linkage(linkage: Linkage, tape: Tape, places: IntArray) -> bool:
    """The linkage on the tape; False for loads that cannot be written."""
    tables, bodies = linkage.assembly.tables, BodyVariables(tape, places)
    forms, vectors, functions = tables.forms, tables.vectors, linkage.assembly.functions

    def form(r: int) -> Affine:
        made = Affine({}, float(forms.constant[r]))
        for side in range(2):
            made = bodies.affine(int(forms.bodies[r, side]), forms.factor[r, side], made)
        return made

    def vector(k: int) -> tuple[Affine, Affine]:
        (one, two), ((w, x, y), (v, a, b)) = vectors.bodies[k].tolist(), vectors.end[k].tolist()
        return bodies.point(two, v, a, b, bodies.point(one, w, x, y))

    profiles = {r: (int(forms.bodies[r, k]), p) for r, k, p in linkage.assembly.profiles}
    for r in range(linkage.rows):
        held, products = form(r), []
        terms, constant = dict(held.terms), held.constant
        for _, one, two in forms.product[forms.product[:, 0] == r]:
            for u, v in zip(vector(int(one)), vector(int(two)), strict=True):
                products += [(i, j, f * g) for i, f in u.terms.items() for j, g in v.terms.items()]
                for a, b in ((u, v), (v, u)):
                    for i, f in a.terms.items():
                        terms[i] = terms.get(i, 0.0) + f * b.constant
                constant += u.constant * v.constant
        if r in profiles:
            body, profile = profiles[r]
            terms[profile.write(tape, bodies.places[3 * body + 2])] = -1.0
        motion = functions[forms.motion[r]] if forms.motion[r] >= 0 else None
        tape.row(terms, products, constant, motion, float(forms.unit[r]))
    tape.constant[places] += tables.forces.weight[: linkage.size]
    laws = dict(linkage.assembly.tension_laws)
    for k, (stiffness, damping, free) in enumerate(tables.forces.spring):
        x, y = vector(k)
        span = [tape.linear(*x), tape.linear(*y)]
        pull = tape.number(stiffness)  # tension over length
        if free != 0.0 or damping != 0.0 or k in laws:
            square = tape.sum(tape.mul(span[0], span[0]), tape.mul(span[1], span[1]))
            inverse = tape.power(square, -0.5)
            if free != 0.0:
                pull = tape.sum(inverse, f=-stiffness * free, c=stiffness)
            if damping != 0.0 or k in laws:
                speed = [tape.rate(x.terms), tape.rate(y.terms)]
                flow = tape.sum(tape.mul(span[0], speed[0]), tape.mul(span[1], speed[1]))
                pull = tape.sum(pull, tape.div(flow, square), g=damping)
            if k in laws:
                own = laws[k].write(tape, tape.mul(square, inverse), tape.mul(flow, inverse))
                if own is None:
                    return False
                pull = tape.sum(pull, tape.mul(own, inverse))
        for part, along in zip(span, (x, y), strict=True):
            opposite = {i: -f for i, f in along.terms.items()}
            tape.push(tape.mul(pull, part), opposite, told=k not in laws)
    loads = dict(linkage.assembly.state_loads)
    for k, (stiffness, damping) in enumerate(tables.forces.along):
        r = linkage.rows + k
        along = form(r)
        if stiffness != 0.0 or damping != 0.0:
            pull = tape.sum(tape.linear(*along), tape.rate(along.terms), f=-stiffness, g=-damping)
            tape.push(pull, along.terms, told=True)
        if k in loads:
            load = loads[k].write(bodies)
            if load is None:
                return False
            tape.push(load, along.terms)
        elif forms.motion[r] >= 0:
            tape.push(tape.function(functions[forms.motion[r]]), along.terms, told=True)
    return True
