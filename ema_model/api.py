"""The package in a few functions, as `import ema_model as em` has them.

Recordings are files' names, or measurements that were read or simulated, one or several; they are of one actuator,
without one the thesis's.  Every function raises InputError, with one line, for what it cannot take: each value is held
against the type that the function states for it.
"""

from __future__ import annotations

import inspect
import os
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import wraps
from numbers import Real
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from ema_model import actuator as actuators
from ema_model import analyses, comparison, discovery, recordings
from ema_model.actuator import Actuator
from ema_model.commands import command as command_of
from ema_model.comparison import Comparison
from ema_model.discovery import Discovery
from ema_model.discovery.history import with_fitted_effects
from ema_model.effects import find
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.exports import export as exporting
from ema_model.exports.replay import Export
from ema_model.faults import vector
from ema_model.fleet.compare import compare_units as compared_units
from ema_model.fleet.result import UnitsCompared
from ema_model.identification import run as identification
from ema_model.identification.run import ROBUST, Identification, Progress
from ema_model.identification.search import Objective
from ema_model.recordings import Measurement
from ema_model.recordings.health import Health, health_of
from ema_model.recordings.measurement import Sensors
from ema_model.recordings.recording_set import long_enough
from ema_model.result import Result
from ema_model.simulation import plant
from ema_model.simulation.run import Run
from ema_model.tracking import track as tracking
from ema_model.tracking.flights import check_enough, check_order, flights_in, identified
from ema_model.tracking.track import Tracked

__all__ = [
    "InputError",
    "analyse",
    "compare",
    "compare_units",
    "discover",
    "export",
    "health",
    "identify",
    "load_actuator",
    "read",
    "save_actuator",
    "simulate",
    "track",
]

One = str | os.PathLike[str] | Measurement
Recordings = One | Sequence[One]
Parameters = ParamSpec("Parameters")
Answer = TypeVar("Answer")

_FILE = "a file's name"
_RECORDING = f"{_FILE} or a recording, as em.read gives it"
_WORDS: dict[Any, str] = {  # of types, as a message has them
    str: "a text",
    float: "a number",
    int: "a whole number from 0",  # nothing that is counted or seeds random numbers is negative
    bool: "True or False",
    Actuator: "an actuator, as em.load_actuator gives it",
    Comparison: "a comparison, as em.compare gives it",
    One: _RECORDING,
    Recordings: f"{_RECORDING}, or a list of them",
    str | os.PathLike[str]: _FILE,
    str | Path: _FILE,
    Sequence[str]: "a list of texts",
    Mapping[str, float]: "numbers by name, such as {'k1': 0.25}",
    Mapping[str, Mapping[str, float]]: "settings by the effect's name, such as {'torque_ripple': {'order': 6.0}}",
    Mapping[str, Recordings]: "recordings by the unit's name, such as {'left': 'left.csv', 'right': 'right.csv'}",
}


def _checked(function: Callable[Parameters, Answer]) -> Callable[Parameters, Answer]:
    """The function, which raises InputError for a value that is not of the type that it states."""
    hints, signature = get_type_hints(function), inspect.signature(function)

    @wraps(function)
    def checking(*given: Parameters.args, **options: Parameters.kwargs) -> Answer:
        try:
            values = signature.bind(*given, **options).arguments
        except TypeError:
            return function(*given, **options)  # which says itself what is missing, or not known
        for name, value in values.items():
            of_its_own = signature.parameters[name].kind is inspect.Parameter.VAR_KEYWORD
            for option, one in value.items() if of_its_own else [(name, value)]:
                if not _fits(one, hints[name]):
                    must = f"must be {_in_words(hints[name])}, not {quoted(repr(one), 60)}"
                    raise InputError(f"em.{function.__name__}: {option} {must}")
        return function(*given, **options)

    return checking


def _fits(value: object, kind: Any) -> bool:
    """Whether a value is of a type; numbers and flags of numpy too, and any iterable where a sequence is stated."""
    origin, parts = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        return any(_fits(value, one) for one in parts)
    if origin is Mapping:
        key, of = parts
        return isinstance(value, Mapping) and all(_fits(k, key) and _fits(v, of) for k, v in value.items())
    if origin is Sequence:
        if not isinstance(value, Iterable) or isinstance(value, str | bytes | Mapping | Measurement):
            return False
        return not isinstance(value, Collection) or all(_fits(one, parts[0]) for one in value)
    if kind in (float, int) and isinstance(value, bool | np.bool_):
        return False
    if kind is int:
        return isinstance(value, int | np.integer) and bool(value >= 0)
    if kind is float:
        return isinstance(value, Real)
    return isinstance(value, (bool, np.bool_) if kind is bool else origin or kind)


