r"""The constant part of Nitsche's law with theta = 1 or -1: what it takes off the bodies' stiffness."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..contact.flank import edge_shapes
from .bodies import point_basis
from .laws import side_share
from .segments import whole_edges

if TYPE_CHECKING:
    from .problem import ContactProblem


def stress_term(problem: ContactProblem) -> Any:
    r"""int (theta/gamma) sigma_n(u) sigma_n(v) over the contact surfaces of the law's sides, sparse (N/m)."""
    from skfem import BilinearForm

    from .constitution import SmallStrain

    mesh, law = problem.mesh, problem.law
    stress = SmallStrain(None).normal_stress
    form = BilinearForm(lambda u, v, w: w.factor * stress(u, w) * stress(v, w))
    total: Any = 0
    skins = problem.skins
    if skins is None:
        skins = tuple((s.part, side, s.edges) for couple in problem.facing for side, s in enumerate(couple))
    for part, side, edges in skins:
        share = side_share(law, side)
        if share == 0:
            continue
        data = problem.edge_data(part, edges)
        edge, xi, weight = whole_edges(len(edges), problem.points_per_edge)
        local = data["start"][:, edge] + xi * (data["end"] - data["start"])[:, edge]
        slope = np.einsum("qa,qai->iq", edge_shapes(xi)[1], mesh.doflocs.T[edges[edge]])
        length = np.linalg.norm(slope, axis=0)
        normal = np.stack([-slope[1], slope[0]]) / length
        basis = point_basis(mesh, data["element"][edge], local, share * problem.width * length * weight)
        numbers = {name: data[name][edge][:, None] for name in ("lam", "mu")}
        factor = (law.theta / data["parameter"][edge])[:, None]
        total = total + form.assemble(basis, slave_normal=normal[:, :, None], factor=factor, **numbers)
    return total
