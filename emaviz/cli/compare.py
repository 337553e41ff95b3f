"""`emaviz compare`: recordings beside the model, and where it fails."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from ema_model.actuator import save_actuator
from ema_model.actuator.naming import on_axes
from ema_model.comparison import Comparison, as_dict, compare
from ema_model.errors import InputError
from ema_model.quantities.numbers import Quantity, number
from ema_model.quantities.shown import of_residual, of_signal
from emaviz.cli import files, options, output
from emaviz.text.comparison import held_out

HELP = "show where the model fails beside recordings"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of INTERFACES, with the signals to fit."""
    parser.add_argument(
        "files", nargs="+", type=files.RECORDING, metavar="FILE", help="recordings of one actuator, compared together"
    )
    options.add_fit(parser, "the comparison")
    parser.add_argument(
        "--calibrate", action=argparse.BooleanOptionalAction, default=True, help="fit the actuator within tolerances"
    )
    parser.add_argument(
        "--free", action="append", metavar="NAME", help="calibrate only these: k1 … k8 or section.name; repeat for more"
    )
    options.add_faults(parser)
    options.add_effects(parser)
    parser.add_argument(
        "--signal",
        action="append",
        dest="signals",
        metavar="NAME[=weight]",
        help="fit only these signals, with a weight (1 is what the noise says); repeat for more",
    )
    options.add_seed(parser)


def run(arguments: argparse.Namespace) -> int:
    """Reads, compares, writes and prints."""
    actuator = options.actuator_of(arguments)
    if arguments.save_actuator and not arguments.calibrate:
        raise InputError("--save-actuator writes what the calibration found; leave --no-calibrate out")
    progress = output.Progress()
    try:
        measurements, held = (
            options.read_all(files, arguments, actuator, progress) for files in (arguments.files, arguments.holdout)
        )
        result = compare(
            measurements,
            actuator,
            k=options.faults_of(arguments, actuator.faults),
            effects=options.effects_of(arguments, actuator.axes),
            calibrate=arguments.calibrate,
            free=arguments.free,
            signals=options.weights_of(arguments.signals),
            holdout=held,
            on_progress=progress.show,
        )
        if arguments.record:
            progress.show("recording")
            _record(result, arguments)
        if arguments.report:
            progress.show("writing the report")
            from emaviz.report import write_report  # plotly takes a second to import

            write_report(result, arguments.report)
    finally:
        progress.done()
    if result.calibration is not None and arguments.save_actuator:
        save_actuator(result.calibration.actuator, arguments.save_actuator)
    output.write_json(arguments.json, as_dict(result), arguments.seed, output.configuration(arguments))
    print(text(result))
    return 0


def _record(result: Comparison, arguments: argparse.Namespace) -> None:
    from emaviz.recording import RecordingError
    from emaviz.recording.comparison import write_comparison

    try:
        write_comparison(result, arguments.record, output.configuration(arguments))
    except RecordingError as error:
        raise InputError(str(error)) from None


def text(result: Comparison) -> str:
    """The answer as the terminal shows it: the sentences, the errors, the explanations, the calibration."""
    axes = result.actuator.axes
    lines = [*result.sentences, *(f"! {warning}" for warning in result.warnings), ""]
    lines.append(f"{'signal':22}{'rms error':>12}{'initially':>12}{'floor':>12}{'mean |e|':>12}")
    for name, error in result.signals.items():
        shown = error.quantity(of_signal(name, axes))
        numbers = (error.rmse, error.rmse_initial, error.noise_floor, error.mean_absolute)
        lines.append(f"{name:22}{_columns(numbers, shown)}  {shown.unit}")
    if len(result.recordings) > 1:
        lines += ["", f"{'recording':34}{'rms error':>12}{'floor':>12}{'mean |e|':>12}  of {result.primary}"]
        for one in result.recordings:
            if result.primary in one.errors:
                error = one.errors[result.primary]
                shown = error.quantity(of_signal(result.primary, axes))
                columns = _columns((error.rmse, error.noise_floor, error.mean_absolute), shown)
                lines.append(f"{one.name[:33]:34}{columns}  {shown.unit}")
    if result.holdout:
        lines += ["", *(held_out(one) for one in result.holdout)]
    if result.explained_by:
        lines += ["", "what explains the residual (share told ahead on parts that were left out)"]
        for one in result.explained_by[:6]:
            modulator = "" if one.modulator == "1" else f" × {one.modulator}"
            mark = "" if one.significant else "   within noise"
            lines.append(f"  {one.variable + modulator:28}{100.0 * one.r2:6.1f} %{mark}")
    if result.orders:
        told = of_residual(result.primary, axes, result.residuals.torque_constant)
        shown = told.scaled(result.orders[0].amplitude)
        found = ", ".join(f"{one.order} ({shown.text(one.amplitude)})" for one in result.orders[:8])
        lines += ["", f"orders per revolution: {found}"]
    if result.calibration is not None and result.calibration.parameters:
        state = "converged" if result.calibration.converged else "NOT converged"
        lines += ["", f"calibration {state}", f"  {'':38}{'value':>12}{'± (90 %)':>12}{'z':>7}"]
        for name, one in result.calibration.parameters.items():
            half = 0.5 * (one.interval90[1] - one.interval90[0])
            bound = "  at its bound" if one.at_bound else ""
            path = on_axes(name, axes).path
            lines.append(f"  {path:38}{one.value:12.5g}{half:12.2g}{one.z:7.2f}  {one.unit}{bound}")
    return "\n".join(lines)


def _columns(values: Sequence[float], shown: Quantity) -> str:
    return "".join(f"{number(shown.factor * value):>12}" for value in values)