def _in_words(kind: Any) -> str:
    """'a number', 'a list of texts or None'."""
    if kind in _WORDS:
        return _WORDS[kind]
    parts = [one for one in get_args(kind) if one is not NoneType]
    if get_origin(kind) not in (Union, UnionType):
        return "a function"
    if len(parts) < len(get_args(kind)):
        return f"{_in_words(Union[tuple(parts)])}, or None"  # noqa: UP007  made of parts
    return " or ".join(map(_in_words, parts))


@_checked
def load_actuator(path: str | os.PathLike[str] | None = None) -> Actuator:
    """An actuator of a TOML file.

    path: the file; the thesis's actuator without one.
    """
    return actuators.load_actuator(None if path is None else os.fspath(path))


@_checked
def save_actuator(actuator: Actuator, path: str | os.PathLike[str], *, with_comments: bool = False) -> None:
    """Writes an actuator as a TOML file, which `load_actuator` reads.

    actuator: as loaded, calibrated or improved: `em.compare(…).calibration.actuator`, `em.discover(…).actuator`.
    path: the file; one that exists is replaced.
    with_comments: whether each key has its meaning and unit beside it.
    """
    actuators.save_actuator(actuator, path, with_comments=bool(with_comments))


@_checked
def read(path: str | os.PathLike[str], actuator: Actuator | None = None, mapping: Sequence[str] = ()) -> Measurement:
    """A recording in SI, as the model needs it.

    path: the file, of any format that the README lists.
    actuator: what was recorded; the thesis's without one.
    mapping: texts such as "time_s=t[ms]", for columns of other names or units.
    """
    return recordings.read(path, actuator or load_actuator(), mapping)


@_checked
def health(of: One, actuator: Actuator | None = None) -> Health:
    """What a recording's own numbers say of its sampling, its sensors, its signs and the drive's limits.

    of: a file's name, or a recording.
    actuator: what was recorded; the thesis's without one.
    """
    actuator = actuator or load_actuator()
    return health_of(_read(of, actuator)[0], actuator)


@_checked
def simulate(
    command: str = "chirp",
    actuator: Actuator | None = None,
    *,
    settings: Mapping[str, float] | None = None,
    faults: Mapping[str, float] | None = None,
    effects: Mapping[str, Mapping[str, float]] | None = None,
    load_torque_Nm: float = 0.0,
    duration_s: float = 0.5,
    sample_rate_Hz: float = 10_000.0,
    noise_A: float = 0.0,
    encoder_bits: int = 0,
    seed: int = 0,
) -> Measurement:
    """One run of the Reference Model, or of the Monitor Model where an actuator has none, as sensors record it.

    command: step, ramp, sine, chirp, multisine or staircase; the run bears its name.
    actuator: what is simulated; the thesis's without one.
    settings: of the command, such as {"amplitude_rad": 0.01}; the others are its usual ones.
    faults: k1 … k8 by name, 0 … 1; the others are healthy.
    effects: settings by the effect's name, as `emaviz effects` lists them; the others are its usual ones.
    load_torque_Nm: N·m, constant, at the user, against positive motion.
    duration_s: s.
    sample_rate_Hz: Hz, of what is recorded.
    noise_A: A rms, of the current's sensor.
    encoder_bits: per turn of the motor; 0 is a perfect encoder.
    seed: of the noise.
    """
    run = Run(command_of(command, settings or {}), duration_s, sample_rate_Hz, load_torque_Nm)
    hidden = {name: find(name).settings(dict(given)) for name, given in (effects or {}).items()}
    clean = plant.simulate(run, actuator or load_actuator(), vector(dict(faults or {})), hidden)
    return replace(Sensors(noise_A, encoder_bits).record(clean, seed), name=command)


@_checked
def analyse(
    name: str,
    of: Recordings,
    actuator: Actuator | None = None,
    *,
    on_progress: Callable[[str], None] | None = None,
    **options: str,
) -> Result:
    """An analysis of recordings of one actuator beside its model; the answer says, shows and exports itself.

    name: of the analysis: "frequency".
    of: files' names or recordings, one or several, taken together.
    actuator: what was recorded; the thesis's without one.
    on_progress: takes a text that says what goes on; what it raises ends the analysis.
    options: the analysis's own, as `emaviz NAME --help` lists them, such as input="current".
    """
    known = analyses.analyses()
    if name not in known:
        raise InputError(f"no analysis {quoted(name)!r}; there are {', '.join(known)}{did_you_mean(name, known)}")
    actuator = actuator or load_actuator()
    return known[name].analyse(_read(of, actuator), actuator, **options, on_progress=on_progress)


