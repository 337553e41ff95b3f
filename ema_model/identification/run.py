"""One identification: an optimiser against an objective, told as it goes, stopped when asked."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike, NDArray

from ema_model import faults
from ema_model.actuator import Actuator
from ema_model.actuator.actuator import between, readings, sentences
from ema_model.actuator.parameters import on_axes
from ema_model.errors import InputError, quoted
from ema_model.estimation.calibrate import KnownTogether, combination_in_words, combinations
from ema_model.identification.fit import FAULTS, LONGER_STEPS_S, CorrectedError, Setting, refine, refine_best, setting
from ema_model.identification.optimisers import OPTIMISERS, Optimiser, create
from ema_model.identification.search import Landscape, Objective, Way, search
from ema_model.identification.uncertainty import Uncertainty, uncertainty
from ema_model.physics.rows import LANES
from ema_model.quantities import amount, as_number, check_seed, in_sentence
from ema_model.result import FLAT, NAME, NULL, Result
from ema_model.simulation.pack import compile_ahead, compile_here, stack_at_hand, wait_for
from ema_model.simulation.run import run_in_words
from ema_model.stacks import Stack
from ema_model.text import Document, Lines, Remark, Remarks, Table

Array = NDArray[np.float64]

ROBUST = "robust"
ALGORITHMS: dict[str, str] = {ROBUST: "Robust"} | {name: one.title for name, one in OPTIMISERS.items()}  # by name
SEARCH_SHARE = 0.6  # of an identification's time, about; model bias and intervals take the rest
_ROUGH = 0.7  # of a metaheuristic's iterations, which may be simulated at longer steps
_LONG = 20  # iterations, from which on this is worth looking at
_NEARLY = 0.02  # of the fitness, by which these may change it


def algorithm_title(name: str) -> str:
    """How people call it; what is none of `ALGORITHMS`, as of a recording of another version, stays as it is."""
    return ALGORITHMS.get(name, name)


@dataclass(frozen=True)
class Progress:
    """Where an identification stands after an iteration; iteration 0 is the first random population."""

    algorithm: Annotated[str, Meta(description="robust, ssa, hba or do")]
    iteration: Annotated[int, Meta(description="the last one of the search")]
    iterations: Annotated[int, Meta(description="how many there would have been")]
    rmse: Annotated[  # uncorrected; `robust` ranks by all signals, so that this may rise
        float, Meta(description="A, of the current, at k and the file's other parameters")
    ]
    k: Annotated[Array, Meta(description="k1 … k8, 0 … 1, the best so far")]
    population: Array  # (n, 8)
    population_rmse: Array  # (n,), A
    evaluations: Annotated[int, Meta(description="how many times the recordings were simulated")]
    elapsed_s: Annotated[float, Meta(description="s, without compilation")]


@dataclass(frozen=True)
class SearchHistory:
    """The search, iteration by iteration; the first is the first random population."""

    rmse: Annotated[Array, Meta(description="A, of the best so far")]
    k: Annotated[Array, Meta(description="(8,) each, the best so far", extra={"dimensions": 2})]


@dataclass(frozen=True, repr=False)
class Identification(Result):
    """The faults k1 … k8 of an actuator, each 0 … 1."""

    actuator: Actuator  # as its file says
    algorithm: Annotated[str, Meta(description="robust, ssa, hba or do")]
    seed: int
    k: Annotated[Array, Meta(description="k1 … k8")]
    rmse: Annotated[float, Meta(description="A, of the current, at k and the file's other parameters")]
    evaluations: Annotated[int, Meta(description="how many times the recordings were simulated")]
    elapsed_s: Annotated[float, Meta(description="s, without compilation")]
    compile_s: Annotated[float, Meta(description="s, of compilation")]
    rmse_history: Array  # (iterations + 1,), A
    k_history: Array  # (iterations + 1, 8)
    stopped: bool  # by the user, before its last iteration
    uncertainty: Annotated[Uncertainty, Meta(extra=FLAT)]
    truth: Annotated[Array | None, Meta(description="k1 … k8; null: they are not known")] = None
    polished: Annotated[bool, Meta(description="whether a least-squares fit followed the search")] = False
    searched_k: Annotated[Array | None, Meta(description="k1 … k8, where the search alone ended")] = None
    parameters: Annotated[
        dict[str, float], Meta(description="section.name, where the fit moved them beside k", extra=NAME)
    ] = field(default_factory=dict)
    corrected_rmse: Annotated[  # by `corrected_error`
        float, Meta(description="A, the same where a fit freed the model of its bias", extra=NULL)
    ] = float("nan")
    corrected_history: Array = field(default_factory=lambda: np.zeros(0))  # (iterations + 1,), A, of k_history
    corrected_error: CorrectedError | None = field(default=None, compare=False)
    objective: Objective | None = field(default=None, compare=False)  # what it was fitted to
    held_out: tuple[str, ...] = ()  # names of recordings that were not fitted
    holdout_rmse: Annotated[
        float, Meta(description="A, of what was not fitted; null: nothing, or it diverges", extra=NULL)
    ] = float("nan")

    def name_in_files(self, name: str) -> str:
        """A parameter's path on the actuator's axes."""
        return on_axes(name, self.actuator.axes).path

    @property
    def physical(
        self,
    ) -> Annotated[dict[str, float], Meta(description="what k means in this actuator, units in the names")]:
        """By name."""
        return readings(self.k, self.actuator)

    @property
    def identifiable(
        self,
    ) -> Annotated[
        list[KnownTogether],
        Meta(description="what the recordings tell only together; of a k what it multiplies, as 1 + 2 k1 or 1 − k3"),
    ]:
        """With its words."""
        return combinations(self.uncertainty.identifiable, self.actuator.axes)

    @property
    def history(self) -> Annotated[SearchHistory, Meta(description="of the search")]:
        """As the search told it."""
        return SearchHistory(self.rmse_history, self.k_history)

    @property
    def found_actuator(self) -> Actuator:
        """The actuator with k as its faults, and the parameters that moved beside k at their values and found σ."""
        fitted = self.actuator.with_values(self.parameters)
        sigmas = {path: self.uncertainty.sigmas[path] for path in self.parameters if path in self.uncertainty.sigmas}
        return replace(fitted.with_fitted_sigmas(sigmas), faults=faults.named(self.k))

    @property
    def error_percent(
        self,
    ) -> Annotated[float | None, Meta(description="Err % (T 5.2); null: the truth is not known")]:
        """Literally, where the truth is known."""
        return None if self.truth is None else faults.error_percent(self.k, self.truth)

    def beside(self, unseen: Objective | None) -> Identification:
        """The same with its error on recordings that were not fitted."""
        if unseen is None:
            return self
        names = tuple(one.name for one in unseen.measurements)
        return replace(self, held_out=names, holdout_rmse=float(unseen(self.k)[0]))

    def corrected_by(self, error: CorrectedError) -> Identification:
        """The same answer with its corrected errors by that of another fit; simulates its history."""
        every, places = np.unique(np.vstack([self.k_history, self.k]), axis=0, return_inverse=True)
        *history, last = error(every)[places.ravel()]
        return replace(self, corrected_rmse=float(last), corrected_history=np.array(history), corrected_error=error)


@dataclass(frozen=True, repr=False, eq=False)
class IdentifiedSoFar(Result):
    """The best of a search that was interrupted, which no fit has refined."""

    actuator: Actuator
    told: Sequence[Progress]  # an iteration or more
    interrupted: Annotated[bool, Meta(description="true")] = True
    k_interval90: Annotated[None, Meta(description="null: none is known yet")] = None

    @property
    def last(self) -> Annotated[Progress, Meta(extra=FLAT)]:
        """The last iteration."""
        return self.told[-1]

    @property
    def physical(
        self,
    ) -> Annotated[dict[str, float], Meta(description="what k means in this actuator, units in the names")]:
        """By name."""
        return readings(self.last.k, self.actuator)

    @property
    def history(self) -> Annotated[SearchHistory, Meta(description="of the search")]:
        """As it was told."""
        return SearchHistory(np.array([at.rmse for at in self.told]), np.array([at.k for at in self.told]))


def by_one_error(answers: Sequence[Identification]) -> list[Identification]:
    """Answers to the same recordings, all corrected as the closest fit among them has it: so they can be compared.

    A fit that an answer was taken from goes before one that only stands beside a search.
    """
    found = [(not one.polished, one.corrected_error.least, i) for i, one in enumerate(answers) if one.corrected_error]
    if not found:
        return list(answers)
    error = answers[min(found)[2]].corrected_error
    assert error is not None, "it was found among those that have one"
    return [one.corrected_by(error) for one in answers]


def steps(
    objective: Objective,
    algorithm: str = ROBUST,
    *,
    population: int = 50,
    iterations: int = 150,
    seed: int = 0,
    truth: ArrayLike | None = None,
    parameters_known: bool = False,
    polish: bool = False,
    on_fit: Callable[[str, float], None] | None = None,
    **settings: float,
) -> Generator[Progress, bool | None, Identification]:
    """Fits k1…k8 to the objective's recordings, an iteration (about 5 ms) at a time.

    Yields where it stands after each iteration; a true value sent back stops it there.  Returns the answer.
    `robust` starts `population` niches, which settle long before 150 iterations, and always polishes; the
    others answer what they found unless `polish` is true.
    on_fit(text, share): what goes on after the last iteration, and how much of that is done, 0 … 1.
    parameters_known: the actuator's own parameters are exact, as in a simulation of the same file, so that
    they do not move and their tolerances do not widen the intervals.  settings: the algorithm's own.
    truth: k (8,), where it is known.
    Raises InputError for an unknown algorithm, impossible settings, and a truth that is no k.
    """
    check_seed(seed)
    known = None if truth is None else faults.checked(truth)
    tell = on_fit or (lambda text, share: None)
    prepared = cache(lambda: setting(objective, parameters_known=parameters_known))
    if algorithm == ROBUST:
        if settings:
            raise InputError(f"the robust algorithm has no setting {quoted(next(iter(settings)))!r}")
        _check_size("population", population, 2)
        _check_size("iterations", iterations, 1)
        running = _robust(objective, prepared, population, iterations, seed)
    else:
        try:
            optimiser = create(
                algorithm, dimension=8, population=population, iterations=iterations, seed=seed, **settings
            )
        except (ValueError, TypeError) as error:
            others = "" if algorithm in OPTIMISERS else f" and {ROBUST}"
            raise InputError(f"{error}{others}") from None
        running = _optimise(objective, optimiser)
    twins = _stack_of_twins(objective)
    compile_ahead(twins)
    compile_s = warm_up(objective)
    history: list[Progress] = []
    stopped = False
    for at in running:
        history.append(at)
        stopped = bool((yield at))
        if stopped:
            break
    started = time.perf_counter()
    last = history[-1]
    given = prepared()
    first_compile = _warm_up_fit(given) + _warm_up_twins(twins)
    if algorithm == ROBUST:
        found = refine_best(given, last.population, seed, tell)
    else:
        found = refine(given, last.k, seed, tell)
    tell("intervals", 1.0)
    polishes = (polish or algorithm == ROBUST) and not stopped
    looked = 0 if algorithm == ROBUST else given.rough.evaluations  # which the robust search has counted itself
    k = found.k if polishes else last.k
    sure = uncertainty(found, k)
    after = time.perf_counter() - started - first_compile
    answer = Identification(
        actuator=objective.actuator,
        algorithm=algorithm,
        seed=seed,
        k=k,
        rmse=float(objective(k)[0]) if polishes else last.rmse,
        evaluations=last.evaluations + (looked + found.evaluations if polishes else 0),
        elapsed_s=last.elapsed_s + (after if polishes else 0.0),
        compile_s=compile_s + first_compile,
        rmse_history=np.array([at.rmse for at in history]),
        k_history=np.array([at.k for at in history]),
        stopped=stopped and last.iteration < last.iterations,
        uncertainty=sure,
        truth=known,
        polished=polishes,
        searched_k=last.k,
        parameters=found.problem.parameters(found.x) if polishes else {},
        objective=objective,
    )
    return answer.corrected_by(CorrectedError.of_fit(found))


def _optimise(objective: Objective, optimiser: Optimiser) -> Generator[Progress, None, None]:
    """One of the metaheuristics, as its paper has it.

    Most of a long search simulates at longer steps, where these hardly change the fitness; its end, and what is told
    of the best on the way, are exact.
    """
    elapsed, iteration, beside = 0.0, -1, 0
    fitness = exact = objective
    leader = k = np.full(FAULTS, np.nan)
    rmse = np.inf
    while not optimiser.done:
        started = time.perf_counter()
        if iteration < 0 and optimiser.iterations >= _LONG:
            fitness, beside = _roughly(objective, optimiser.ask()[:LANES])
        elif fitness is not exact and iteration >= _ROUGH * optimiser.iterations:
            fitness = exact
            optimiser.rescore(exact)
        while optimiser.iteration == iteration or not optimiser.evaluations:
            optimiser.tell(fitness(optimiser.ask()))
        iteration = optimiser.iteration
        if not np.array_equal(leader, optimiser.best_x):
            leader, its = optimiser.best_x.copy(), float(optimiser.best_f)
            if fitness is not exact:
                its, beside = float(exact(leader)[0]), beside + 1
            if its < rmse or iteration == 0:
                k, rmse = leader, its
        elapsed += time.perf_counter() - started
        yield Progress(
            optimiser.name,
            optimiser.iteration,
            optimiser.iterations,
            rmse,
            k.copy(),
            optimiser.population_x.copy(),
            optimiser.population_f.copy(),
            optimiser.evaluations + beside,
            elapsed,
        )


def _roughly(objective: Objective, k: Array) -> tuple[Objective, int]:
    """The objective at longer steps, where it says nearly the same of k (n, 8); else itself; and how many it took."""
    exact = objective(k)
    for tried, longest_s in enumerate(LONGER_STEPS_S, 1):
        rough = objective.at_longer_steps(longest_s)
        with np.errstate(invalid="ignore"):  # of those that diverge
            off = np.abs(rough(k) / exact - 1.0)
        if np.median(np.nan_to_num(off)) < _NEARLY:
            return rough, (1 + tried) * len(k)
    return objective, (1 + len(LONGER_STEPS_S)) * len(k)


def _robust(
    objective: Objective, prepared: Callable[[], Setting], population: int, iterations: int, seed: int
) -> Generator[Progress, None, None]:
    """Niches that go downhill together."""
    started = time.perf_counter()
    given = prepared()
    compiled = _warm_up_fit(given)
    waited = compiled
    problem = given.coarse(given.rough.plant)
    for number, basins in enumerate(search(problem, population, iterations, seed)):
        k = problem.k(basins.x)
        rmse = objective(k)
        evaluations = given.rough.evaluations + basins.evaluations
        elapsed = time.perf_counter() - started - waited
        at = time.perf_counter()
        last = number if basins.done else iterations
        yield Progress(ROBUST, number, last, float(rmse[0]), k[0], k, rmse, evaluations, elapsed)
        waited += time.perf_counter() - at


def _check_size(what: str, value: int, least: int) -> None:
    number = as_number(value)
    if not (number >= least and number.is_integer()):
        raise InputError(f"{what} must be a whole number of at least {least}, got {quoted(value)}")


def identify(
    objective: Objective,
    algorithm: str = ROBUST,
    *,
    on_iteration: Callable[[Progress], bool | None] | None = None,
    **options: Any,
) -> Identification:
    """Runs `steps` to the end; on_iteration is told each iteration, and stops it by returning True."""
    running = steps(objective, algorithm, **options)
    answer: bool | None = None
    try:
        progress = next(running)
        while True:
            if on_iteration is not None:
                answer = on_iteration(progress)
            progress = running.send(answer)
    except StopIteration as finished:
        return finished.value


def warm_up(objective: Objective) -> float:
    """Compiles (or loads) the kernels that an identification needs; returns the time, s."""
    started = time.perf_counter()
    if not objective.stack.monitor.squared_errors.signatures:
        objective(faults.HEALTHY)
    if not objective.stack.monitor.traces.signatures:
        objective.currents(faults.HEALTHY)
    return time.perf_counter() - started


def _warm_up_fit(given: Setting) -> float:
    """The same for what the fit needs beside: the twin, and the stack of an unrecorded load."""
    started = time.perf_counter()
    plant = given.plant
    if not plant.stack.monitor.traces.signatures:
        plant.signals(0)
        return time.perf_counter() - started
    return 0.0


def _stack_of_twins(objective: Objective) -> list[tuple[Stack, str]]:
    """The kernel that the fit's twins need; none without a Reference Model."""
    if not objective.actuator.has_reference_model:
        return []
    return [(stack_at_hand(objective.actuator, objective.effects, "reduced", "runs"), "runs")]


