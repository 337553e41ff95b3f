"""`emaviz identify`: k1…k8 of recordings, or of a simulated actuator with known faults."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ema_model.errors import InputError
from ema_model.members import stated, stated_in
from emaviz.cli import options
from emaviz.cli.ending import PartialAnswer
from emaviz.cli.options import whole

if TYPE_CHECKING:
    import numpy as np

    from ema_model.actuator import Actuator
    from ema_model.identification.run import Progress
    from ema_model.identification.search import Objective
    from ema_model.recordings import Measurement
    from emaviz.cli import flow, output

HELP = "find the faults k1 … k8 of recordings, or of a simulated actuator"
PLACE = 3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of INTERFACES, and those of the run that is simulated when no file is given."""
    robust = stated_in("ema_model.identification.run", "ROBUST")
    algorithms = (robust, *stated("ema_model.identification.optimisers", "name").values())
    fitnesses = stated_in("ema_model.simulation.plant", "FITNESSES")
    options.add_recordings(parser, "fitted", nargs="*")
    parser.add_argument(
        "--algorithm", choices=algorithms, default=robust, help="robust, or one of the thesis's as published"
    )
    parser.add_argument(
        "--polish", action="store_true", help="let a least-squares fit follow ssa, hba or do (robust always has it)"
    )
    parser.add_argument("--population", type=whole(2, 100_000), default=50, metavar="N")
    parser.add_argument("--iterations", type=whole(1, 1_000_000), default=150, metavar="N")
    parser.add_argument("--fitness", choices=fitnesses, default="filtered", help="0.5 ms means, or every sample")
    parser.add_argument("--circuit", choices=("reduced", "thesis"), default="reduced", help="of the monitor model")
    options.add_fit(parser, "the identification")
    options.add_faults(parser)
    options.add_effects(parser)
    options.add_run(parser)


def documents() -> tuple[type, ...]:
    """What --json holds: of a whole identification, and of one that was interrupted."""
    from ema_model.identification.run import Identification, IdentifiedSoFar
    from ema_model.result import json_type

    return (json_type(Identification), json_type(IdentifiedSoFar))


def run(arguments: argparse.Namespace) -> int:
    """Identifies; once interrupted, the best so far."""
    from ema_model.actuator.file import check_represents
    from emaviz.cli import flow

    actuator = flow.actuator_of(arguments)
    effects = flow.effects_of(arguments, actuator.axes)
    for name in effects:
        check_represents(actuator, name)
    to_fit = flow.effects_to_fit(arguments) if arguments.files else []
    given_values = {name: settings for name, settings in effects.items() if name not in to_fit}
    actuator = replace(actuator, effects={**actuator.effects, **given_values})
    truth = flow.faults_of(arguments) if arguments.fault or not arguments.files else None

    def read(*of: Any) -> tuple[list[Measurement], list[Measurement]]:
        fitted, held = flow.read_set(*of)
        return fitted or [_simulated(arguments, actuator, truth)], held

    def compute(fitted: list[Measurement], held: list[Measurement], progress: output.Progress) -> flow.Answer:
        return _identified(arguments, actuator, to_fit, truth, fitted, held, progress)

    return flow.run(arguments, actuator, compute, read)


def _identified(
    arguments: argparse.Namespace,
    actuator: Actuator,
    to_fit: list[str],
    truth: np.ndarray | None,
    fitted: list[Measurement],
    held: list[Measurement],
    progress: output.Progress,
) -> flow.Answer:
    # These take a second: recordings are refused before.
    if to_fit:
        from ema_model.discovery.history import with_fitted_effects

        actuator = with_fitted_effects(fitted, actuator, to_fit, progress.show)
    from ema_model.identification.run import SEARCH_SHARE, IdentifiedSoFar, identify
    from ema_model.identification.search import Objective
    from emaviz.cli import flow, output

    def fitness(of: list[Measurement]) -> Objective:
        return Objective(of, actuator, circuit=arguments.circuit, fitness=arguments.fitness)

    objective, unseen = fitness(fitted), fitness(held) if held else None
    recorder = _Recorder(arguments, fitted, objective, truth) if arguments.record else None
    partial = PartialAnswer()
    history: list[Progress] = []

    def on_iteration(at: Progress) -> None:
        history.append(at)
        partial.grows()
        share = SEARCH_SHARE * at.iteration / max(at.iterations, 1)
        progress.show(f"{at.algorithm} {at.iteration}/{at.iterations}  uncorrected error {at.rmse:.4f} A", share)
        if recorder is not None:
            recorder.iteration(at)

    def on_fit(text: str, share: float) -> None:
        progress.show(text, SEARCH_SHARE + (1.0 - SEARCH_SHARE) * share)

    try:
        with partial:
            answer = identify(
                objective,
                arguments.algorithm,
                population=arguments.population,
                iterations=arguments.iterations,
                seed=arguments.seed,
                truth=truth,
                parameters_known=not arguments.files,
                polish=arguments.polish,
                on_iteration=on_iteration,
                on_fit=on_fit,
            )
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt) and history:
            progress.done()
            best = IdentifiedSoFar(actuator, history)
            output.write_json(arguments, best.to_dict())
            print(best)
            output.say_not_written(arguments, "report", "save_actuator")
        if recorder is not None:
            recorder.close()
        raise
    answer = answer.beside(unseen)

    def record(*_: object) -> None:
        if recorder is not None:
            recorder.finish(answer)
            if recorder.failed:
                raise InputError(recorder.failed)

    return replace(flow.of_result(answer, answer.found_actuator), record=record)


def _simulated(arguments: argparse.Namespace, actuator: Actuator, truth: np.ndarray | None) -> Measurement:
    """The run that the options ask for, as the sensors have it."""
    assert truth is not None
    from ema_model.recordings.measurement import Sensors
    from ema_model.simulation.plant import simulated
    from emaviz.cli import flow

    sensors = Sensors(arguments.noise_current, arguments.encoder_bits)
    try:
        clean = simulated(flow.run_of(arguments, actuator), actuator, truth, arguments.fitness)
    except FloatingPointError as error:
        raise InputError(str(error)) from None
    return sensors.record(clean, arguments.seed)


class _Recorder:
    """Writes the identification as it goes; rerun, which takes a second to import, only when asked for."""

    def __init__(
        self,
        arguments: argparse.Namespace,
        measurements: list[Measurement],
        objective: Objective,
        truth: np.ndarray | None,
    ) -> None:
        from emaviz.cli import output
        from emaviz.recording import RecordingError
        from emaviz.recording.identification import IdentificationStory

        source = "measurement" if arguments.files else "reference"
        try:
            self._story = IdentificationStory(
                arguments.record,
                objective,
                measurements[0],
                source,
                truth,
                output.configuration(arguments),
                (arguments.algorithm,),
            )
        except RecordingError as error:
            raise InputError(str(error)) from None
        self.iteration = self._story.iteration
        self.finish = self._story.finish
        self.close = self._story.close

    @property
    def failed(self) -> str | None:
        return self._story.failed
