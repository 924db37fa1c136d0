"""``gearfe vibration JOB.toml --out DIR``: a gear train in its housing, from stiffness curve to spectrum."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..base.shown import percent
from ..base.tables.spectrum import SpectrumTable
from ..base.tables.train import TrainTable, value_text
from .arguments import add_folder, add_job, add_keys, print_results, with_keys

if TYPE_CHECKING:
    from ..drivetrain.train.gear_train import GearTrain
    from ..drivetrain.train.response import TrainResponse
    from ..drivetrain.vibration.files import OutputChoice, Written

#: Keys of [train] that options stand for, and of [spectrum]: option -> key.
KEYS = ("tolerance", "method")
RECORD = {key: key for key in ("window", "spectrum_from_ms", "spectrum_ms")}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_train(parser, "job file with the table [train]", TrainTable, *KEYS)
    add_keys(parser, SpectrumTable, **RECORD)
    parser.add_argument(
        "--band", nargs=2, type=float, metavar=("LOW", "HIGH"), help="frequencies of the pictures' spectra (Hz)"
    )
    parser.add_argument(
        "--range", type=float, metavar="X", help="end of the colours in the picture of --fields (m/s2; default: chosen)"
    )
    parser.add_argument("--no-floquet", action="store_true", help="leave out the stability analysis")
    parser.add_argument("--no-estimate", action="store_true", help="leave out the error estimates")
    parser.add_argument(
        "--fields", action="store_true", help="write housing and gears over time (VTKHDF), a picture and an animation"
    )
    parser.add_argument(
        "--deflection-Hz", nargs="+", type=float, metavar="F", default=(), dest="deflections",
        help="operating deflection shapes: how gears and housing move at the lines of the spectrum nearest to these "
        "frequencies (VTKHDF series)",
    )  # fmt: skip
    parser.add_argument("--picture-ms", type=float, metavar="T", help="time of the fields' picture (ms; default: 4.55)")
    parser.add_argument("--no-animation", action="store_true", help="leave out the animation of --fields")


def add_train(parser: argparse.ArgumentParser, help_: str, table: type, *keys: str, attachment: bool = True) -> None:
    """Add the options of a train's job: file, folder, variant, curves, keys of its table, attachment.

    Parameters
    ----------
    parser : ArgumentParser
        Parser of the command; changed.
    help_ : str
        Help of the job file.
    table : type
        Class of the table whose keys are options.
    *keys : str
        These keys.
    attachment : bool
        Whether pictures are of an attachment.
    """
    add_job(parser, "job", help_)
    add_folder(parser)
    parser.add_argument("--variant", metavar="NAME", help="a variant of the job file")
    parser.add_argument(
        "--curve", nargs="+", metavar="FILE", default=(), help="stiffness curves (CSV): one, or one per mesh"
    )
    add_keys(parser, table, *keys)
    if attachment:
        help_ = "attachment in the pictures (default: that of the load)"
        parser.add_argument("--attachment", metavar="NAME", help=help_)


def run(args: argparse.Namespace) -> int:
    """Compute and write; 1 when the run ended early or a picture could not be drawn."""
    started = time.perf_counter()
    from ..base.config import check_range
    from ..base.errors import InputError
    from ..base.tables.jobs import read_train_tables

    # mistakes in the file show before NumPy, SciPy and the finite elements load
    tables = read_train_tables(args.job, args.variant)
    tables["train"] = with_keys(args, tables["train"], *KEYS)
    tables["spectrum"] = with_keys(args, tables.get("spectrum", SpectrumTable()), **RECORD)
    if args.range is not None:
        check_range(args.range, "--range", {"above": 0.0, "doc": "end of the colours (m/s2)"})
    if args.band is not None and not 0.0 <= args.band[0] < args.band[1]:
        raise InputError("--band", args.band, "must be two rising frequencies >= 0", "as --band 200 4000")

    from ..base.files import output_folder
    from ..base.progress import Stopwatch
    from ..drivetrain.gearbox.job import train_job
    from ..drivetrain.vibration.analysis import Analysis, record_start
    from ..drivetrain.vibration.files import OutputChoice, check_choice, write_run
    from ..drivetrain.vibration.run import simulated

    watch = Stopwatch({"program start": time.perf_counter() - started}, started)
    with watch.stage("reading"):
        job = train_job(args.job, tables)
        choice = OutputChoice(
            fields=args.fields,
            animation=not args.no_animation,
            attachment=args.attachment,
            picture_time=None if args.picture_ms is None else 1e-3 * args.picture_ms,
            window=job.spectrum.window,
            spectrum_start=job.spectrum.start or 0.0,
            spectrum_length=job.spectrum.duration,
            deflections=tuple(args.deflections),
        )
        bores = tuple(str(a) for s in job.table.shafts for a in s.attachments)
        check_choice(choice, job.times, bores)
        folder = output_folder(args.out)
    planned = simulated(job, args.curve, watch=watch, estimate=not args.no_estimate)
    if not args.no_floquet:
        from ..drivetrain.runup.train_stability import train_stability

        with watch.stage("stability of the steady motion"):
            planned = replace(planned, stability=train_stability(planned.model))
    train, every = planned.model.train, planned.every
    start = record_start(job, train, every, watch.stage)
    choice = replace(choice, spectrum_start=start)
    check_choice(choice, job.times, bores)
    draw = None
    if not args.no_pictures:
        from ..figures.train import TrainPictures

        draw = TrainPictures(title(job.table), args.band and tuple(args.band), args.range)
    written = write_run(
        folder,
        planned,
        choice,
        watch=watch,
        draw=draw,
        beside=Analysis(job, train, every, start),
    )
    response = written.response
    print_results(
        report_lines(response, train, written, choice),
        folder,
        written.names,
        watch.seconds,
        (*written.summary["warnings"], *written.problems),
    )
    return 0 if response.status == "done" and not written.problems else 1


def title(table: TrainTable, *, driven: bool = True) -> str:
    """Line above the pictures, with the drive's speed or without."""
    parts = [f"{len(table.shafts)} shafts, {len(table.meshes)} gear mesh{'es' * (len(table.meshes) != 1)}"]
    if driven and table.drive is not None:
        parts.append("drive " + value_text(table.drive.speed_rad_per_s, "rad/s"))
    parts += [f"load {value_text(x.torque_Nm, 'N m')} on {x.shaft}".replace("-", "−", 1) for x in table.loads[:1]]
    if table.variant:
        parts.append(f"variant {table.variant}")
    return ", ".join(parts)


