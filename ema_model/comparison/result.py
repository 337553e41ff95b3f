"""What a comparison finds: the result, its words, its JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, TypedDict

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from ema_model.actuator.parameters import on_axes
from ema_model.comparison.error_in_floors import UNKNOWN, OverFloor
from ema_model.comparison.explain import Explanation
from ema_model.comparison.free_simulation import Score, Simulated, without
from ema_model.comparison.regions import Event, Region
from ema_model.comparison.residuals import Residuals, dependence
from ema_model.estimation.calibrate import (
    Calibrated,
    Calibration,
    CombinationJson,
    calibration_table,
    combinations,
    together,
)
from ema_model.quantities.axes import ROTARY, SIGNALS, Axes, of_residual, of_signal
from ema_model.quantities.numbers import IntervalJson, Quantity, number, plain
from ema_model.quantities.titles import all_of, in_sentence
from ema_model.quantities.variables import of_variable
from ema_model.recordings.health import HealthJson
from ema_model.recordings.noise import least_noise
from ema_model.text import Document, InWords, Lines, Note, Table

if TYPE_CHECKING:
    from ema_model.actuator import Actuator
    from ema_model.comparison.explain import Order
    from ema_model.comparison.free_simulation import Simulated
    from ema_model.comparison.regions import Event
    from ema_model.estimation.calibrate import Calibration
    from ema_model.recordings import Measurement
    from ema_model.recordings.health import Health


# --- what a comparison finds, in the words and numbers that the screen, the report and JSON show ----------------------

Array = NDArray[np.float64]

COMPARISON_VERDICTS = ("adequate", "not_adequate", "uninformative")


@dataclass(frozen=True)
class SignalError:
    """How far the model is from one signal over all recordings, in the signal's unit."""

    rmse: float
    rmse_initial: float  # before calibration
    nrmse: float  # rmse over the range of the measured signal
    noise_floor: float  # noise and model floor, rms
    mean_absolute: float
    signal_rms: float = math.nan  # of what was measured; of a position about its mean
    silent: str = ""  # why the signal tells nothing of the model, as of `estimation.floor.tells_nothing`
    in_floors: OverFloor = UNKNOWN  # the error over the floor of the same moment; no quotient of the numbers above
    is_counted: bool = True  # whether it is one of those whose errors in floors are pooled

    def in_words(self, signal: Quantity) -> str:
        """'equivalent current 42.1 mA rms'."""
        return f"{in_sentence(signal.title)} {self.quantity(signal).text(self.rmse)} rms"

    def quantity(self, signal: Quantity) -> Quantity:
        """The signal in the prefix that all numbers of its error are written with."""
        return signal.scaled([self.rmse, self.noise_floor])


@dataclass(frozen=True, eq=False)
class Compared:
    """One recording beside the model; all arrays are (blocks,)."""

    name: str
    measurement: Measurement  # as it was compared
    health: Health
    time_s: Array
    measured: dict[str, Array]
    initial: dict[str, Array]  # the model with the file's parameters
    model: dict[str, Array]  # the model after calibration (the same without one)
    sigma: dict[str, Array]  # standard deviation that a perfect model would leave
    errors: dict[str, SignalError]


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(InWords):
    """All of it: the recordings one by one, and what they say together."""

    actuator: Actuator  # as given
    calibration: Calibration | None
    recordings: Sequence[Compared]
    residuals: Residuals  # joined
    signals: dict[str, SignalError]
    primary: str  # the signal whose residual is explained
    explained_by: Sequence[Explanation]  # best first
    orders: Sequence[Order]  # of the primary signal, strongest first; significant ones only
    worst_regions: Sequence[Region]  # worst first
    adequate: bool
    over_floor: float  # error in floors, pooled over signals
    floor_band: tuple[float, float]  # between which nine of ten true models' lie
    sentences: Sequence[str]  # the answer in plain words, the first one first
    warnings: Sequence[str] = field(default_factory=tuple)
    events: Sequence[Event] = field(default_factory=tuple)  # what happened at one moment of a recording
    holdout: Sequence[Compared] = field(default_factory=tuple)  # not fitted, beside the calibrated model
    unseen: OverFloor | None = None  # the pooled error of what was held out; None without any
    uninformative: bool = False  # the recordings tell nothing of the model, so that it is not adequate either
    simulation: Mapping[str, Simulated] = field(default_factory=dict)  # of the model running freely, by signal

    @property
    def verdict(self) -> str:
        """One of `COMPARISON_VERDICTS`."""
        return "uninformative" if self.uninformative else "adequate" if self.adequate else "not_adequate"

    @property
    def in_floors(self) -> OverFloor:
        """The pooled error of what was fitted, with its band."""
        return OverFloor(self.over_floor, self.floor_band)

    @property
    def is_within_band(self) -> bool:
        """Whether no error is above its band: that of all signals, of the explained one, of what was held out."""
        told = [self.in_floors, self.signals[self.primary].in_floors, *([] if self.unseen is None else [self.unseen])]
        return not any(one.is_above for one in told)


