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
    "completion": "completion",
}

#: A line for the end of each command's help.
EXAMPLES: dict[str, str] = {
    "stiffness": "gearfe stiffness pair.toml --torque-Nm 100 --fields 5 --set pair.pinion.teeth=21",
    "loadmap": "gearfe loadmap pair.toml --torques-Nm 20 50 100 200 --root-stress",
    "microgeometry": "gearfe microgeometry geometry/microgeometry.toml --out out/micro",
    "relief": "gearfe relief geometry/microgeometry.toml --out out/relief",
    "gear": "gearfe gear pair.toml --angle-deg 5",
    "mesh": "gearfe mesh pair.toml --out gears.msh",
    "mechanism": "gearfe mechanism geometry/andrews.toml --out out/andrews --animation",
    "housing": "gearfe housing meshes/box.toml --out out/box",
    "vibration": "gearfe vibration geometry/gear_train.toml --report --format mat",
    "runup": "gearfe runup geometry/gear_train.toml --out out/runup",
    "study": "gearfe study geometry/relief_study.toml --jobs 2",
    "new": "gearfe new vibration gearbox.toml",
    "cache": "gearfe cache",
    "completion": "gearfe completion bash > ~/.local/share/bash-completion/completions/gearfe",
}