def _warm_up_twins(kernels: list[tuple[Stack, str]]) -> float:
    """The same for the twins, whose kernel another process may have begun to compile."""
    started = time.perf_counter()
    for stack, kernel in kernels:
        wait_for(stack, kernel)
        if not stack.reference.runs.signatures:
            compile_here(stack, kernel)
    return time.perf_counter() - started if kernels else 0.0


# --- an identification in words: the faults, whether they are, how sure that is, and the cost around the answer -------

CORRECTED = (
    "Corrected error: rms of measured less model current, with what the simplified model is known to lack added."
)


def verdict(answer: Identification) -> str:
    """The short one: healthy, which k are not, or that nothing can be told."""
    sure = answer.uncertainty
    if sure.uninformative:
        return "uninformative: the recordings tell nothing of the faults"
    if not sure.adequate:
        return "the model does not fit: no fault can be told"
    return "healthy" if sure.healthy else f"not healthy: {', '.join(sure.alarms) or 'no single k stands out'}"


def in_one_line(answer: Identification) -> str:
    """The verdict with its values: 'Not healthy: backlash 703 ± 1.1 µrad.'"""
    phrases = between(answer.k, answer.uncertainty.interval90, answer.actuator)
    seen = [phrase for name, phrase in zip(faults.NAMES, phrases) if name in answer.uncertainty.alarms]
    said = f"not healthy: {', '.join(seen)}" if seen and answer.uncertainty.adequate else verdict(answer)
    return f"{said[:1].upper()}{said[1:]}."


