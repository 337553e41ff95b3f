"""What a comparison finds: the result, and its words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.parameters import on_axes
from ema_model.comparison.explain import Explanation, Order
from ema_model.comparison.free_simulation import FreeError, Score, Simulated, errors_in_units, without
from ema_model.comparison.regions import Event, Region
from ema_model.comparison.residuals import UNKNOWN, OverFloor, Residuals, dependence
from ema_model.estimation.calibrate import Calibration, KnownTogether, calibration_table, combinations, together
from ema_model.quantities import (
    ROTARY,
    Axes,
    Quantity,
    all_of,
    in_sentence,
    number,
    of_residual,
    of_signal,
    of_variable,
)
from ema_model.recordings import Measurement
from ema_model.recordings.health import Health
from ema_model.recordings.signals import least_noise
from ema_model.result import NULL, Result, as_named
from ema_model.text import Document, Lines, Note, Table

# --- what a comparison finds, in the words and numbers that the screen, the report and JSON show ----------------------

Array = NDArray[np.float64]
Band = tuple[float, float]

COMPARISON_VERDICTS = ("adequate", "not_adequate", "uninformative")


@dataclass(frozen=True)
class SignalError:
    """How far the model is from one signal, in the unit that ends the signal's name."""

    rmse: Annotated[float, Meta(description="root mean square of measurement − model; null: it diverges", extra=NULL)]
    rmse_initial: Annotated[
        float, Meta(description="rmse before the calibration, with the file's parameters", extra=NULL)
    ]
    nrmse: Annotated[
        float, Meta(description="rmse over the range of the measured signal; null: it is constant", extra=NULL)
    ]
    noise_floor: Annotated[
        float, Meta(description="rms that a perfect model would leave: noise and model floor", extra=NULL)
    ]
    mean_absolute: Annotated[float, Meta(description="mean of |measurement − model|", extra=NULL)]
    signal_rms: float = math.nan  # of what was measured; of a position about its mean
    silent: str = ""  # why the signal tells nothing of the model, as of `estimation.noise.tells_nothing`
    in_floors: OverFloor = UNKNOWN  # the error over the floor of the same moment; no quotient of the numbers above
    is_counted: Annotated[
        bool, as_named("counted", "whether the pooled over_floor counts it; a speed beside a position: no")
    ] = True

    @property
    def over_floor(
        self,
    ) -> Annotated[
        float,
        Meta(description="rms of the error over the floor of the same moment; null: none is known", extra=NULL),
    ]:
        """As `in_floors` has it."""
        return self.in_floors.error

    @property
    def floor_band(
        self,
    ) -> Annotated[Band, Meta(description="between which over_floor of nine of ten true models lies", extra=NULL)]:
        """As `in_floors` has it."""
        return self.in_floors.band

    @property
    def informative(
        self,
    ) -> Annotated[
        bool, Meta(description="false: the signal is constant, or no larger than its floor, and tells nothing")
    ]:
        """Whether it is not silent."""
        return not self.silent

    def in_words(self, signal: Quantity) -> str:
        """'equivalent current 42.1 mA rms'."""
        return f"{in_sentence(signal.title)} {self.quantity(signal).text(self.rmse)} rms"

    def quantity(self, signal: Quantity) -> Quantity:
        """The signal in the prefix that all numbers of its error are written with."""
        return signal.scaled([self.rmse, self.noise_floor])