# --- a comparison in words: its sentences, the errors, what explains them, the calibration ----------------------------

FLOOR_NOTE = (
    "The floor is what a perfect model would leave: the sensors' noise, and what the model leaves out on "
    "purpose (the inverter's switching). The error over the floor is that of each moment, whose floor may be lower or "
    "higher than its rms; it is green up to what nine of ten true models leave."
)
FREE_NOTE = (
    "Free simulation: the model runs from the recordings' first state on, driven by the command alone, or in open loop "
    "by the recorded current, torque or force; nothing of the measured motion is fed back. Where the controller is not "
    "known, position and speed at the start and one constant offset of what is put in are estimated in each recording."
)
_TOLD = 2.0  # times the least that any noise can be, from which on a recording tells it
_MOST_TOLD = 6  # held-out recordings, each in a line of its own


def held_out(one: Compared) -> str:
    """'chirp was not fitted; the calibrated model is off by: current 0.42 A (floor 0.31 A: 1.35 times it), …'."""
    told = []
    for name, error in one.errors.items():
        shown = error.quantity(of_signal(name, ROTARY))  # by the name in files, which says all
        known = f"floor {shown.text(error.noise_floor)}: {error.in_floors.text} times it"
        floor = f" ({known})" if _has_floor(name, error) else ""
        told.append(f"{in_sentence(shown.title)} {shown.text(error.rmse)}{floor}")
    return f"{one.name or 'the recording'} was not fitted; the calibrated model is off by: {', '.join(told)}"


def verdict(result: Comparison) -> str:
    """'not adequate'."""
    return result.verdict.replace("_", " ")


def of_floor(result: Comparison) -> str:
    """'All signals together, the error is 1.02 times the floor; a true model's is 0.97 to 1.03 (90 % interval). …'

    With each signal's in its unit, those that are above their own band alone, and that of what was held out.
    """
    if result.uninformative:  # whatever the model
        return f"All signals together, the error is {result.in_floors.text} times the floor."
    axes = result.actuator.axes
    counted = {name: one for name, one in result.signals.items() if one.is_counted}
    units = ", ".join(one.in_words(of_signal(name, axes)) for name, one in counted.items())
    told = [f"All signals together, the error is {result.in_floors.beside_band}."]
    if len(counted) > 1:
        told.append(f"That is {units}.")
        told += [
            f"The {in_sentence(of_signal(name, axes).title)} alone is off by {one.in_floors.beside_band}."
            for name, one in counted.items()
            if one.in_floors.is_above and not result.in_floors.is_above
        ]
    if result.unseen is not None:
        told.append(f"On what was not fitted, the error is {result.unseen.beside_band}.")
    return " ".join(told)


def document_of(result: Comparison) -> Document:
    """All that is shown of it in words."""
    notes = [Note(warning) for warning in result.warnings]
    free = free_simulation(result.simulation, result.actuator.axes)
    return Document(
        [
            Lines([*result.sentences, of_floor(result)]),
            *notes,
            errors(result),
            *free,
            *_recordings(result),
            *_why(result),
        ]
    )


