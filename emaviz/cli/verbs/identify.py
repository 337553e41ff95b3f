"""`emaviz identify`: k1…k8 of recordings, or of a simulated actuator with known faults."""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from ema_model import faults
from ema_model.actuator import Actuator, save_actuator
from ema_model.discovery.model_fit import with_effect
from ema_model.errors import InputError
from ema_model.identification.objective import Objective
from ema_model.identification.run import ALGORITHMS, ROBUST, Progress, identify
from ema_model.identification.summary import as_dict
from ema_model.quantities.numbers import amount
from ema_model.recordings import Measurement
from ema_model.simulation.plant import FITNESSES, simulated
from ema_model.simulation.sensors import Sensors
from emaviz.cli import files, given, options, output
from emaviz.cli.numbers import whole

HELP = "find the faults k1 … k8 of recordings, or of a simulated actuator"
PLACE = 3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of INTERFACES, and those of the run that is simulated when no file is given."""
    files.add_recordings(parser, "fitted", nargs="*")
    parser.add_argument(
        "--algorithm", choices=tuple(ALGORITHMS), default=ROBUST, help="robust, or one of the thesis's as published"
    )
    parser.add_argument(
        "--polish", action="store_true", help="let a least-squares fit follow ssa, hba or do (robust always has it)"
    )
    parser.add_argument("--population", type=whole(2, 100_000), default=50, metavar="N")
    parser.add_argument("--iterations", type=whole(1, 1_000_000), default=150, metavar="N")
    parser.add_argument("--fitness", choices=FITNESSES, default="filtered", help="0.5 ms means, or every sample")
    parser.add_argument("--circuit", choices=("reduced", "thesis"), default="reduced", help="of the monitor model")
    options.add_fit(parser, "the identification")
    options.add_faults(parser)
    options.add_effects(parser)
    options.add_run(parser)


def documents() -> tuple[type, ...]:
    """What --json holds."""
    from ema_model.identification.summary import IdentificationJson

    return (IdentificationJson,)


def run(arguments: argparse.Namespace) -> int:
    """Fits, records and prints."""
    actuator = given.actuator_of(arguments)
    for name, settings in given.effects_of(arguments, actuator.axes).items():
        actuator = with_effect(actuator, name, settings)
    truth = given.faults_of(arguments) if arguments.fault or not arguments.files else None
    progress = output.Progress()
    try:
        measurements, unseen = _recordings(arguments, actuator, truth, progress)
    finally:
        progress.done()

    def fitness(of: list[Measurement]) -> Objective:
        return Objective(of, actuator, circuit=arguments.circuit, fitness=arguments.fitness)

    objective, held = fitness(measurements), fitness(unseen) if unseen else None
    recorder = _Recorder(arguments, measurements, objective, truth) if arguments.record else None

    def on_iteration(at: Progress) -> None:
        progress.show(f"{at.algorithm} {at.iteration}/{at.iterations}  rmse {at.rmse:.4f} A")
        if recorder is not None:
            recorder.iteration(at)

    try:
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
        )
    except BaseException:
        if recorder is not None:
            recorder.close()
        raise
    finally:
        progress.done()
    if recorder is not None:
        recorder.finish(answer)
    holdout_rmse = None if held is None else _finite(held(answer.k)[0])
    if arguments.save_actuator:
        found = replace(actuator.with_values(answer.parameters), faults=faults.named(answer.k))
        save_actuator(found, arguments.save_actuator)
    output.write_json(arguments, as_dict(answer, actuator, holdout_rmse))
    print(answer)
    if unseen and holdout_rmse is None:
        print("the model diverges on what was not fitted")
    elif holdout_rmse is not None:
        print(f"rmse {amount(holdout_rmse, 'A')} on what was not fitted: {', '.join(one.name for one in unseen)}")
    if arguments.report:
        from emaviz.report import write_identification_report  # plotly takes a second to import

        configuration = output.configuration(arguments)
        write_identification_report(answer, objective, arguments.report, holdout_rmse, configuration)
    if recorder is not None and recorder.failed:
        raise InputError(recorder.failed)
    return 0


def _recordings(
    arguments: argparse.Namespace, actuator: Actuator, truth: np.ndarray | None, progress: output.Progress
) -> tuple[list[Measurement], list[Measurement]]:
    """Those to fit, and those held out."""
    fitted, held = given.read_set(arguments, actuator, progress)
    if fitted:
        return fitted, held
    assert truth is not None
    sensors = Sensors(arguments.noise_current, arguments.encoder_bits)
    try:
        clean = simulated(given.run_of(arguments, actuator), actuator, truth, arguments.fitness)
    except FloatingPointError as error:
        raise InputError(str(error)) from None
    return [sensors.record(clean, arguments.seed)], held


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


class _Recorder:
    """Writes the identification as it goes; rerun, which takes a second to import, only when asked for."""

    def __init__(
        self,
        arguments: argparse.Namespace,
        measurements: list[Measurement],
        objective: Objective,
        truth: np.ndarray | None,
    ) -> None:
        from emaviz.recording import RecordingError
        from emaviz.recording.story import IdentificationStory

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