@_checked
def compare(
    of: Recordings,
    actuator: Actuator | None = None,
    *,
    k: ArrayLike | None = None,
    effects: Mapping[str, Mapping[str, float]] | None = None,
    calibrate: bool = True,
    free: Sequence[str] | None = None,
    signals: Sequence[str] | Mapping[str, float] | None = None,
    holdout: Recordings = (),
    on_progress: Callable[[str], None] | None = None,
) -> Comparison:
    """Where the model fails beside recordings of one actuator.

    of: files' names or recordings, one or several, fitted together.
    actuator: what was recorded; the thesis's without one.
    k: (8,), 0 … 1, the actuator's faults, in place of those of its file.
    effects: settings by the effect's name, besides the actuator's own; what has none is fitted with the parameters.
    calibrate: whether the actuator's parameters are fitted within their tolerances.
    free: parameters to fit, "k1" or "motor.inertia_kgm2", in place of those that the actuator's file leaves free.
    signals: names of signals to fit, or weights by name (1: as the noise says); current and positions without it.
    holdout: recordings that are not fitted, to judge the result by.
    on_progress: takes a text that says what goes on; what it raises ends the comparison.
    """
    actuator = actuator or load_actuator()
    fitted = _read(of, actuator)
    to_fit = [name for name, values in (effects or {}).items() if not values] if calibrate else []
    if to_fit:
        effects = {name: values for name, values in (effects or {}).items() if values}
        known = {name: find(name, actuator.axes).settings(dict(values)) for name, values in effects.items()}
        beside = replace(actuator, effects={**actuator.effects, **known})
        actuator = with_fitted_effects(fitted, beside, to_fit, on_progress or (lambda text: None))
    return comparison.compare(
        fitted,
        actuator,
        k=k,
        effects=effects,
        calibrate=bool(calibrate),
        free=free,
        signals=signals,
        holdout=_read(holdout, actuator),
        on_progress=on_progress,
    )


@_checked
def compare_units(
    units: Mapping[str, Recordings],
    actuator: Actuator | None = None,
    *,
    holdout: Mapping[str, Recordings] | None = None,
    free: Sequence[str] | None = None,
    seed: int = 0,
    on_progress: Callable[[str], None] | None = None,
) -> UnitsCompared:
    """What units of one type differ in.

    units: the recordings of each unit, by its name; two units or more.
    actuator: the type, as its file says; the thesis's without one.
    holdout: recordings of the units that are not fitted, by which differences are confirmed.
    free: parameters that may differ, "motor.inertia_kgm2", in place of those that the actuator's file leaves free.
    seed: of the simulations that tell what the model itself misses.
    on_progress: takes a text that says what goes on; what it raises ends the comparison.
    """
    actuator = actuator or load_actuator()
    fitted, held = ({name: _read(of, actuator) for name, of in given.items()} for given in (units, holdout or {}))
    return compared_units(fitted, actuator, holdout=held, free=free, seed=seed, on_progress=on_progress)


