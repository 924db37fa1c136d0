"""Quantities of a mechanism that expressions may name: of bodies, points, flexible links and the whole mechanism."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..base.expressions import Names, Table

#: Quantities of a body or joint, and of a point.
OF_BODY = ("angle", "rate", "angular_acceleration")
OF_POINT = ("x", "y", "vx", "vy", "ax", "ay")
#: Quantities of a point of a flexible link, of one of finite elements, and of a flexible link.
OF_SECTION = ("deflection", "stretch", "axial_force", "shear_force", "bending_moment", "edge_stress")
OF_PLATE = ("largest_von_mises",)
OF_LINK = ("elastic_energy", "largest_edge_stress", *OF_PLATE)
#: Force (N) and moment (N m) of a joint on its body, at the joint's point, along the axes of the ground.
OF_JOINT = ("reaction_x", "reaction_y", "reaction_moment")
#: Quantities of something -> what it must be.
NAMED = {
    **dict.fromkeys(OF_BODY, "a body or joint"),
    **dict.fromkeys((*OF_POINT, *OF_SECTION), "a point such as rod.B"),
    **dict.fromkeys(OF_LINK, "a flexible link"),
    **dict.fromkeys(OF_JOINT, "a joint"),
}
#: Quantities of the whole mechanism.
PLAIN = ("time", "kinetic", "potential", "work", "total")


def quantity_names(
    allowed: Sequence[str] = (*PLAIN, *NAMED),
    tables: Mapping[str, Table] | None = None,
    what: str = "an expression",
    constants: Mapping[str, float] | None = None,
) -> Names:
    """Names that an expression about a mechanism may use.

    Parameters
    ----------
    allowed : sequence of str
        Quantities; those without an argument extend `PLAIN`.
    tables : mapping, optional
        Functions of one number by name.
    what : str
        The expression in messages.
    constants : mapping, optional
        Parameters of the file.
    """
    plain = tuple(name for name in allowed if name not in NAMED)
    of = {name: NAMED[name] for name in allowed if name in NAMED}
    others = tuple(name for name in (*PLAIN, *NAMED) if name not in allowed)
    return Names(plain, of, tables or {}, what, others, constants or {})
