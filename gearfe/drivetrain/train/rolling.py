r"""Speeds of all shafts of a train as one rational linear system, and the torques that react on what holds it.

With signed numbers of teeth (negative: an internal gear) a mesh of the gears 1 and 2 whose axes a carrier c carries is
the relation of Willis,

.. math:: z_1(\omega_1 - \omega_c) + z_2(\omega_2 - \omega_c) = 0 ,

with :math:`\omega_c = 0` where both axes are fixed. A coupling is :math:`\omega_1 = \omega_2`. The drive and every
guided shaft (:math:`\omega = r\,\omega_d`, r = 0: fixed) are *holders* h. Elimination in fractions, with the speeds of
the holders as symbols, gives :math:`\omega_i = \sum_h S_{ih}\,\omega_h`. By virtual work a torque T on shaft i needs
the torque :math:`-S_{ih}\,T` of holder h.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

from ...base.errors import InputError
from .layout import TrainLayout

#: Coefficients by number: of shafts on the left, of holders on the right.
Terms = dict[int, Fraction]


@dataclass(frozen=True)
class Rolling:
    """Speeds of a train that rolls.

    Attributes
    ----------
    ratios
        Speed of each shaft for unit speed of the drive.
    holders
        Numbers of the shafts whose speeds are prescribed: that of the drive, then the guided ones.
    influence
        For each shaft its speed for unit speed of each holder, the others at rest.
    """

    ratios: tuple[Fraction, ...]
    holders: tuple[int, ...]
    influence: tuple[tuple[Fraction, ...], ...]

    def reactions(self, shaft: int) -> tuple[Fraction, ...]:
        """Torque of each holder that balances a unit torque on a shaft."""
        return tuple(-influence for influence in self.influence[shaft])


class _Equation(NamedTuple):
    """``sum left_i omega_i = sum right_h omega_h``, and what messages call it."""

    label: str
    left: Terms
    right: Terms
    second: int  # the shaft that a contradiction names


def rolling(layout: TrainLayout) -> Rolling:
    """Speeds of all shafts.

    Raises
    ------
    InputError
        For shafts that neither drive nor mesh hold, and for loops of gears whose ratios contradict each other. Also for
        planetary stages with more members held than needed.
    """
    given = [Fraction(1), *(ratio for _, ratio in layout.guided)]
    solved: dict[int, tuple[Terms, Terms]] = {}  # pivot -> the other shafts and the holders that its speed follows from
    for equation in _equations(layout):
        left, right = dict(equation.left), dict(equation.right)
        for shaft in [shaft for shaft in left if shaft in solved]:
            factor = left.pop(shaft)
            _add(left, solved[shaft][0], factor)
            _add(right, solved[shaft][1], -factor)
        if not left:
            if sum((value * given[holder] for holder, value in right.items()), Fraction(0)):
                raise _contradiction(layout, equation)
            continue
        pivot = next(iter(left))
        scale = left.pop(pivot)
        follows = {i: -x / scale for i, x in left.items()}, {h: x / scale for h, x in right.items()}
        for others, holders in solved.values():
            if pivot in others:
                factor = others.pop(pivot)
                _add(others, follows[0], factor)
                _add(holders, follows[1], factor)
        solved[pivot] = follows
    for number, name in enumerate(layout.shafts):
        if number not in solved or solved[number][0]:
            raise _open(layout, number, name)
    influence = tuple(
        tuple(solved[number][1].get(holder, Fraction(0)) for holder in range(len(given)))
        for number in range(len(layout.shafts))
    )
    ratios = tuple(sum((s * g for s, g in zip(row, given, strict=True)), Fraction(0)) for row in influence)
    return Rolling(ratios, (layout.driven, *(shaft for shaft, _ in layout.guided)), influence)


def _add(terms: Terms, more: Terms, factor: Fraction) -> None:
    """Add a multiple of other terms; those that vanish are left out."""
    for key, value in more.items():
        total = terms.get(key, Fraction(0)) + factor * value
        if total:
            terms[key] = total
        else:
            terms.pop(key, None)


def _equations(layout: TrainLayout) -> Iterator[_Equation]:
    """The drive, the meshes, the couplings, and the guided shafts, whose contradictions are their own."""
    one = Fraction(1)
    yield _Equation("drive", {layout.driven: one}, {0: one}, layout.driven)
    for mesh in layout.meshes:
        left: Terms = {}
        for gear in (mesh.driver, mesh.driven):
            _add(left, {gear.shaft: one}, Fraction(gear.teeth))
            if mesh.carrier is not None:
                _add(left, {mesh.carrier: one}, Fraction(-gear.teeth))
        yield _Equation(f"mesh {mesh.name!r}", left, {}, mesh.driven.shaft)
    for i, j in layout.couplings:
        yield _Equation(f"coupling of {layout.shafts[i]!r} and {layout.shafts[j]!r}", {i: one, j: -one}, {}, j)
    for holder, (shaft, _) in enumerate(layout.guided, start=1):
        yield _Equation(f"shaft {layout.shafts[shaft]!r}", {shaft: one}, {holder: one}, shaft)


def _contradiction(layout: TrainLayout, equation: _Equation) -> InputError:
    """A mesh or a coupling that closes a loop that cannot turn, or a guided shaft that holds the train once more."""
    name = layout.shafts[equation.second]
    ratios = [ratio for shaft, ratio in layout.guided if shaft == equation.second]
    if equation.label == f"shaft {name!r}" and ratios:
        what = "is fixed" if ratios[0] == 0 else f"is guided at {ratios[0]} times the speed of the drive"
        problem = f"{what}, but the drive and the members that are held already give it another speed"
        cure = "leave its speed_ratio out: a planetary stage turns with two of its members held or driven"
        return InputError(f"{equation.label} speed_ratio", float(ratios[0]), problem, cure)
    problem = f"closes a loop that cannot turn: shaft {name!r} would need two speeds"
    cure = "take a gear or a coupling out of the loop, or change its teeth"
    return InputError(equation.label, None, problem, cure)


def _open(layout: TrainLayout, number: int, name: str) -> InputError:
    """A shaft whose speed does not follow."""
    planets = {shaft for carrier in layout.carriers for planets in carrier.sets for shaft, _ in planets}
    carried = {carrier.shaft for carrier in layout.carriers} | planets
    carried |= {gear.shaft for mesh in layout.meshes if mesh.carrier is not None for gear in (mesh.driver, mesh.driven)}
    if number in carried:
        problem = "turns freely: the drive and what holds its planetary stage leave its speed open"
        cure = (
            "fix one more member of the stage (speed_ratio = 0), guide it (speed_ratio), or couple it to another shaft"
        )
        return InputError(f"shaft {name!r}", None, problem, cure)
    problem = "is held by nothing: neither the drive nor a mesh connects it to the train"
    cure = "add a mesh between its gears and the train's, or a coupling to a shaft on its axis"
    return InputError(f"shaft {name!r}", None, problem, cure)