def document_of(answer: Identification | IdentifiedSoFar) -> Document:
    """All that the terminal and a notebook show."""
    if isinstance(answer, IdentifiedSoFar):
        return Document([Lines([*_so_far(answer)])])
    ran = f"{'; '.join(facts(answer))} ({answer.algorithm}, compiled in {answer.compile_s:.1f} s)"
    return Document([_faults(answer), Remarks(remarks(answer)), Lines([ran, *_of_unseen(answer)])])


def _of_unseen(answer: Identification) -> Iterator[str]:
    """How far the model is from what was not fitted."""
    if answer.held_out and not math.isfinite(answer.holdout_rmse):
        yield "the model diverges on what was not fitted"
    elif answer.held_out:
        beside = f"{amount(answer.rmse, 'A')} on what was"
        error = amount(answer.holdout_rmse, "A")
        yield f"uncorrected error {error} on what was not fitted, {beside}: {', '.join(answer.held_out)}"


def _so_far(answer: IdentifiedSoFar) -> Iterator[str]:
    last = answer.last
    where = f"at iteration {last.iteration} of {last.iterations} of {algorithm_title(last.algorithm)}"
    yield f"Interrupted {where}: the best k so far, which no fit has refined, without intervals."
    for name, value, phrase in zip(faults.NAMES, last.k, sentences(last.k, answer.actuator)):
        yield f"  {name}  {value:.4f}  {phrase}"
    yield f"uncorrected error {amount(last.rmse, 'A')}, {last.evaluations} simulations in {last.elapsed_s:.1f} s"


