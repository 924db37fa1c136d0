"""Commands of the ``gearfe`` program, one module each.

A command module provides ``HELP`` (one line), ``add_arguments(parser)`` and ``run(args) -> int`` (0 done, 1 done but
some part failed and is marked as such in the output, 2 is kept for bad input). It imports what it needs inside ``run``.
"""

#: Command -> module below ``gearfe.commands``; imported only when that command runs or its help is asked.
COMMANDS: dict[str, str] = {
    "stiffness": "stiffness",
    "loadmap": "loadmap",
    "microgeometry": "microgeometry",
    "relief": "relief",
    "gear": "gear",
    "mesh": "mesh",
    "mechanism": "mechanism",
    "housing": "housing",
    "vibration": "vibration",
    "runup": "runup",
    "study": "study",
    "new": "new",
    "cache": "cache",
}
