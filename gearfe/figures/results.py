"""Pictures of results as Python has them, without the job: what `gearfe.base.shown.Shown.plot` gives."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from .style import BLUE, CYCLE, GREY, ORANGE, RED, legend_beside, new_figure, tidy

if TYPE_CHECKING:
    from ..base.spectrum import Spectrum
    from ..base.typing import Array
    from ..drivetrain.train.response import TrainResponse
    from ..fem.reduction.modal_body import ModalBody
    from ..gears.gearmesh.curve import StiffnessCurve
    from ..multibody.core.trajectory import Trajectory

#: Faces of a body that are drawn at most.
MOST_FACES = 30_000


def picture(result: Any) -> Any:
    """The picture of a result, as a matplotlib figure."""
    module, _, function = PICTURES[type(result).__name__].partition(":")
    return getattr(import_module(f".{module}", __package__), function)(result)


def curve_plot(curve: StiffnessCurve) -> Any:
    """Stiffness and transmission error over the pinion angle."""
    figure = new_figure(8.5, 4.8)
    upper, lower = figure.subplots(2, 1, sharex=True)
    angle = np.degrees(curve.pinion_angle)
    upper.plot(angle, 1e-6 * curve.k_mesh, ".-", color=BLUE, linewidth=1.5)
    upper.set_ylabel("mesh stiffness  (N/µm)")
    lower.plot(angle, 1e6 * curve.transmission_error, ".-", color=ORANGE, linewidth=1.5)
    lower.set_ylabel("transmission error  (µm)")
    for axes in (upper, lower):
        tidy(axes)
        for failed in angle[curve.failed]:
            axes.axvline(failed, color=RED, linewidth=0.8)
    lower.set_xlabel("pinion angle  (deg)")
    return figure


def response_plot(response: TrainResponse) -> Any:
    """Contact forces, and accelerations of the attachments, over time."""
    forces = dict(zip(response.mesh_names, 1e-3 * response.contact_force.T, strict=False))
    names = [f"attachment {name}" for name in response.attachment_names]
    accelerations = dict(zip(names, response.attachment_acceleration.T, strict=False))
    panels = {"contact force  (kN)": forces, "acceleration  (m/s²)": accelerations}
    return _lines(1e3 * response.time, "time  (ms)", panels, 5.2)


def trajectory_plot(run: Trajectory) -> Any:
    """Coordinates over time: one panel for each body, or element."""
    panels: dict[str, dict[str, Array]] = {}
    for name, values in zip(run.system.coordinate_names(), run.q.T, strict=True):
        owner = name.rpartition("_")[0].removesuffix("_angle").removesuffix("_x").removesuffix("_y")
        panels.setdefault(owner, {})[name.removeprefix(f"{owner}_")] = values
    return _lines(run.time, "time  (s)", panels, 1.0 + 1.6 * len(panels))


def spectrum_plot(made: Spectrum) -> Any:
    """Amplitudes of all signals over the frequency, as lines."""
    signals = made.amplitude.reshape(len(made.frequency), -1).T
    named = {f"signal {number}": values for number, values in enumerate(signals, start=1)}
    return _lines(1e-3 * made.frequency, "frequency  (kHz)", {"amplitude": named}, 3.6)


def _lines(x: Array, label: str, panels: Mapping[str, Mapping[str, Array]], height: float) -> Any:
    """Panels with a common abscissa one above the other: label of the ordinate -> name of the curve -> values."""
    figure = new_figure(9.0, height)
    rows = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (ordinate, curves) in zip(rows, panels.items(), strict=True):
        tidy(axes)
        for colour, (name, values) in zip(CYCLE, curves.items(), strict=False):
            axes.plot(x, values, color=colour, linewidth=1.2, label=name)
        axes.set_ylabel(ordinate)
        axes.margins(x=0.0)
        if len(curves) > 1 or len(panels) > 1:
            legend_beside(axes)
    rows[-1].set_xlabel(label)
    return figure


def body_plot(body: ModalBody) -> Any:
    """The outer surface with the attachments."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    figure = new_figure(7.5, 6.0)
    axes = figure.add_subplot(projection="3d")
    corners = 1e3 * body.nodes[body.faces[:: max(1, len(body.faces) // MOST_FACES), :3]]
    if len(corners):
        surface = Poly3DCollection(corners, facecolors="#cbd5e1", shade=True, linewidths=0.0, antialiaseds=False)
        axes.add_collection3d(surface)
    places = 1e3 * body.attachment_points
    axes.plot(*places.T, "o", color=RED, zorder=10)
    for name, place in zip(body.attachment_names, places, strict=True):
        axes.text(*place, f"  {name}", color=RED, zorder=11)
    spread = 1e3 * (body.nodes if len(body.nodes) else body.attachment_points)
    low, high = spread.min(axis=0), spread.max(axis=0)
    for set_, a, b in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), low, high, strict=True):
        set_(a, b if b > a else a + 1.0)
    axes.set_box_aspect(np.maximum(high - low, 0.05 * (high - low).max() + 1e-9))
    axes.set(xlabel="x  (mm)", ylabel="y  (mm)", zlabel="z  (mm)")
    axes.tick_params(labelsize=8, colors=GREY)
    return figure


#: Class of a result -> module and function of its picture: names, so that one picture loads no other results.
PICTURES = {
    "GearPair": "gears:pair_picture",
    "LoadMap": "load_map:load_map_picture",
    "ModalBody": "results:body_plot",
    "Rating": "rating:rating_plot",
    "RunUp": "runup:forces_picture",
    "Spectrum": "results:spectrum_plot",
    "StiffnessCurve": "results:curve_plot",
    "StudyResult": "study:study_picture",
    "TrainResponse": "results:response_plot",
    "Trajectory": "results:trajectory_plot",
    "WhirlModes": "campbell:modes_picture",
}
