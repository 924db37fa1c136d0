"""Lines and modules of the package: what serves capabilities that came later, by capability, and the rest.

A module counts to a capability when it serves that alone (patterns below, first match); what the capability added to
modules that existed is not taken off, so the rest is an upper bound. Empty lines, comments and docstrings count.

    python scripts/measure_size.py [-v]      # -v: the modules of each
"""

from __future__ import annotations

import sys
from collections import defaultdict
from fnmatch import fnmatch
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "gearfe"
#: Capability -> its modules.
CAPABILITIES = {
    "microgeometry, deviations, relief": """
        gear/deviation* gear/modifications.py gear/pitch_errors.py
        */microgeometry.py figures/flanks.py
    """,
    "mesh law, contact loss, friction": """
        meshlaw/* train/friction.py train/parting.py train/statics.py train/phases.py
        train/corners.py train/program.py
    """,
    "run-up, steady states": "runup/* */runup.py figures/campbell.py",
    "flexible links, couplings, loads, analyses of mechanisms": """
        rigid/beam* rigid/couplings.py rigid/turning.py
        rigid/equilibrium.py rigid/inverse.py rigid/modes.py rigid/collocation.py
        rigid/*tape* rigid/quadratic.py rigid/written.py rigid/corners.py
        mechanisms/link* mechanisms/loads.py mechanisms/rest.py mechanisms/sensitivity.py mechanisms/solve.py
        mechanisms/tables.py tables/beam.py
        mechanisms/plate* meshing/plate_mesh.py tables/plate.py rigid/floating.py rigid/kernel_elastic.py
        rigid/kernel_collocation.py rigid/kernel_equations.py rigid/kernel_matrices.py rigid/kernel_stages.py
        rigid/numpy_equations.py rigid/lanes.py rigid/lanes_type.py
    """,
    "extruded housing meshes, compiled kernels kept": """
        prisms.py housing/prism_error.py housing/meshes.py rigid/packed* rigid/parts.py rigid/native.py
        meshing/housing_recipe.py housing/body.py
    """,
    "own housings, exchange, reports, analyses of records": """
        housing/own_mesh.py housing/nastran_files.py housing/superelement.py housing/dmig.py housing/modal_*.py
        housing/bisection.py housing/refinement.py meshing/nastran.py meshing/mesh_file.py
        meshing/deck.py meshing/gear_solid.py gear/outline.py output/formats.py
        output/report_page.py output/dxf.py shown.py figures/results.py
        */short_time.py commands/completion.py vibration/analysis.py
        vibration/measured.py vibration/timefunctions.py tables/spectrum.py tables/timefunction.py
    """,
    "studies": "study/* */study.py",
}


def main(verbose: bool = False) -> int:
    """Print the table."""
    found: dict[str, dict[str, int]] = defaultdict(dict)
    for path in sorted(PACKAGE.rglob("*.py")):
        name = path.relative_to(PACKAGE).as_posix()
        served = (
            key for key, patterns in CAPABILITIES.items() if any(fnmatch(name, pattern) for pattern in patterns.split())
        )
        found[next(served, "")][name] = path.read_text(encoding="utf-8").count("\n")
    print("| what | lines | modules |\n|---|---|---|")
    for key in (*CAPABILITIES, ""):
        print(f"| {key or 'the rest'} | {sum(found[key].values()):,} | {len(found[key])} |")
        if verbose:
            print(*(f"    {lines:5d}  {name}" for name, lines in found[key].items()), sep="\n")
    everything = [lines for modules in found.values() for lines in modules.values()]
    print(f"| all | {sum(everything):,} | {len(everything)} |")
    return 0


if __name__ == "__main__":
    raise SystemExit(main("-v" in sys.argv))