def errors(result: Comparison) -> Table:
    """Of each signal, over all recordings that were fitted."""
    axes = result.actuator.axes
    return _error_table(
        "signal", result, [(of_signal(name, axes).title, name, one, "") for name, one in result.signals.items()]
    )


def errors_by_recording(result: Comparison, signal: str) -> Table | None:
    """Of one signal, in each recording, fitted or not; None where there is but one."""
    every = [(one, "") for one in result.recordings] + [(one, ", held out") for one in result.holdout]
    known = [(one.name, signal, one.errors[signal], how) for one, how in every if signal in one.errors]
    title = in_sentence(of_signal(signal, result.actuator.axes).title)
    return _error_table(f"recording, {title}", result, known) if len(known) > 1 else None


def _error_table(title: str, result: Comparison, of: Sequence[tuple[str, str, SignalError, str]]) -> Table:
    """of: by row its name, the signal, its error, and what else is to be said."""
    rows, units, severities = [], [], []
    for name, signal, error, said in of:
        shown = error.quantity(of_signal(signal, result.actuator.axes))
        has_floor = _has_floor(signal, error)
        floor = error.noise_floor if has_floor else math.nan
        over = error.in_floors if has_floor else UNKNOWN
        before = [error.rmse_initial] if result.calibration is not None else []
        numbers = [number(shown.factor * one) for one in (*before, error.rmse, floor)]
        mean, share = number(shown.factor * error.mean_absolute), f"{number(100.0 * error.nrmse)} %"
        rows.append([name, *numbers, mean, share, over.text])
        units.append(f"{shown.unit}{said}{_remark(error)}")
        severities.append(over.severity if error.is_counted and not error.silent else "note")
    head = ["before"] if result.calibration is not None else []
    head += ["rms error", "floor", "mean |e|", "of range", "error / floor"]
    return Table(head, rows, title, units, severities=severities)


def free_simulation(simulation: Mapping[str, Simulated], axes: Axes) -> list[Table | Lines]:
    """The errors of the model running freely, and a line for each reason why there is none."""
    if not simulation:
        return []
    held = any(one.holdout is not None for one in simulation.values())
    rows, units, said = [], [], []
    missing: dict[tuple[str, str], list[str]] = {}  # signals by their reason, and what it is of
    for name, one in simulation.items():
        scores = [one.fitted, *([one.holdout or without("")] if held else [])]
        shown = of_signal(name, axes).scaled([score.rmse for score in scores])
        rows.append([shown.title, *(cell for score in scores for cell in _score(score, shown))])
        units.append(shown.unit)
        for what, score in zip(("", " on what was not fitted"), scores):
            if score.reason:
                missing.setdefault((score.reason, what), []).append(in_sentence(shown.title))
        if one.at_fitted_offset is not None and math.isfinite(one.at_fitted_offset.rmse):
            size = shown.text(one.at_fitted_offset.rmse)
            said.append(
                f"Held out, with the fitted recordings' offset instead of its own, the {in_sentence(shown.title)} "
                f"is off by {size} rms."
            )
    none = [
        f"No free simulation of the {all_of(titles)}{what}: {reason}." for (reason, what), titles in missing.items()
    ]
    head = ["rms error", "mean |e|", "of range"]
    head += ["held out: rms", "mean |e|", "of range"] if held else []
    return [Table(head, rows, "free simulation", units), *([Lines([*none, *said])] if none or said else [])]


def _score(score: Score, shown: Quantity) -> list[str]:
    """rms error, mean absolute error, and share of the range; '–' where there is none."""
    numbers = [number(shown.factor * one) if math.isfinite(one) else "–" for one in (score.rmse, score.mae)]
    return [*numbers, f"{number(score.percent_of_range)} %" if math.isfinite(score.percent_of_range) else "–"]


def _has_floor(signal: str, error: SignalError) -> bool:
    """Whether a recording tells the signal's noise; that of a speed which is 0 for most of the time does not.

    What is pooled has the floor that it is counted in.
    """
    return error.is_counted or error.noise_floor > _TOLD * least_noise(signal)