def _faults(answer: Identification) -> Table:
    sure, known = answer.uncertainty, answer.truth is not None
    rows, remarks = [], []
    for i, (name, phrase) in enumerate(zip(faults.NAMES, sentences(answer.k, answer.actuator))):
        low, high = sure.interval90[i]
        row = [name, f"{answer.k[i]:.4f}", f"{low:.4f} … {high:.4f}"]
        rows.append([*row, f"{answer.truth[i]:.3f}"] if answer.truth is not None else row)
        remarks.append(f"{phrase}{'  ← not healthy' if name in sure.alarms else ''}")
    return Table(("value", "90 % interval", *(["truth"] if known else [])), rows, remarks=remarks, unit="meaning")


def remarks(answer: Identification) -> list[Remark]:
    """Health first, then what these recordings leave open, and what would tell it."""
    sure = answer.uncertainty
    told = [_health(answer)]
    told += [Remark("caution", warning, "warning") for warning in sure.warnings]
    for group in sure.ambiguous:
        names = " and ".join(_named(name) for name in group)
        told.append(Remark("cannot be told apart", f"{names} do the same to this recording", "warning"))
    if sure.identifiable:
        products = "; ".join(combination_in_words(one, answer.actuator.axes) for one in sure.identifiable)
        told.append(Remark("known only together", f"{products}, if the model is right", "warning"))
    if sure.hardly_known:
        names = ", ".join(_named(name) for name in sure.hardly_known)
        line = f"this recording says hardly anything of {names}, and the other intervals rest on them"
        told.append(Remark("hardly known", line, "warning"))
    if run := sure.separated_by:
        asked = run_in_words(run.command, run.settings, run.duration_s)
        told.append(Remark("what would tell more", f"{asked} ({run.options})", "warning"))
    if not answer.polished:
        line = "those of a fit from here; the answer of the search alone may lie at their edge"
        told.append(Remark("the intervals", line))
    return told