@dataclass(frozen=True, eq=False)
class Compared:
    """One recording beside the model; all arrays are (blocks,)."""

    name: Annotated[str, Meta(description="the file's name without its ending, #N for the run N of a file")]
    measurement: Measurement  # as it was compared
    health: Annotated[Health, Meta(description="what its own numbers say of its quality")]
    time_s: Array
    measured: dict[str, Array]
    initial: dict[str, Array]  # the model with the file's parameters
    model: dict[str, Array]  # the model after calibration (the same without one)
    sigma: dict[str, Array]  # standard deviation that a perfect model would leave
    errors: Annotated[dict[str, SignalError], as_named("signals", "its errors, by signal")]

    @property
    def notes(self) -> Annotated[Sequence[str], Meta(description="what reading it found and did")]:
        """Of the measurement."""
        return self.measurement.notes


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Result):
    """Where the model fails beside the recordings of one actuator."""

    actuator: Actuator  # as given
    calibration: Annotated[Calibration | None, Meta(description="null where none was asked for")]
    recordings: Annotated[Sequence[Compared], Meta(description="those that were fitted, one by one")]
    residuals: Residuals  # joined
    signals: Annotated[dict[str, SignalError], Meta(description="errors over all fitted recordings, by signal")]
    primary: Annotated[str, Meta(description="the signal whose residual is explained")]
    explained_by: Annotated[Sequence[Explanation], Meta(description="what goes with the primary residual, best first")]
    orders: Annotated[Sequence[Order], Meta(description="of the primary residual, strongest first; significant ones")]
    worst_regions: Annotated[Sequence[Region], Meta(description="where the model fails most, worst first")]
    adequate: Annotated[bool, Meta(description="whether what is left may be noise and the model's own floor")]
    over_floor: Annotated[
        float, Meta(description="rms error pooled over signals, in units of the floor; 1 is the floor", extra=NULL)
    ]
    floor_band: Annotated[Band, Meta(description="between which over_floor of nine of ten true models lies")]
    sentences: Annotated[Sequence[str], Meta(description="the answer in words, the first one first")]
    warnings: Annotated[Sequence[str], Meta(description="what the answer must be read with")] = ()
    events: Annotated[Sequence[Event], Meta(description="what happened at one moment")] = ()
    holdout: Annotated[
        Sequence[Compared], Meta(description="those that were not fitted, beside the calibrated model")
    ] = ()
    unseen: OverFloor | None = None  # the pooled error of what was held out; None without any
    uninformative: bool = False  # the recordings tell nothing of the model, so that it is not adequate either
    simulation: Mapping[str, Simulated] = field(default_factory=dict)  # of the model running freely, by signal

    def name_in_files(self, name: str) -> str:
        """A parameter's path on the actuator's axes."""
        return on_axes(name, self.actuator.axes).path

    @property
    def verdict(self) -> Annotated[str, Meta(description=f"one of {', '.join(COMPARISON_VERDICTS)}")]:
        """One of `COMPARISON_VERDICTS`."""
        return "uninformative" if self.uninformative else "adequate" if self.adequate else "not_adequate"

    @property
    def in_floors(self) -> OverFloor:
        """The pooled error of what was fitted, with its band."""
        return OverFloor(self.over_floor, self.floor_band)

    @property
    def is_within_band(
        self,
    ) -> Annotated[
        bool,
        as_named("within_band", "whether no error is above its band: pooled, of the primary signal, held out"),
    ]:
        """Whether no error is above its band: that of all signals, of the explained one, of what was held out."""
        told = [self.in_floors, self.signals[self.primary].in_floors, *([] if self.unseen is None else [self.unseen])]
        return not any(one.is_above for one in told)

    @property
    def holdout_over_floor(
        self,
    ) -> Annotated[float | None, Meta(description="over_floor of what was not fitted; null: nothing was held out")]:
        """As `unseen` has it."""
        return None if self.unseen is None else self.unseen.error

    @property
    def holdout_floor_band(self) -> Annotated[Band | None, Meta(description="floor_band of the same")]:
        """As `unseen` has it."""
        return None if self.unseen is None else self.unseen.band

    @property
    def identifiable(
        self,
    ) -> Annotated[list[KnownTogether], Meta(description="what the recordings tell only together")]:
        """Of the calibration."""
        return [] if self.calibration is None else combinations(self.calibration.identifiable, self.actuator.axes)

    @property
    def free_errors(
        self,
    ) -> Annotated[
        dict[str, FreeError],
        as_named("simulation", "of the model running freely, driven by the command, or in open loop; by signal"),
    ]:
        """Of `simulation`, by signal."""
        return errors_in_units(self.simulation)


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