@_checked
def discover(
    of: Recordings,
    actuator: Actuator | None = None,
    *,
    holdout: Recordings = (),
    signals: Sequence[str] | None = None,
    candidates: Sequence[str] | None = None,
    most_effects: int = 100,
    compared: Comparison | None = None,
    on_progress: Callable[[str], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> Discovery:
    """Which physical effects the model lacks, added to it one after another.

    of: files' names or recordings of one actuator, one or several, fitted together.
    actuator: what was recorded; the thesis's without one.
    holdout: recordings that are not fitted, and must improve as well.
    signals: names of signals to fit; current and positions without it.
    candidates: names of the effects to consider; all of `emaviz effects` without it.
    most_effects: how many are added at most.
    compared: a comparison of the same recordings, as em.compare gives it, on whose calibration this goes on.
    on_progress: takes a text that says what goes on; what it raises ends the discovery.
    stop: is asked as often, once the model is calibrated; where it is true, what was added so far is the answer.
    """
    actuator = actuator or load_actuator()
    return discovery.discover(
        _read(of, actuator),
        actuator,
        holdout=_read(holdout, actuator),
        signals=signals,
        candidates=candidates,
        most_effects=most_effects,
        compared=compared,
        on_progress=on_progress,
        stop=stop,
    )


@_checked
def identify(
    of: Recordings,
    actuator: Actuator | None = None,
    algorithm: str = ROBUST,
    *,
    population: int = 50,
    iterations: int = 150,
    seed: int = 0,
    truth: ArrayLike | None = None,
    parameters_known: bool = False,
    polish: bool = False,
    on_fit: Callable[[str, float], None] | None = None,
    on_iteration: Callable[[Progress], bool | None] | None = None,
    **settings: float,
) -> Identification:
    """The faults k1 … k8, with how sure that is.

    of: files' names or recordings of one actuator, one or several, fitted together.
    actuator: what was recorded; the thesis's without one.
    algorithm: "robust", or one of the thesis's as published: "ssa", "hba", "do".
    population: how many k are simulated side by side; 2 or more.
    iterations: of the search, at most; 1 or more.
    seed: of all random numbers.
    truth: (8,), 0 … 1, the k that are known; the answer then says its error.
    parameters_known: whether the actuator's parameters are exact, as in a simulation of the same file.
    polish: whether a least-squares fit follows "ssa", "hba" or "do"; "robust" always has it.
    on_fit: takes a text and a share, 0 … 1, of what follows the last iteration.
    on_iteration: takes where the search stands after each iteration; True, returned, ends the search there.
    settings: the algorithm's own: ssa safety_threshold, producer_share, scout_share; hba beta, density; do levy_scale.
    """
    actuator = actuator or load_actuator()
    return identification.identify(
        Objective(_read(of, actuator), actuator),
        algorithm,
        population=population,
        iterations=iterations,
        seed=seed,
        truth=truth,
        parameters_known=bool(parameters_known),
        polish=bool(polish),
        on_fit=on_fit,
        on_iteration=on_iteration,
        **settings,
    )


@_checked
def export(
    actuator: Actuator,
    out: str | os.PathLike[str],
    to: Sequence[str] = ("c",),
    of: Recordings = (),
    *,
    name: str = "",
    fmi: str = "3.0",
    on_progress: Callable[[str], None] | None = None,
) -> Export:
    """The model for other tools, each replayed on recordings, with its loss beside the monitor model's.

    actuator: as loaded, calibrated or improved.
    out: the folder that is written, which is new or empty.
    to: targets: "c", "fmu", "mjcf", "python".
    of: files' names or recordings to replay; without any, a run is made for it.
    name: of files and functions; the actuator's own without one.
    fmi: the version of FMUs: "3.0" or "2.0".
    on_progress: takes a text that says what goes on; what it raises ends the export, and nothing is written.
    """
    return exporting.export(actuator, to, _read(of, actuator), out, name=name, fmi=fmi, on_progress=on_progress)


@_checked
def track(
    of: Recordings,
    actuator: Actuator | None = None,
    thresholds: Mapping[str, float] | None = None,
    *,
    seed: int = 0,
    on_progress: Callable[[str], None] | None = None,
) -> Tracked:
    """The faults k over the flights of one unit: what drifts, and what life remains.

    of: a folder's name, or files' names or recordings in order of time, one of each flight.
    actuator: what flew; the thesis's without one.
    thresholds: the values of k at which the life ends, 0 … 1 by name, such as {"k2": 0.6}.
    seed: of all random numbers.
    on_progress: takes a text that says which flight is identified; what it raises ends the tracking.
    """
    actuator = actuator or load_actuator()
    tracking.check_thresholds(thresholds or {})
    several = flights_in(Path(of)) if isinstance(of, str | os.PathLike) and Path(of).is_dir() else _several(of)
    check_order([Path(one) for one in several if not isinstance(one, Measurement)])
    check_enough(several, "em.track")
    flights = []
    for number, flight in _long_enough(several, actuator):
        if on_progress is not None:
            on_progress(f"flight {number} of {len(several)}: {flight.name}")
        flights.append(identified(flight, flight.name, actuator, seed))
    return tracking.track(flights, thresholds, seed)


def _read(of: Recordings, actuator: Actuator) -> list[Measurement]:
    return [one for _, one in _long_enough(_several(of), actuator)]


def _long_enough(several: Sequence[One], actuator: Actuator) -> Iterator[tuple[int, Measurement]]:
    """Each recording with its number, from 1 on; warns of those that are left out, as too short."""

    def read_next(number: int) -> Measurement:
        one = several[number - 1]
        return one if isinstance(one, Measurement) else recordings.read(one, actuator)

    return long_enough(range(1, len(several) + 1), read_next, _warn)


def _warn(line: str) -> None:
    """Warns of the line of code outside of this package from which it was called."""
    level, frame = 1, inspect.currentframe()
    while frame is not None and frame.f_globals.get("__name__", "").startswith("ema_model"):
        level, frame = level + 1, frame.f_back
    warnings.warn(line, stacklevel=level)


def _several(of: Recordings) -> Sequence[One]:
    return [of] if isinstance(of, str | os.PathLike | Measurement) else list(of)
