"""From the tables of a job file to a pair solved with its deviations."""

from __future__ import annotations

from ..contact.half_plane import half_plane_pair
from ..contact.half_plane_step import HalfPlanePair
from ..gear.deviation import ToothDeviations
from ..gear.deviation_job import deviations_of
from ..loadmap.root_stress import PairRoots, pair_roots
from ..progress import Stopwatch
from ..stiffness.job import Keep, StiffnessJob
from ..tables.microgeometry import MicrogeometryTable
from ..threads import one_thread
from .loaded_mesh import LoadedMesh
from .solve import load_mesh

Deviations = tuple[ToothDeviations, ToothDeviations]


def condensed(
    job: StiffnessJob, *, root_stress: bool, watch: Stopwatch, keep: Keep | None = None
) -> tuple[HalfPlanePair, PairRoots | None]:
    """Both gears of a job for the half-plane law, and the meshes of their roots; see `StiffnessJob.elastic`."""
    elastic = job.elastic(keep, watch, law="half_plane")
    law = half_plane_pair(elastic) if keep is None else keep("law", lambda: half_plane_pair(elastic))
    if not root_stress:
        return law, None
    with watch.stage("root meshes"), one_thread():
        return law, pair_roots(elastic) if keep is None else keep("roots", lambda: pair_roots(elastic))


def both_flanks(job: StiffnessJob, table: MicrogeometryTable) -> tuple[Deviations, Deviations]:
    """Deviations of the driving flanks of pinion and wheel, and of their back flanks."""
    other = {"left": "right", "right": "left"}[table.flank]
    driving, back = (deviations_of(table, job.pair, job.folder, flank=flank) for flank in (table.flank, other))
    return driving, back


def solved(
    job: StiffnessJob,
    table: MicrogeometryTable,
    flanks: tuple[Deviations, Deviations],
    *,
    watch: Stopwatch,
    keep: Keep | None = None,
) -> LoadedMesh:
    """The pair of a job with the deviations of `both_flanks` at the torques of [microgeometry]."""
    law, roots = condensed(job, root_stress=table.root_stress, watch=watch, keep=keep)
    driving, back = flanks
    with watch.stage("positions"):
        return load_mesh(
            law.deviated(driving),
            table.torques(),
            positions=table.positions,
            mesh_cycles=table.mesh_cycles,
            roots=roots,
            back=back,
        )