def _remark(error: SignalError) -> str:
    """What is to be known of an error over the floor."""
    if error.silent:
        return ", uninformative"
    return "" if error.is_counted else ", not counted"


def details(result: Comparison, region: Region) -> str:
    """'Motor angle 10 … 20 °: residual current 42 mA rms, 40 mA on average; 2.3 times the floor, …'"""
    axes = result.actuator.axes
    axis = of_variable(region.variable, axes).scaled([region.low, region.high])
    shown = of_residual(region.signal, axes).scaled(region.rmse)
    low, high = (number(axis.factor * value) for value in (region.low, region.high))
    return (
        f"{axis.title} {low} … {high} {axis.unit}: {in_sentence(shown.title)} {shown.text(region.rmse)} rms, "
        f"{shown.text(region.mean)} on average; {number(region.excess)} times the floor, "
        f"in {np.count_nonzero(region.blocks)} of {len(region.blocks)} blocks."
    )


def _recordings(result: Comparison) -> Iterator[Table | Lines]:
    if (table := errors_by_recording(result, result.primary)) is not None:
        yield table
    if 0 < len(result.holdout) <= _MOST_TOLD:
        yield Lines([held_out(one) for one in result.holdout])


def _why(result: Comparison) -> Iterator[Table | Lines | Note]:
    axes = result.actuator.axes
    if result.explained_by:
        rows, remarks = [], []
        for one in result.explained_by[:6]:
            rows.append([dependence(one.variable, one.modulator), f"{100.0 * one.share:.1f} %"])
            remarks.append("" if one.significant else "within noise")
        yield Table(
            ("cross-validated",), rows, "what explains the residual", remarks, "share of its variance; shares overlap"
        )
    if result.orders:
        told = of_residual(result.primary, axes, result.residuals.torque_constant)
        shown = told.scaled(result.orders[0].amplitude)
        found = ", ".join(f"{one.order} ({shown.text(one.amplitude)})" for one in result.orders[:8])
        yield Lines([f"orders per revolution: {found}"])
    if result.calibration is not None and (table := calibration_table(result.calibration, axes)) is not None:
        yield table
        yield from map(Note, together(result.calibration, axes))


# --- a comparison in plain numbers, as `emaviz compare --json` writes it ----------------------------------------------
# What each field means, and where it is from.


class SignalErrorJson(TypedDict):
    """How far the model is from one signal, in the unit that ends the signal's name."""

    rmse: Annotated[float | None, Meta(description="root mean square of measurement − model; null: it diverges")]
    nrmse: Annotated[float | None, Meta(description="rmse over the range of the measured signal; null: it is constant")]
    noise_floor: Annotated[
        float | None, Meta(description="rms that a perfect model would leave: noise and model floor")
    ]
    rmse_initial: Annotated[float | None, Meta(description="rmse before the calibration, with the file's parameters")]
    mean_absolute: Annotated[float | None, Meta(description="mean of |measurement − model|")]
    over_floor: Annotated[
        float | None, Meta(description="rms of the error over the floor of the same moment; null: none is known")
    ]
    floor_band: Annotated[
        list[float | None], Meta(description="between which over_floor of nine of ten true models lies")
    ]
    counted: Annotated[bool, Meta(description="whether the pooled over_floor counts it; a speed beside a position: no")]
    informative: Annotated[
        bool, Meta(description="false: the signal is constant, or no larger than its floor, and tells nothing")
    ]


class SimulatedJson(TypedDict):
    """How far the model is from one signal when it runs freely from the recordings' first state on."""

    rmse: Annotated[float | None, Meta(description="rms error over all fitted recordings; null: see reason")]
    mae: Annotated[float | None, Meta(description="mean absolute error, likewise")]
    percent_of_range: Annotated[float | None, Meta(description="rmse, % of the measured signal's range")]
    reason: Annotated[str, Meta(description="why there is no number; empty where there is one")]
    holdout_rmse: Annotated[float | None, Meta(description="rmse of recordings that were not fitted; null: none")]
    holdout_mae: Annotated[float | None, Meta(description="mae of the same")]
    holdout_percent_of_range: Annotated[float | None, Meta(description="percent_of_range of the same")]
    holdout_reason: Annotated[str, Meta(description="why there is no number of those that were held out")]
    holdout_rmse_at_fitted_offset: Annotated[
        float | None,
        Meta(description="holdout_rmse in open loop with the fitted recordings' offset, not with their own"),
    ]
    unit: Annotated[str, Meta(description="of rmse and mae")]