def _health(answer: Identification) -> Remark:
    sure = answer.uncertainty
    if sure.uninformative:
        return Remark("uninformative", "the recordings tell nothing of the faults", "bad")
    if not sure.adequate:
        return Remark("the model does not fit", "no fault can be told", "bad")
    if sure.healthy:
        return Remark("healthy", "no k is surely off (joint test at 1 %)", "good")
    named = ", ".join(faults.BY_NAME[name].label for name in sure.alarms)
    return Remark("not healthy", named or "all k together, though no single one stands out", "bad")


def facts(answer: Identification) -> list[str]:
    """What it came to and took: error, simulations, time."""
    return [
        *(["stopped"] if answer.stopped else []),
        *([] if answer.error_percent is None else [f"Err {answer.error_percent:.2f} %"]),
        f"corrected error {amount(answer.corrected_rmse, 'A')}",
        f"{answer.evaluations} simulations in {answer.elapsed_s:.2f} s",
    ]


def why_best(best: Identification, others: Sequence[Identification]) -> str:
    """Why one answer of several to the same recording is the one to believe."""
    fitted = best.polished and not all(answer.polished for answer in others)
    how = "; its answer was fitted, the others are where their searches ended" if fitted else ""
    return f"it has the least corrected error{how}. {CORRECTED}"


