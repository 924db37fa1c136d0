"""Commands of the ``gearfe`` program, one module each, of the command's name.

A command module provides ``add_arguments(parser)`` and ``run(args) -> int``. It returns 0 if done, and 1 if some part
failed, which the output marks. 2 is kept for bad input. It imports what it needs inside ``run``, and is itself imported
only when that command runs or prints its help.
"""

#: Command -> what it does in one line, and an example for the end of its help (`gearfe new` writes the job files).
COMMANDS: dict[str, tuple[str, str]] = {
    "stiffness": (
        "mesh stiffness of a gear pair over its rotation: table, picture, summary, fields",
        "gearfe stiffness pair.toml --torque-Nm 100 --fields 5 --set pair.pinion.bore_diameter_mm=30",
    ),
    "loadmap": (
        "stiffness, transmission error, orders, load share, pressure, root stress over angle and torque; with reliefs, "
        "pitch errors, measured flanks",
        "gearfe loadmap pair.toml --torques-Nm 20 50 100 200 --root-stress",
    ),
    "gear": (
        "geometry of a gear pair or gearbox, and a drawing of it in mesh",
        "gearfe gear pair.toml --angle-deg 5 --export dxf,step",
    ),
    "rating": (
        "load capacity by ISO 6336: safety factors of flanks and roots with every value and its formula",
        "gearfe rating pair.toml --torque-driver-Nm 200 --speed-rpm 1500",
    ),
    "mesh": (
        "meshes of a gear pair with named boundaries, as .msh, .vtu or .inp, or a CalculiX deck of its contact",
        "gearfe mesh pair.toml --teeth 3 --out gears.msh",
    ),
    "mechanism": (
        "planar mechanism: motion, reactions, equilibrium, vibration modes",
        "gearfe mechanism mechanism.toml --reactions --animation",
    ),
    "housing": (
        "reduce a housing to a small elastic body: mass, bores, frequencies, mode shapes",
        "gearfe housing housing.toml --modes 40",
    ),
    "vibration": (
        "gear train in its housing: contact forces, speeds, vibration, spectrum, radiated power",
        "gearfe vibration gearbox.toml --report --format mat",
    ),
    "modes": (
        "natural modes of a gear train over its speed: whirl, Campbell diagram, critical speeds",
        "gearfe modes gearbox.toml --speed-stop-rad-per-s 1200 --fields",
    ),
    "runup": (
        "gear train over its speed: steady states on all branches, waterfall, orders, critical speeds",
        "gearfe runup gearbox.toml --speeds 100",
    ),
    "compare": (
        "comparison of two or three runs: curves, spectra, differences with their errors",
        "gearfe compare out/pair/stiffness out/other/stiffness",
    ),
    "report": (
        "one page of all results of a job, to print or to send: gears, results, errors, pictures",
        'gearfe report gearbox.toml --author "A. Designer"',
    ),
    "study": (
        "one job in many cases: parameters, designs, statistics, sensitivities; continues after an interruption",
        "gearfe study study.toml --jobs 2",
    ),
    "new": (
        "write a commented job file to start from, or a shipped job: gearfe new --list",
        "gearfe new vibration gearbox.toml",
    ),
    "cache": (
        "list or remove cached data: meshes, gears, curves, housings, compiled kernels",
        "gearfe cache",
    ),
    "completion": (
        "print a script for the completion of commands and options: bash, zsh or fish",
        "gearfe completion bash > ~/.local/share/bash-completion/completions/gearfe",
    ),
}