class ParameterJson(TypedDict):
    """A calibrated parameter, in its `unit`."""

    value: Annotated[float, Meta(description="what was found")]
    initial: Annotated[float, Meta(description="what the actuator's file says")]
    interval90: Annotated[
        IntervalJson | None, Meta(description="the ends of the 90 % interval about value; null: see from_file")
    ]
    from_file: Annotated[bool, Meta(description="whether the recordings tell nothing beyond the file's tolerance")]
    unit: Annotated[str, Meta(description="of value, initial and interval90; empty for a ratio")]
    z: Annotated[float, Meta(description="value − initial, in σ of the file's tolerance")]
    at_bound: Annotated[bool, Meta(description="whether the fit ended at the end of what is allowed")]


class CalibrationJson(TypedDict):
    """The fit of the actuator's parameters within their tolerances."""

    converged: Annotated[bool, Meta(description="whether several starts end in the same minimum")]
    evaluations: Annotated[int, Meta(description="how many times the recordings were simulated")]
    parameters: Annotated[
        dict[str, ParameterJson], Meta(description="by the names in the actuator's file, section.name, and k1 … k8")
    ]
    starts: Annotated[
        dict[str, ParameterJson],
        Meta(
            description="of the recordings: turned N is the motor's offset at the start, faster N its speed's, pull N "
            "that of the torque that its drive asked for, play N where in the backlash it was, lag N by how much later "
            "than the positions the current was recorded"
        ),
    ]
    outside_tolerance: Annotated[list[str], Meta(description="parameters that end at the edge of their tolerance")]
    confounded: Annotated[list[list[str]], Meta(description="pairs of parameters that are known only together")]


class ExplanationJson(TypedDict):
    """How much of a residual one variable tells ahead, times a modulator."""

    variable: Annotated[str, Meta(description="motor_angle, user_position, motor_speed, acceleration, current, …")]
    modulator: Annotated[str, Meta(description="what the curve is multiplied by: 1, current or sign_speed")]
    r2: Annotated[
        float | None, Meta(description="share of the residual's power as it is, cross-validated; shares overlap")
    ]
    significant: Annotated[bool, Meta(description="whether noise alone would seldom show as much")]
    signal: Annotated[str, Meta(description="whose residual it is")]
    sentence: Annotated[str, Meta(description="the same in words")]


class OrderJson(TypedDict):
    """A part of the primary residual that repeats with the motor: amplitude · sin(order · θ + phase)."""

    order: Annotated[float, Meta(description="periods per revolution; rad/m where the motor's axis is linear")]
    amplitude: Annotated[float, Meta(description="in the primary signal's unit")]
    phase_rad: Annotated[float, Meta(description="rad")]


_Range = TypedDict(
    "_Range",
    {
        "from": Annotated[float, Meta(description="where the range begins, in the variable's SI unit")],
        "to": Annotated[float, Meta(description="where it ends, likewise")],
    },
)


class RegionJson(_Range):
    """A range of a variable in which the model fails most."""

    signal: Annotated[str, Meta(description="whose residual it is")]
    variable: Annotated[str, Meta(description="what the range is of: motor_speed, time, …")]
    rmse: Annotated[float | None, Meta(description="of the residual there, in the signal's unit")]
    mean: Annotated[float | None, Meta(description="of the residual there, measurement − model, in the signal's unit")]
    over_floor: Annotated[float | None, Meta(description="rms of the error over the floor there")]
    sentence: Annotated[str, Meta(description="the same in words")]


