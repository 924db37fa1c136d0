# mypy: ignore-errors
"""Run by the system's Python with GetFEM: one contact position of two gears; no import of gearfe here.

Usage: python3 getfem_script.py task.npz answer.json
"""

import json
import sys
import time

import getfem as gf
import numpy as np

#: First Piola-Kirchhoff stress of the Saint Venant-Kirchhoff material, tested with the gradient.
STRAIN = "(Grad_u+Grad_u'+Grad_u'*Grad_u)"
INTERNAL = f"((Grad_u+Id(2))*(lam*Trace({STRAIN}/2)*Id(2)+mu*{STRAIN})):Grad_Test_u"


def main():
    """Read the task, solve, write torque and seconds."""
    task = np.load(sys.argv[1])
    begin, ticks = time.perf_counter(), time.process_time()
    centre, twist, width = (float(task[n]) for n in ("centre", "twist", "width"))
    young, poisson = float(task["youngs_modulus"]), float(task["poisson"])
    lame = [young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))]
    gf.util_trace_level(0)
    model = gf.Model("real")
    model.add_initialized_data("law", lame)
    bodies = [Body(task, name) for name in ("pinion", "wheel")]
    for body in bodies:
        model.add_fem_variable(body.variable, body.fem)
        model.add_finite_strain_elasticity_brick(body.rule, "SaintVenant Kirchhoff", body.variable, "law")
    pinion, wheel = bodies
    model.add_Dirichlet_condition_with_simplification(pinion.variable, 1)
    c, s = np.cos(twist) - 1.0, np.sin(twist)
    x, y = wheel.places[0] - centre, wheel.places[1]
    turned = np.empty(2 * x.size)
    turned[0::2], turned[1::2] = c * x - s * y, s * x + c * y
    model.add_initialized_fem_data("turned", wheel.fem, turned)
    model.add_Dirichlet_condition_with_simplification(wheel.variable, 1, "turned")
    contact(model, pinion, wheel, young)
    model.set_variable(wheel.variable, turned)  # start from the rigidly turned wheel: only the overlap is left
    done = model.solve(
        "max_res", 1e-8, "max_iter", 25, "noisy", "lsolver", "mumps", "lsearch", "simplest", "alpha min", 0.8
    )
    print("iterations", done)
    torque = width * wheel.torque(model.variable(wheel.variable), lame, centre)
    answer = {
        "torque": torque,
        "cpu_s": time.process_time() - ticks,
        "wall_s": time.perf_counter() - begin,
        "unknowns": int(sum(body.fem.nbdof() for body in bodies)),
    }
    with open(sys.argv[2], "w") as stream:
        json.dump(answer, stream)


class Body:
    """Mesh of curved second-order triangles with regions 1 (bore) and 2 (contact), displacements, integration."""

    def __init__(self, task, name):
        points, triangles = task[f"{name}_points"], task[f"{name}_triangles"]
        self.variable = f"u_{name}"
        self.mesh = gf.Mesh("empty", 2)
        order = [0, 3, 1, 5, 4, 2]  # GetFEM numbers the nodes of a second-order triangle row by row
        self.mesh.add_convex(
            gf.GeoTrans("GT_PK(2,2)"), np.ascontiguousarray(points[triangles[:, order]].transpose(2, 1, 0))
        )
        for number, region in enumerate(("bore", "contact"), start=1):
            nodes = np.unique(task[f"{name}_{region}"])
            found = self.mesh.pid_from_coords(np.ascontiguousarray(points[nodes].T), 1e-9)
            self.mesh.set_region(number, self.mesh.faces_from_pid(found))
        self.fem = gf.MeshFem(self.mesh, 2)
        self.fem.set_fem(gf.Fem("FEM_PK(2,2)"))
        self.rule = gf.MeshIm(self.mesh, gf.Integ("IM_TRIANGLE(6)"))
        self.places = self.fem.basic_dof_nodes()[:, 0::2]

    def torque(self, u, lame, centre):
        """Moment of the bore's reactions about the centre, per width, where the twist has brought the bore."""
        internal = gf.asm(
            "generic", self.rule, 1, INTERNAL, -1,
            "u", 1, self.fem, u, "lam", 0, [lame[0]], "mu", 0, [lame[1]],
        )  # fmt: skip
        bore = np.unique(np.asarray(self.fem.basic_dof_on_region(1)) // 2)
        x = self.places[0, bore] + u[2 * bore] - centre
        y = self.places[1, bore] + u[2 * bore + 1]
        return float(np.sum(x * internal[2 * bore + 1] - y * internal[2 * bore]))


def contact(model, slave, master, young):
    """Large sliding contact, multipliers on the slave's flanks, augmented Lagrangian, raytracing."""
    model.add_initialized_data("r", [young / 1e-3])
    brick = model.add_integral_large_sliding_contact_brick_raytracing("r", 2e-4)
    pressure = gf.MeshFem(slave.mesh, 2)
    pressure.set_fem(gf.Fem("FEM_PK(2,1)"))
    model.add_filtered_fem_variable("pressure", pressure, 2)
    model.add_slave_contact_boundary_to_large_sliding_contact_brick(brick, slave.rule, 2, slave.variable, "pressure")
    model.add_master_contact_boundary_to_large_sliding_contact_brick(brick, master.rule, 2, master.variable)


if __name__ == "__main__":
    main()
