"""A comparison in words: its sentences, the errors, what explains them, the calibration."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ema_model.comparison.free_simulation import Score, Simulated, without
from ema_model.comparison.result import Compared, Comparison, Region, SignalError
from ema_model.comparison.sentences import dependence
from ema_model.estimation.calibrate import calibration_table, together
from ema_model.quantities.axes import ROTARY, Axes
from ema_model.quantities.numbers import Quantity, number
from ema_model.quantities.shown import of_residual, of_signal
from ema_model.quantities.titles import in_sentence
from ema_model.quantities.variables import of_variable
from ema_model.recordings.noise import least_noise
from ema_model.text import Document, Lines, Note, Severity, Table

_NEAR_FLOOR, _FAR_FROM_FLOOR = 1.2, 2.0  # error over floor, from which on one is looked at, and stands out
FREE_NOTE = (
    "Free simulation: the model runs from the recordings' first state on, driven by the command alone, or in open loop "
    "by the recorded current, torque or force; nothing of the measured motion is fed back. Where the controller is not "
    "known, position and speed at the start and one constant offset of what is put in are estimated in each recording."
)
_TOLD = 2.0  # times the least that any noise can be, from which on a recording tells it
_MOST_TOLD = 6  # held-out recordings, each in a line of its own


def held_out(one: Compared) -> str:
    """'chirp was not fitted: the equivalent current is off by 0.42 A (floor 0.31 A), …'."""
    told = []
    for name, error in one.errors.items():
        shown = error.quantity(of_signal(name, ROTARY))  # by the name in files, which says all
        floor = f" (floor {shown.text(error.noise_floor)})" if _has_floor(name, error) else ""
        told.append(f"{in_sentence(shown.title)} {shown.text(error.rmse)}{floor}")
    return f"{one.name or 'the recording'} was not fitted; the calibrated model is off by: {', '.join(told)}"


def verdict(result: Comparison) -> str:
    """'not adequate'."""
    return result.verdict.replace("_", " ")


def of_floor(result: Comparison) -> str:
    """'All signals together, the error is 1.02 times the floor; a true model's is 0.97 to 1.03 (90 % interval).'"""
    low, high = result.floor_band
    error = f"All signals together, the error is {number(result.over_floor)} times the floor"
    return f"{error}; a true model's is {low:.2f} to {high:.2f} (90 % interval)."


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
    return _errors(
        "signal", result, [(of_signal(name, axes).title, name, one, "") for name, one in result.signals.items()]
    )


def errors_by_recording(result: Comparison, signal: str) -> Table | None:
    """Of one signal, in each recording, fitted or not; None where there is but one."""
    every = [(one, "") for one in result.recordings] + [(one, ", held out") for one in result.holdout]
    known = [(one.name, signal, one.errors[signal], how) for one, how in every if signal in one.errors]
    title = in_sentence(of_signal(signal, result.actuator.axes).title)
    return _errors(f"recording, {title}", result, known) if len(known) > 1 else None


def _errors(title: str, result: Comparison, of: Sequence[tuple[str, str, SignalError, str]]) -> Table:
    """of: by row its name, the signal, its error, and what else is to be said."""
    rows, units, severities = [], [], []
    for name, signal, error, said in of:
        shown = error.quantity(of_signal(signal, result.actuator.axes))
        floor = error.noise_floor if _has_floor(signal, error) else math.nan
        over = error.rmse / floor
        before = [error.rmse_initial] if result.calibration is not None else []
        numbers = [number(shown.factor * one) for one in (*before, error.rmse, floor)]
        mean, share = number(shown.factor * error.mean_absolute), f"{number(100.0 * error.nrmse)} %"
        rows.append([name, *numbers, mean, share, number(over)])
        units.append(f"{shown.unit}{said}{', uninformative' if error.silent else ''}")
        severities.append(_severity(over) if math.isfinite(over) and not error.silent else "note")
    head = ["before"] if result.calibration is not None else []
    head += ["rms error", "floor", "mean |e|", "of range", "error / floor"]
    return Table(head, rows, title, units, severities=severities)


def free_simulation(simulation: Mapping[str, Simulated], axes: Axes) -> list[Table | Lines]:
    """The errors of the model running freely, and a line for each signal that has none."""
    if not simulation:
        return []
    held = any(one.holdout is not None for one in simulation.values())
    rows, units, said = [], [], []
    for name, one in simulation.items():
        scores = [one.fitted, *([one.holdout or without("")] if held else [])]
        shown = of_signal(name, axes).scaled([score.rmse for score in scores])
        rows.append([shown.title, *(cell for score in scores for cell in _score(score, shown))])
        units.append(shown.unit)
        for what, score in zip(("", " on what was not fitted"), scores):
            if score.reason:
                said.append(f"No free simulation of the {in_sentence(shown.title)}{what}: {score.reason}.")
        if one.at_fitted_offset is not None and math.isfinite(one.at_fitted_offset.rmse):
            size = shown.text(one.at_fitted_offset.rmse)
            said.append(
                f"Held out, with the fitted recordings' offset instead of its own, the {in_sentence(shown.title)} "
                f"is off by {size} rms."
            )
    head = ["rms error", "mean |e|", "of range"]
    head += ["held out: rms", "mean |e|", "of range"] if held else []
    return [Table(head, rows, "free simulation", units), *([Lines(said)] if said else [])]


def _score(score: Score, shown: Quantity) -> list[str]:
    """rms error, mean absolute error, and share of the range; '–' where there is none."""
    numbers = [number(shown.factor * one) if math.isfinite(one) else "–" for one in (score.rmse, score.mae)]
    return [*numbers, f"{number(score.percent_of_range)} %" if math.isfinite(score.percent_of_range) else "–"]


def _has_floor(signal: str, error: SignalError) -> bool:
    """Whether a recording tells the signal's noise; that of a speed which is 0 for most of the time does not."""
    return error.noise_floor > _TOLD * least_noise(signal)


def _severity(over: float) -> Severity:
    return "good" if over < _NEAR_FLOOR else "warning" if over < _FAR_FROM_FLOOR else "bad"


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
            rows.append([dependence(one.variable, one.modulator), f"{100.0 * one.r2:.1f} %"])
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