class EventJson(TypedDict):
    """A step of a residual at one moment of a recording."""

    recording: Annotated[str, Meta(description="its name")]
    time_s: Annotated[float, Meta(description="s, as recorded")]
    signal: Annotated[str, Meta(description="whose residual it is")]
    change: Annotated[float, Meta(description="after less before, in the signal's unit")]
    by_direction: Annotated[bool, Meta(description="whether it turns over with the direction of motion, as friction")]
    share: Annotated[float, Meta(description="0 … 1, of what the signal's residual has beyond its floor")]
    sentence: Annotated[str, Meta(description="the same in words")]


class HeldOutJson(TypedDict):
    """One recording beside the model."""

    name: Annotated[str, Meta(description="the file's name without its ending, #N for the run N of a file")]
    signals: Annotated[dict[str, SignalErrorJson], Meta(description="its errors, by signal")]


class ComparedJson(HeldOutJson):
    """One fitted recording beside the model."""

    notes: Annotated[list[str], Meta(description="what reading it found and did")]
    health: Annotated[HealthJson, Meta(description="what its own numbers say of its quality")]


class ComparisonJson(TypedDict):
    """Where the model fails beside the recordings of one actuator."""

    verdict: Annotated[str, Meta(description=f"one of {', '.join(COMPARISON_VERDICTS)}")]
    adequate: Annotated[bool, Meta(description="whether what is left may be noise and the model's own floor")]
    over_floor: Annotated[
        float | None, Meta(description="rms error pooled over signals, in units of the floor; 1 is the floor")
    ]
    floor_band: Annotated[list[float], Meta(description="between which over_floor of nine of ten true models lies")]
    within_band: Annotated[
        bool,
        Meta(description="whether no error is above its band: pooled, of the primary signal, held out"),
    ]
    holdout_over_floor: Annotated[
        float | None, Meta(description="over_floor of what was not fitted; null: nothing was held out")
    ]
    holdout_floor_band: Annotated[list[float] | None, Meta(description="floor_band of the same")]
    sentences: Annotated[list[str], Meta(description="the answer in words, the first one first")]
    warnings: Annotated[list[str], Meta(description="what the answer must be read with")]
    signals: Annotated[dict[str, SignalErrorJson], Meta(description="errors over all fitted recordings, by signal")]
    primary: Annotated[str, Meta(description="the signal whose residual is explained")]
    calibration: Annotated[CalibrationJson | None, Meta(description="null where none was asked for")]
    identifiable: Annotated[list[CombinationJson], Meta(description="what the recordings tell only together")]
    explained_by: Annotated[list[ExplanationJson], Meta(description="what goes with the primary residual, best first")]
    orders: Annotated[list[OrderJson], Meta(description="of the primary residual, strongest first; significant ones")]
    worst_regions: Annotated[list[RegionJson], Meta(description="where the model fails most, worst first")]
    events: Annotated[list[EventJson], Meta(description="what happened at one moment")]
    simulation: Annotated[
        dict[str, SimulatedJson],
        Meta(description="of the model running freely, driven by the command, or in open loop; by signal"),
    ]
    recordings: Annotated[list[ComparedJson], Meta(description="those that were fitted, one by one")]
    holdout: Annotated[list[HeldOutJson], Meta(description="those that were not fitted, beside the calibrated model")]


def as_dict(comparison: Comparison) -> ComparisonJson:
    """Everything but the series, in numbers and texts that JSON can hold; unknown numbers are None."""
    document: ComparisonJson = {
        "verdict": comparison.verdict,
        "adequate": comparison.adequate,
        "over_floor": comparison.over_floor,
        "floor_band": list(comparison.floor_band),
        "within_band": comparison.is_within_band,
        "holdout_over_floor": None if comparison.unseen is None else comparison.unseen.error,
        "holdout_floor_band": None if comparison.unseen is None else list(comparison.unseen.band),
        "sentences": list(comparison.sentences),
        "warnings": list(comparison.warnings),
        "signals": {name: _error(error) for name, error in comparison.signals.items()},
        "primary": comparison.primary,
        "calibration": None
        if comparison.calibration is None
        else calibration_dict(comparison.calibration, comparison.actuator.axes),
        "identifiable": combinations(
            () if comparison.calibration is None else comparison.calibration.identifiable, comparison.actuator.axes
        ),
        "explained_by": [
            {
                "variable": one.variable,
                "modulator": one.modulator,
                "r2": one.share,
                "significant": one.significant,
                "signal": one.signal,
                "sentence": one.sentence,
            }
            for one in comparison.explained_by
        ],
        "orders": [
            {"order": one.order, "amplitude": one.amplitude, "phase_rad": one.phase} for one in comparison.orders
        ],
        "worst_regions": [_region(one) for one in comparison.worst_regions],
        "events": [event_dict(one) for one in comparison.events],
        "simulation": simulation_dict(comparison.simulation),
        "recordings": [_compared(one) for one in comparison.recordings],
        "holdout": [{"name": one.name, "signals": _errors_of(one)} for one in comparison.holdout],
    }
    return plain(document)


