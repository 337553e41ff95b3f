"""A comparison in words: its sentences, the errors, what explains them, the calibration."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ema_model.actuator.naming import on_axes
from ema_model.comparison.result import Compared, Comparison
from ema_model.quantities.axes import ROTARY
from ema_model.quantities.numbers import Quantity, number
from ema_model.quantities.shown import of_residual, of_signal
from ema_model.quantities.titles import in_sentence
from ema_model.text import Document, Lines, Note, Table

_MOST_TOLD = 6  # held-out recordings, each in a line of its own


def held_out(one: Compared) -> str:
    """'chirp was not fitted: the equivalent current is off by 0.42 A (floor 0.31 A), …'."""
    told = []
    for name, error in one.errors.items():
        shown = error.quantity(of_signal(name, ROTARY))  # by the name in files, which says all
        told.append(f"{in_sentence(shown.title)} {shown.text(error.rmse)} (floor {shown.text(error.noise_floor)})")
    return f"{one.name or 'the recording'} was not fitted; the calibrated model is off by: {', '.join(told)}"


def document_of(result: Comparison) -> Document:
    """All that the terminal and a notebook show."""
    notes = [Note(warning) for warning in result.warnings]
    return Document([Lines(result.sentences), *notes, _signals(result), *_recordings(result), *_why(result)])


def _signals(result: Comparison) -> Table:
    rows, units = [], []
    for name, error in result.signals.items():
        shown = error.quantity(of_signal(name, result.actuator.axes))
        numbers = (error.rmse, error.rmse_initial, error.noise_floor, error.mean_absolute)
        rows.append([name, *_scaled(numbers, shown)])
        units.append(shown.unit)
    return Table(("rms error", "initially", "floor", "mean |e|"), rows, "signal", units)


def per_recording(result: Comparison) -> Table | None:
    """The error of each recording, fitted or held out, in the primary signal; None where there is but one."""
    every = [(one, "") for one in result.recordings] + [(one, "held out") for one in result.holdout]
    largest = max((one.errors[result.primary].rmse for one, _ in every if result.primary in one.errors), default=0.0)
    shown = of_signal(result.primary, result.actuator.axes).scaled(largest)
    rows, remarks = [], []
    for one, remark in every:
        if result.primary in one.errors:
            error = one.errors[result.primary]
            over = number(error.rmse / error.noise_floor) if error.noise_floor > 0.0 else "–"
            rows.append([one.name, *_scaled((error.rmse, error.noise_floor, error.mean_absolute), shown), over])
            remarks.append(remark)
    if len(rows) < 2:
        return None
    head = ("rms error", "floor", "mean |e|", "error / floor")
    return Table(head, rows, "recording", remarks, f"{shown.unit}, of {result.primary}")


def _recordings(result: Comparison) -> Iterator[Table | Lines]:
    if (table := per_recording(result)) is not None:
        yield table
    if 0 < len(result.holdout) <= _MOST_TOLD:
        yield Lines([held_out(one) for one in result.holdout])


def _why(result: Comparison) -> Iterator[Table | Lines]:
    axes = result.actuator.axes
    if result.explained_by:
        rows, remarks = [], []
        for one in result.explained_by[:6]:
            modulator = "" if one.modulator == "1" else f" × {one.modulator}"
            rows.append([one.variable + modulator, f"{100.0 * one.r2:.1f} %"])
            remarks.append("" if one.significant else "within noise")
        yield Table(("cross-validated",), rows, "what explains the residual", remarks, "share of its variance")
    if result.orders:
        told = of_residual(result.primary, axes, result.residuals.torque_constant)
        shown = told.scaled(result.orders[0].amplitude)
        found = ", ".join(f"{one.order} ({shown.text(one.amplitude)})" for one in result.orders[:8])
        yield Lines([f"orders per revolution: {found}"])
    if result.calibration is not None and result.calibration.parameters:
        rows, remarks = [], []
        for name, one in result.calibration.parameters.items():
            half = 0.5 * (one.interval90[1] - one.interval90[0])
            rows.append([on_axes(name, axes).path, f"{one.value:.5g}", f"{half:.2g}", f"{one.z:.2f}"])
            remarks.append(f"{one.unit}{'  at its bound' if one.at_bound else ''}")
        state = "converged" if result.calibration.converged else "NOT converged"
        yield Table(("value", "± (90 %)", "z"), rows, f"calibration {state}", remarks)


def _scaled(values: Sequence[float], shown: Quantity) -> list[str]:
    return [number(shown.factor * value) for value in values]