def report_lines(response: TrainResponse, train: GearTrain, written: Written, choice: OutputChoice) -> list[str]:
    """Return the lines that a run prints.

    Parameters
    ----------
    response : TrainResponse
        The motion at the end.
    train : GearTrain
        The train.
    written : Written
        Summary and files of the run.
    choice : OutputChoice
        What was asked for.
    """
    from ..drivetrain.gearbox.bearing_report import bearing_lines
    from ..drivetrain.gearbox.inherited import inherited_lines
    from ..drivetrain.gearbox.shaft_report import shaft_lines
    from ..drivetrain.gearbox.stage_report import stage_lines

    summary = written.summary
    lines = [*_mesh_lines(response, train, summary), *_contact_lines(response.mesh_names, summary)]
    lines += [*inherited_lines(summary.get("inherited", {})), *shaft_lines(summary), *stage_lines(summary)]
    lines += bearing_lines(summary.get("bearings", {}))
    if response.common_period_s:
        count = summary.get("mean_over_common_periods", 0)
        short = (
            "over what the run has after the ramp, at least its last step: it is shorter than the ramp and one period"
        )
        means = f"over the last {count} of them" if count else short
        lines.append(f"common period of the meshes {1e3 * response.common_period_s:.4g} ms; means are {means}")
    frequencies = enumerate(response.coupled_frequencies_Hz[:10])
    shown = ", ".join(f"{f:.0f}{_error(summary, 'coupled_frequencies_Hz', i)}" for i, f in frequencies)
    more = f"{shown} Hz ..." if shown else "none, nothing is left to vibrate"
    lines.append(f"natural frequencies of the coupled system: {more}")
    statistics = response.statistics
    lines.append(
        f"transient: {response.status}, {1e3 * response.time_reached:.4g} ms in {statistics.get('steps', '?')} steps "
        f"({statistics.get('method', '')}: {statistics.get('scheme', '')}), {statistics.get('seconds', 0.0):.3f} s; "
        f"{statistics.get('free_coordinates', '?')} unknowns"
    )
    floquet = summary["floquet"]
    if floquet["largest_multiplier"] is not None:
        lines.append(f"largest Floquet multiplier over the common period: {floquet['largest_multiplier']:.6g}")
    elif floquet["note"]:
        lines.append(f"Floquet multipliers: {floquet['note']}")
    for name, value in response.estimates.items():
        lines.append(f"error estimate, {name}: " + (f"{value:.2g}" if math.isfinite(value) else "unknown"))
    for shape in summary.get("deflections", ()):
        line = f"deflection shape at {shape['frequency_Hz']:.6g} Hz, the line nearest to {shape['asked_Hz']:.6g} Hz"
        lines.append(f"{line}, enlarged {shape['enlarged_by']:.4g} times")
    return lines if written.spectra is None else [*lines, *_spectrum_lines(response, train, written, choice)]


