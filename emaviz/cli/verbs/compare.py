"""`emaviz compare`: recordings beside the model, and where it fails."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

from ema_model.errors import InputError
from emaviz.cli import options

if TYPE_CHECKING:
    from ema_model.recordings import Measurement
    from emaviz.cli import flow, output

HELP = "show where the model fails beside recordings"
PLACE = 4


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of INTERFACES, with the signals to fit."""
    options.add_recordings(parser, "compared", declared=options.UNITS)
    options.add_units(parser)
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
    options.add_open_loop(parser)
    options.add_seed(parser)


def documents() -> tuple[type, ...]:
    """What --json holds: of recordings, and of units beside each other."""
    from ema_model.comparison.result import Comparison
    from ema_model.fleet.result import UnitsCompared
    from ema_model.result import json_type

    return (json_type(Comparison), json_type(UnitsCompared))


def run(arguments: argparse.Namespace) -> int:
    """Compares, and of units what they differ in."""
    if arguments.save_actuator and not arguments.calibrate:
        raise InputError("--save-actuator writes what the calibration found; leave --no-calibrate out")
    from emaviz.cli import flow

    actuator = flow.actuator_of(arguments)
    if arguments.by or arguments.unit:
        return flow.run_by_unit(arguments, actuator)
    k, weights = flow.faults_of(arguments, actuator.faults), flow.weights_of(arguments.signals)
    effects = flow.effects_of(arguments, actuator.axes)
    to_fit = flow.effects_to_fit(arguments) if arguments.calibrate else []

    def compute(fitted: list[Measurement], held: list[Measurement], progress: output.Progress) -> flow.Answer:
        from ema_model.comparison import compare  # takes a second: recordings are refused before

        model, fixed, free = actuator, effects, arguments.free
        if to_fit:
            from ema_model.discovery.history import with_fitted_effects

            fixed = {name: settings for name, settings in effects.items() if name not in to_fit}
            beside = replace(actuator, effects={**actuator.effects, **fixed})
            model = with_fitted_effects(fitted, beside, to_fit, progress.show)
        if free is not None:
            free = [*free, *(path for path in model.tolerances if path.split(".")[1] in to_fit)]
        result = compare(
            fitted,
            model,
            k=k,
            effects=fixed,
            calibrate=arguments.calibrate,
            free=free,
            signals=weights,
            holdout=held,
            on_progress=progress.show,
        )

        found = result.calibration.actuator if result.calibration is not None else None
        return flow.of_result(result, found)

    return flow.run(arguments, actuator, compute)
