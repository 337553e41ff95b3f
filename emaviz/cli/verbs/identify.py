"""`emaviz identify`: k1…k8 of recordings, or of a simulated actuator with known faults."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from ema_model.errors import InputError
from ema_model.members import stated, stated_in
from emaviz.cli import files, options
from emaviz.cli.interrupt import PartialAnswer
from emaviz.cli.options import whole

if TYPE_CHECKING:
    import numpy as np

    from ema_model.actuator import Actuator
    from ema_model.identification.objective import Objective
    from ema_model.identification.run import Progress
    from ema_model.recordings import Measurement
    from emaviz.cli import output

HELP = "find the faults k1 … k8 of recordings, or of a simulated actuator"
PLACE = 3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of INTERFACES, and those of the run that is simulated when no file is given."""
    robust = stated_in("ema_model.identification.run", "ROBUST")
    algorithms = (robust, *stated("ema_model.identification.optimisers", "name").values())
    fitnesses = stated_in("ema_model.simulation.plant", "FITNESSES")
    files.add_recordings(parser, "fitted", nargs="*")
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
    from ema_model.identification.summary import IdentificationJson, IdentifiedSoFarJson

    return (IdentificationJson, IdentifiedSoFarJson)


def run(arguments: argparse.Namespace) -> int:
    """Fits, prints and records; once interrupted, the best so far."""
    from emaviz.cli import given, output

    actuator = given.actuator_of(arguments)
    if effects := given.effects_of(arguments, actuator.axes):
        from ema_model.discovery.model_fit import with_effect

        for name, settings in effects.items():
            actuator = with_effect(actuator, name, settings)
    truth = given.faults_of(arguments) if arguments.fault or not arguments.files else None
    progress = output.Progress(arguments)
    try:
        measurements, unseen = _recordings(arguments, actuator, truth, progress)
    finally:
        progress.done()

    # These take a second: recordings are refused before.
    from ema_model.actuator import save_actuator
    from ema_model.identification.objective import Objective
    from ema_model.identification.run import SEARCH_SHARE, identify
    from ema_model.identification.summary import as_dict
    from ema_model.quantities.numbers import amount

    def fitness(of: list[Measurement]) -> Objective:
        return Objective(of, actuator, circuit=arguments.circuit, fitness=arguments.fitness)

    objective, held = fitness(measurements), fitness(unseen) if unseen else None
    recorder = _Recorder(arguments, measurements, objective, truth) if arguments.record else None
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
            _say_so_far(history, actuator, arguments)
        if recorder is not None:
            recorder.close()
        raise
    finally:
        progress.done()
    holdout_rmse = None if held is None else _finite(held(answer.k)[0])
    if arguments.save_actuator:
        save_actuator(answer.found_actuator, arguments.save_actuator)
    output.write_json(arguments, as_dict(answer, actuator, holdout_rmse))
    print(answer)
    if unseen and holdout_rmse is None:
        print("the model diverges on what was not fitted")
    elif holdout_rmse is not None:
        beside = f"{amount(answer.rmse, 'A')} on what was"
        names = ", ".join(one.name for one in unseen)
        print(f"uncorrected error {amount(holdout_rmse, 'A')} on what was not fitted, {beside}: {names}")
    if recorder is not None:
        recorder.finish(answer)
    if arguments.report:
        from emaviz.report import write_identification_report  # plotly takes a second to import

        configuration = output.configuration(arguments)
        write_identification_report(answer, objective, arguments.report, holdout_rmse, configuration)
    if recorder is not None and recorder.failed:
        raise InputError(recorder.failed)
    return 0


def _say_so_far(history: list[Progress], actuator: Actuator, arguments: argparse.Namespace) -> None:
    """Writes and prints the best of a search that was interrupted, and how it came there."""
    from ema_model.actuator.readings import sentences
    from ema_model.faults import NAMES
    from ema_model.identification.run import algorithm_title
    from ema_model.identification.summary import so_far_as_dict
    from ema_model.quantities.numbers import amount
    from emaviz.cli import output

    last = history[-1]
    output.write_json(arguments, so_far_as_dict(history, actuator))
    where = f"at iteration {last.iteration} of {last.iterations} of {algorithm_title(last.algorithm)}"
    print(f"Interrupted {where}: the best k so far, which no fit has refined, without intervals.")
    for name, value, phrase in zip(NAMES, last.k, sentences(last.k, actuator)):
        print(f"  {name}  {value:.4f}  {phrase}")
    print(f"uncorrected error {amount(last.rmse, 'A')}, {last.evaluations} simulations in {last.elapsed_s:.1f} s")
    output.say_not_written(arguments, "report", "save_actuator")


def _recordings(
    arguments: argparse.Namespace, actuator: Actuator, truth: np.ndarray | None, progress: output.Progress
) -> tuple[list[Measurement], list[Measurement]]:
    """Those to fit, and those held out."""
    from emaviz.cli import given

    fitted, held = given.read_set(arguments, actuator, progress)
    if fitted:
        return fitted, held
    assert truth is not None
    from ema_model.simulation.plant import simulated
    from ema_model.simulation.run import Sensors

    sensors = Sensors(arguments.noise_current, arguments.encoder_bits)
    try:
        clean = simulated(given.run_of(arguments, actuator), actuator, truth, arguments.fitness)
    except FloatingPointError as error:
        raise InputError(str(error)) from None
    return [sensors.record(clean, arguments.seed)], held


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


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