def _error(summary: Mapping[str, Any], name: str, number: int) -> str:
    """Error of one entry of a number of the summary, where errors were estimated."""
    from ..drivetrain.vibration.errors import with_error

    errors = summary.get("headline_errors", {})
    return with_error(errors[name][number]) if name in errors else ""


def _mesh_lines(response: TrainResponse, train: GearTrain, summary: Mapping[str, Any]) -> list[str]:
    """Frequency, stiffness and mean force of each mesh."""
    lines, mean = [], summary.get("mean_contact_forces_N")
    for i, (name, frequency) in enumerate(zip(response.mesh_names, response.mesh_frequencies_Hz, strict=True)):
        low, high = summary["mesh_stiffness_N_per_m"][name]
        k = "rigid" if low is None else f"k {low / 1e6:.4g} to {high / 1e6:.4g} N/um"
        force = ""
        if mean is not None and math.isfinite(mean[i]):
            force = f", mean contact force {mean[i]:.1f}{_error(summary, 'mean_contact_forces_N', i)} N"
            driver = train.gear(train.meshes[i].driver).gear
            if driver.helical:
                force += f", axial {abs(mean[i]) * math.tan(driver.base_helix_angle):.1f} N"
        lines.append(f"mesh {i + 1} ({name}): {_frequency(train, response, float(frequency))}, {k}{force}")
    return lines


def _contact_lines(names: Sequence[str], summary: Mapping[str, Any]) -> list[str]:
    """Of each mesh which flanks bear and when they part; friction."""
    lines, contact, friction = [], summary.get("contact", {}), summary.get("friction", {})
    for i, share in enumerate(contact.get("share_without_contact", ())):
        if share is not None:
            lost, factor = contact["contacts_lost"][i], contact["dynamic_factors"][i]
            parts = (
                f"no contact in {percent(share, 3)} of the time, contacts lost: {lost}" if lost else "always in contact"
            )
            most = "" if factor is None else f"; largest force {factor:.3g} times the steady one"
            lines.append(f"mesh {i + 1} ({names[i]}): {contact['flanks'][i]}; {parts}{most}")
    for i, coefficient in enumerate(friction.get("coefficients", ())):
        if coefficient > 0.0:
            share = friction["efficiency"][i]
            efficiency = "" if share is None else f", efficiency {percent(share, 4)}"
            loss = f"loss {friction['mean_loss_W'][i]:.4g} W{efficiency}"
            lines.append(f"mesh {i + 1} ({names[i]}): friction {coefficient:.4g}, {loss}")
    return lines


def _spectrum_lines(response: TrainResponse, train: GearTrain, written: Written, choice: OutputChoice) -> list[str]:
    """Resolution, the largest lines at the attachment of the pictures, radiated power."""
    from ..base.errors import given
    from ..drivetrain.gearbox.report import attachment_to_draw
    from ..drivetrain.vibration.errors import with_error
    from ..drivetrain.vibration.report import line_texts

    made, summary = given(written.spectra, "spectra"), written.summary
    lines = [
        f"spectrum: resolution {made.spectrum.resolution:.4g} Hz, up to {made.spectrum.frequency[-1]:.6g} Hz, "
        f"from samples every {1e6 * made.step / made.every:.3g} us"
    ]
    attachment = attachment_to_draw(response.attachment_names, choice.attachment, train)
    found = summary["dominant_lines"][f"attachment_{attachment}_acceleration_m_per_s2"][:4]
    lines += [f"normal acceleration at attachment {attachment} (m/s2): {line_texts(found)}"] if found else []
    if made.power is not None:
        part = summary.get("headline_errors", {}).get("radiated_power_mean_W")
        decibels = None if part is None else 10.0 * math.log10(1.0 + float(part) / max(made.power.mean, 1e-300))
        weighted = summary["radiated_power"]["a_weighted_level_dBA"]
        lines.append(
            f"radiated power: mean {made.power.mean_level:.1f}{with_error(decibels)} dB re 1e-12 W, "
            f"A-weighted up to {made.spectrum.frequency[-1]:.6g} Hz {weighted:.1f} dB(A)"
        )
    return lines


def _frequency(train: GearTrain, response: TrainResponse, frequency: float) -> str:
    """A mesh frequency; that of the first and the last moment where the speed never rests."""
    speed = train.driven.speed
    nominal = float(speed(max(speed.breaks, default=0.0)))
    if speed.ends or nominal == 0.0:
        return f"{frequency:.1f} Hz"
    first, last = (frequency * abs(float(speed(t)) / nominal) for t in (0.0, response.time_reached))
    return f"{first:.1f} to {last:.1f} Hz"