def _region(one: Region) -> RegionJson:
    return {
        "signal": one.signal,
        "variable": one.variable,
        "from": one.low,
        "to": one.high,
        "rmse": one.rmse,
        "mean": one.mean,
        "over_floor": one.excess,
        "sentence": one.sentence,
    }


def _compared(one: Compared) -> ComparedJson:
    return {
        "name": one.name,
        "notes": list(one.measurement.notes),
        "health": one.health.as_dict(),
        "signals": _errors_of(one),
    }


def _errors_of(one: Compared) -> dict[str, SignalErrorJson]:
    return {name: _error(error) for name, error in one.errors.items()}


def event_dict(one: Event) -> EventJson:
    """A step at one moment of a recording."""
    return {
        "recording": one.name,
        "time_s": one.time_s,
        "signal": one.signal,
        "change": one.change,
        "by_direction": one.by_direction,
        "share": one.share,
        "sentence": one.sentence,
    }


def simulation_dict(simulation: Mapping[str, Simulated]) -> dict[str, SimulatedJson]:
    """The free simulation's errors by signal; numbers that are not known are NaN."""
    found: dict[str, SimulatedJson] = {}
    for name, one in simulation.items():
        held = one.holdout or without("")
        found[name] = {
            "rmse": one.fitted.rmse,
            "mae": one.fitted.mae,
            "percent_of_range": one.fitted.percent_of_range,
            "reason": one.fitted.reason,
            "holdout_rmse": held.rmse,
            "holdout_mae": held.mae,
            "holdout_percent_of_range": held.percent_of_range,
            "holdout_reason": held.reason,
            "holdout_rmse_at_fitted_offset": (one.at_fitted_offset or without("")).rmse,
            "unit": SIGNALS[name].unit,
        }
    return found


def _error(error: SignalError) -> SignalErrorJson:
    return {
        "rmse": error.rmse,
        "nrmse": error.nrmse,
        "noise_floor": error.noise_floor,
        "rmse_initial": error.rmse_initial,
        "mean_absolute": error.mean_absolute,
        "over_floor": error.in_floors.error,
        "floor_band": list(error.in_floors.band),
        "counted": error.is_counted,
        "informative": not error.silent,
    }


def calibration_dict(calibration: Calibration, axes: Axes) -> CalibrationJson:
    """A calibration's parameters by the names in files."""
    return {
        "converged": calibration.converged,
        "evaluations": calibration.evaluations,
        "parameters": {on_axes(name, axes).path: parameter_dict(one) for name, one in calibration.parameters.items()},
        "starts": {name: parameter_dict(one) for name, one in calibration.starts.items()},
        "outside_tolerance": [on_axes(name, axes).path for name in calibration.outside_tolerance],
        "confounded": [[on_axes(a, axes).path, on_axes(b, axes).path] for a, b in calibration.confounded],
    }


def parameter_dict(one: Calibrated) -> ParameterJson:
    """One calibrated parameter."""
    return {
        "value": one.value,
        "initial": one.initial,
        "interval90": None if one.from_file else list(one.interval90),
        "from_file": one.from_file,
        "unit": one.unit,
        "z": one.z,
        "at_bound": one.at_bound,
    }
