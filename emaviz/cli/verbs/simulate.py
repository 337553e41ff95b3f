"""`emaviz simulate`: one run of a model, written as a recording."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

from ema_model.errors import InputError
from emaviz.cli import options
from emaviz.cli.options import FINITE

if TYPE_CHECKING:
    import numpy as np

    from ema_model.actuator import Actuator
    from ema_model.recordings import Measurement
    from emaviz.cli.output import SimulatedJson

HELP = "simulate one run of the reference or the monitor model and write it as a recording"
PLACE = 2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of INTERFACES: model, actuator, command, faults, effects, sensors, files."""
    parser.add_argument("--model", choices=("rm", "mm"), default="rm", help="reference or monitor model")
    parser.add_argument("--circuit", choices=("reduced", "thesis"), default="reduced", help="of the monitor model")
    parser.add_argument(
        "--input",
        type=options.RECORDING,
        metavar="RUN.csv",
        help="open loop: a recording whose current, torque, force, voltage or duty is put in, in place of a command",
    )
    options.add_actuator(parser)
    options.add_run(parser)
    options.add_mapping(parser)
    options.add_faults(parser)
    options.add_effects(parser)
    parser.add_argument("--sample-rate", type=FINITE, default=10_000.0, metavar="Hz")
    parser.add_argument(
        "--out", required=True, type=options.MEASUREMENT, metavar="FILE.csv|.parquet", help="the recording to write"
    )
    options.add_record(parser, "it as well")
    options.add_json(parser)
    options.add_force(parser)


def documents() -> tuple[type, ...]:
    """What --json holds."""
    from emaviz.cli.output import SimulatedJson

    return (SimulatedJson,)


def run(arguments: argparse.Namespace) -> int:
    """Simulates, records with the sensors' accuracy, writes."""
    import numpy as np

    from ema_model.actuator.actuator import readings
    from ema_model.recordings import write_measurement
    from ema_model.recordings.measurement import Sensors
    from emaviz.cli import flow, output

    actuator = flow.actuator_of(arguments)
    k, effects = flow.faults_of(arguments, actuator.faults), flow.effects_of(arguments, actuator.axes)
    sensors = Sensors(arguments.noise_current, arguments.encoder_bits)
    try:
        signals = _simulated(arguments, actuator, k, effects)
    except FloatingPointError as error:
        raise InputError(str(error)) from None
    signals = sensors.record(signals, arguments.seed)
    signals = replace(signals, signals=actuator.axes.outside(signals.signals))  # a linear axis has names of its own
    write_measurement(signals, arguments.out)
    if arguments.record:
        _record(arguments, signals, k)
    summary: SimulatedJson = {
        "file": str(arguments.out),
        "samples": signals.samples,
        "k": k.tolist(),
        "physical": readings(k, actuator),
        "effects": effects,
        "rms": {name: float(np.sqrt(np.mean(signals[name] ** 2))) for name in signals.signals if name != "time_s"},
    }
    output.write_json(arguments, summary)
    rate = 1.0 / signals.sample_period_s
    print(f"{arguments.out}: {signals.samples} samples, {signals.duration_s:g} s at {rate:g} Hz")
    return 0


def _simulated(
    arguments: argparse.Namespace, actuator: Actuator, k: np.ndarray, effects: dict[str, dict[str, float]]
) -> Measurement:
    from emaviz.cli import flow

    if arguments.input:
        from ema_model.models.open_loop import simulate_open_loop

        return simulate_open_loop(flow.input_of(arguments, actuator), actuator, k, effects)
    asked = flow.run_of(arguments, actuator, arguments.sample_rate)
    from ema_model.simulation.run import simulate_monitor, simulate_reference

    if arguments.model == "rm":
        return simulate_reference(asked, actuator, k, effects)
    return simulate_monitor(asked, actuator, k, effects, arguments.circuit)


def _record(arguments: argparse.Namespace, signals: Measurement, k: np.ndarray) -> None:
    from emaviz.recording import RecordingError, RecordingWriter  # rerun takes a second to import

    group = "reference" if arguments.model == "rm" and not arguments.input else "monitor"
    try:
        with RecordingWriter(arguments.record) as writer:
            writer.signals(group, signals.time_s, {n: v for n, v in signals.signals.items() if n != "time_s"})
            writer.truth(k)
    except RecordingError as error:
        raise InputError(str(error)) from None
    if writer.failed:
        raise InputError(writer.failed)