def _named(name: str) -> str:
    return f"{name} ({in_sentence(faults.BY_NAME[name].title)})"


def landscape_words(found: Landscape) -> str:
    """How far a landscape was drawn, what was held, and from where to where the error goes."""
    stopped = "" if found.share == 1.0 else f"Stopped at {100.0 * found.share:.0f} %. "
    others = [i for i in range(len(faults.NAMES)) if i not in (found.x, found.y)]
    held = ", ".join(f"{faults.NAMES[i]} {found.through[i]:.3f}" for i in others)
    known = found.error_A[np.isfinite(found.error_A)]
    reach = f" Corrected error from {amount(known.min(), 'A')} to {amount(known.max(), 'A')}." if len(known) else ""
    return f"{stopped}Held: {held}.{reach}"


def way_sentences(found: Mapping[str, Way], fitted: str = "") -> Sequence[str]:
    """What became of each search, in words; fitted: the one from whose end a fit went on to the answer."""
    said = []
    for name, way in found.items():
        title = algorithm_title(name)
        end, answer, highest = (amount(error, "A") for error in (way.error_A, way.answer_A, way.highest_A))
        if name == fitted:
            said.append(f"{title} has the answer: a fit went on to it ({answer}) from where its search ended ({end}).")
        elif way.is_trap:
            said.append(
                f"{title} ended in a local minimum: its error is {end} there, and on the straight line to the answer "
                f"({answer}) it rises to {highest} first."
            )
        elif way.is_worse:
            said.append(
                f"{title} had not converged: from its end ({end}) the error falls steadily to the answer ({answer})."
            )
        else:
            said.append(f"{title} ended at the answer: {end}.")
    return said
