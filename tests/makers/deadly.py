"""A study whose case 13 kills the process that solves it: python -m tests.makers.deadly STUDY.toml prints the rows.

The program has meshed before, as drivers of gears' studies have: gmsh must leave it able to outlive broken pipes.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from gearfe.fem.meshing.session import gmsh_session
from gearfe.study.case import Task
from gearfe.study.job import read_study
from gearfe.study.run import side_by_side


@dataclass(frozen=True)
class Deadly(Task):
    """A base job that kills the process that solves case 13."""

    def tables(self, values: Sequence[Any]) -> dict[str, Any]:
        """Tables of a case, or the end."""
        if values[0] == 13.0:
            os._exit(1)
        return super().tables(values)


if __name__ == "__main__":
    from .deadly import Deadly as Known  # the class by the name that workers find it under

    with gmsh_session():
        pass
    study = read_study(sys.argv[1])
    task = Known(**{**vars(study.task), "names": ("bodies.a.position_m.0",)})
    cases = [(n, (float(n),)) for n in range(20)]
    rows = [row for group in side_by_side(task, cases, 2) for row in group]
    print(json.dumps([(row.case, row.status, row.outputs[0]) for row in rows]))
