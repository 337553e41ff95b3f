"""A comparison: where the model fails, what explains it, each recording beside the model; and its .rrd."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.comparison.regions import Region, worst_moment
from ema_model.comparison.result import (
    FLOOR_NOTE,
    FREE_NOTE,
    Compared,
    Comparison,
    details,
    errors,
    errors_by_recording,
    free_simulation,
    held_out,
    of_floor,
    verdict,
)
from ema_model.errors import InputError
from ema_model.estimation.calibrate import calibration_table, convergence, warnings
from ema_model.estimation.noise import BAND_SIGMAS
from ema_model.quantities import VARIABLES, number, variable_title
from ema_model.recordings.health import MARKS
from ema_model.text import Lines, Note, Table
from emaviz.figures import campaign, comparison
from emaviz.recording.entry import RecordingError, configured
from emaviz.text.verdicts import of_comparison
from emaviz.views import Bullets, Group, Line, Links, Piece, Row, Section, Verdict, View

if TYPE_CHECKING:
    from emaviz.recording.writer import RecordingWriter

Array = NDArray[np.float64]

# --- the answer, and how far the model is from each signal, against the floor -----------------------------------------


def _answer(result: Comparison) -> Iterator[Piece]:
    told = verdict(result)
    first, *others = result.sentences or (f"The model is {told}.",)
    yield Verdict(told, of_comparison(result))
    yield Line(first, "answer")
    yield from map(Line, [*others, of_floor(result)])
    yield Bullets(result.warnings, "warning")


def _errors(result: Comparison) -> Iterator[Piece]:
    """A table over all recordings, that of the free simulation, and one for each signal by recording."""
    yield errors(result)
    yield Line(FLOOR_NOTE, "small")
    yield from of_free_simulation(free_simulation(result.simulation, result.actuator.axes))
    for name in result.signals:
        if (told := errors_by_recording(result, name)) is not None:
            title = f"{comparison.quantity_of_signal(result, name).title}, by recording"
            yield Group(title, [told], folded=name != result.primary)


def of_free_simulation(parts: Sequence[Table | Lines]) -> Iterator[Piece]:
    """Its table and its reasons, and what is to be known of them."""
    yield from (one if isinstance(one, Table) else Bullets(one.lines) for one in parts)
    if parts:
        yield Line(FREE_NOTE, "small")


def _held_out(result: Comparison) -> Iterator[Piece]:
    """How far the calibrated model is from recordings that were not fitted."""
    if result.holdout:
        yield Bullets([held_out(one) for one in result.holdout])


# --- where the model fails most: each region in words, against its variable, and where it is in time ------------------

_STAYS = 8.0  # times the stay in the region is shown
_LEAST_BLOCKS = 400


def _regions(result: Comparison) -> Iterator[Piece]:
    """A card for each region, worst first, with links to the full figures."""
    if not result.worst_regions:
        yield Line("No region stands out of the floor.")
    for i, region in enumerate(result.worst_regions, 1):
        yield Group(f"{i}. {region.sentence}", [*_card(result, region)], f"region-{i}", framed=True)


def _card(result: Comparison, region: Region) -> Iterator[Piece]:
    recording, block = worst_moment(result.residuals, region)
    time_s = float(result.residuals.time_s[block])
    window = _around(result, region, recording, time_s)
    against = comparison.residual_against(result, region.variable, region.signal, highlight=region)
    over_time = comparison.residual_time(
        result, region.signal, recording, highlight=region, moment_s=time_s, window_s=window
    )
    yield Line(details(result, region), "dim")
    yield Row([against, over_time], 300)
    name = result.recordings[recording].name or f"recording {recording + 1}"
    links = {
        f"against-{region.variable}": f"{variable_title(region.variable)}: all of it",
        f"recording-{recording + 1}": f"{name}, worst at {number(time_s, 4)} s",
    }
    yield Links("Seen in", links)


def _around(result: Comparison, region: Region, recording: int, time_s: float) -> tuple[float, float]:
    """A window of time about the worst moment in which the region's stay there can be seen, from–to, s."""
    time = result.recordings[recording].time_s
    first, last = float(time.min()), float(time.max())
    ranges = comparison.time_ranges(result, region, recording)
    stays = [high - low for low, high in ranges if low <= time_s <= high]
    width = max(_STAYS * max(stays, default=0.0), _LEAST_BLOCKS * result.residuals.block_s)
    start = min(max(time_s - 0.5 * width, first), max(last - width, first))
    return start, min(start + width, last)


# --- what explains the residual: the ranking, the orders of the motor's turn, the residual against each variable ------

_FIRST = 4  # explanations are written out; the bars show all
_MOST_ORDERS = 20
_EXPLANATION_NOTE = (
    "A variable explains the residual as far as a curve of it, fitted to a part of the data, tells the rest ahead. "
    "Pale bars are what noise could have made."
)


def _explained(result: Comparison) -> Iterator[Piece]:
    """All of the primary signal; nothing without variables that are known."""
    known = [v for v in VARIABLES if np.any(np.isfinite(result.residuals.variables.get(v, np.zeros(0))))]
    if not known:
        return
    told = [e for e in result.explained_by if e.significant][:_FIRST]
    yield from [Line(e.sentence) for e in told] or [Line("No variable explains it beyond noise.")]
    # a row for each variable and the axis below
    tall = max(260, 100 + 44 * len({e.variable for e in result.explained_by}))
    yield Row([comparison.explained(result)], tall, ["explained-by"])
    yield Line(_EXPLANATION_NOTE, "small")
    if "motor_angle" in known and result.actuator.axes.motor == "rotary":
        turns = [comparison.residual_polar(result), comparison.order_spectrum(result)]
        yield Row(turns, 400, ["polar", "orders"])
        if result.orders:
            yield Group("The orders in numbers", [_orders(result)], folded=True)
    variables = [e.variable for e in result.explained_by if e.variable in known]
    shown = list(dict.fromkeys([*variables, *known]))
    yield Row(
        [comparison.residual_against(result, variable) for variable in shown],
        340,
        [f"against-{variable}" for variable in shown],
    )


def _orders(result: Comparison) -> Table:
    largest = max(order.amplitude for order in result.orders)
    shown = comparison.of_residual(result, result.primary, as_torque=True).scaled(largest)
    rows = [
        [f"{order.order}", shown.text(order.amplitude), f"{np.degrees(order.phase):.0f}°"]
        for order in result.orders[:_MOST_ORDERS]
    ]
    return Table(("amplitude", "phase"), rows, "Periods in each turn")


# --- each recording beside the model, and what is left over time; what calibration moved; the data's health -----------


def _recordings(result: Comparison) -> Iterator[Piece]:
    """The primary signal of each; the others folded away."""
    for i, one in enumerate(result.recordings):
        first = result.primary if result.primary in one.measured else next(iter(one.measured))
        pieces: list[Piece] = [*_over_time(result, first, i)]
        for name in one.measured:
            if name != first:
                title = comparison.quantity_of_signal(result, name).title
                pieces.append(Group(title, [*_over_time(result, name, i)], folded=True))
        yield Group(f"{i + 1}. {one.name or 'recording'}", pieces, f"recording-{i + 1}")


def _over_time(result: Comparison, signal: str, recording: int) -> Iterator[Row]:
    yield Row([comparison.overlay(result, signal, recording)], 360)
    yield Row([comparison.residual_time(result, signal, recording)], 300)


def _calibration(result: Comparison) -> Iterator[Piece]:
    """Convergence, figure, table, warnings; left out where nothing was calibrated."""
    fit, axes = result.calibration, result.actuator.axes
    if fit is None:
        return
    yield Line(convergence(fit), "" if fit.converged else "bad")
    if (told := calibration_table(fit, axes)) is not None:
        yield Row([campaign.calibration_scores(result)], 110 + 30 * len(told.rows), ["scores"])
        yield told
    yield Bullets(warnings(fit, axes), "warning")


def _health(result: Comparison) -> Iterator[Piece]:
    """Each recording's findings, warnings first, and what reading it did."""
    for i, one in enumerate(result.recordings, 1):
        m = one.measurement
        size = f"{m.samples} samples" if m.is_map else f"{m.samples} samples, {m.duration_s:.4g} s"
        found = one.health.worst_first
        marks = [(finding.severity, MARKS[finding.severity]) for finding in found]
        pieces: list[Piece] = [Line(size, "dim"), Bullets([finding.sentence for finding in found], marks=marks)]
        yield Group(f"{i}. {one.name or 'recording'}", [*pieces, Bullets(m.notes, "small")])


# --- as a recording for the Rerun viewer ------------------------------------------------------------------------------

_PAUSE_S = 0.2  # between recordings, so that one is seen to end


def _record(result: Comparison, path: Path, configuration: Mapping[str, Any]) -> None:
    """Writes a whole .rrd file; InputError in one line where that cannot be done.

    Several recordings stand one after another on sim_time, because then every signal has the one path that scripts
    know, and one view shows all of it; the configuration says where each begins.  A signal that was compared is
    there in the block means it was compared by, the others as they were recorded; of a recording whose time starts
    anew in between only those that were compared.
    """
    from emaviz.recording.writer import RecordingWriter, written  # rerun takes a second to import

    try:
        with RecordingWriter(path) as writer:
            times, shifts = _one_after_another(result.recordings)
            writer.config(written("Comparison", _configuration(result, times, shifts, configuration)))
            writer.properties({"comparison": result.to_dict(), "shift_s": shifts})
            for group, signals in _groups(result).items():
                for name, values in signals.items():
                    _write(writer, group, name, times, values)
            raw = [_sample_times(one, shift) for one, shift in zip(result.recordings, shifts)]
            for name in _not_compared(result):
                values = [one.measurement.get(name) for one in result.recordings]
                _write(writer, "measurement", name, raw, values)
            writer.finding("answer", written(f"The model is {verdict(result)}", result.document.blocks))
            writer.finding("regions", written("Worst regions", _worst(result, times)))
    except RecordingError as error:
        raise InputError(str(error)) from None
    if writer.failed is not None:
        raise InputError(writer.failed)


def _one_after_another(recordings: Sequence[Compared]) -> tuple[list[Array], list[float]]:
    """Times of each recording's blocks on sim_time, s, and what was added to them; the first keeps its own.

    A run that starts anew within a recording follows the run before it.
    """
    times, shifts = [], []
    end = None
    for one in recordings:
        time = one.time_s.copy()
        for at in np.flatnonzero(np.diff(time) <= 0.0) + 1:
            time[at:] += time[at - 1] + _PAUSE_S - time[at]
        shift = 0.0 if end is None else end + _PAUSE_S - float(min(time[0], one.measurement.time_s[0]))
        times.append(time + shift)
        shifts.append(shift)
        end = float(max(times[-1][-1], one.measurement.time_s[-1] + shift))
    return times, shifts


def _sample_times(one: Compared, shift: float) -> Array | None:
    """Times of the samples; None where runs start anew, as which blocks they belong to is then not known."""
    time = one.measurement.time_s
    return time + shift if np.all(np.diff(time) > 0.0) else None


def _groups(result: Comparison) -> dict[str, dict[str, list[Array | None]]]:
    """By group and signal, the values of each recording, None where it lacks the signal; the primary signal first."""
    names = sorted(result.signals, key=lambda name: name != result.primary)
    calibrated = result.calibration is not None

    def residual(one: Compared, name: str) -> Array:
        return one.measured[name] - one.model[name]

    of = {
        "measurement": lambda one, name: one.measured[name],
        "monitor": lambda one, name: one.model[name],
        **({"initial": lambda one, name: one.initial[name]} if calibrated else {}),
        "residual": residual,
        "floor_high": lambda one, name: BAND_SIGMAS * one.sigma[name],
        "floor_low": lambda one, name: -BAND_SIGMAS * one.sigma[name],
    }
    return {
        group: {
            name: [take(one, name) if name in one.measured else None for one in result.recordings] for name in names
        }
        for group, take in of.items()
    }


def _write(
    writer: RecordingWriter,
    group: str,
    name: str,
    times: Sequence[Array | None],
    values: Sequence[Array | None],
) -> None:
    """The recordings' values one after another, without what is no number: it would stop the plot's lines."""
    known = [(t, v) for t, v in zip(times, values, strict=True) if t is not None and v is not None]
    if not known:
        return
    time, joined = np.concatenate([t for t, _ in known]), np.concatenate([v for _, v in known])
    finite = np.isfinite(joined)
    writer.signals(group, time[finite], {name: joined[finite]})
    steps = np.diff(time[finite])
    if not len(steps):
        return
    for at in np.flatnonzero(steps > max(0.99 * _PAUSE_S, 5.0 * float(np.median(steps)))):
        writer.gap(group, name, float(time[finite][at]) + 0.5 * float(steps[at]))


def _not_compared(result: Comparison) -> list[str]:
    """Recorded signals that were not compared."""
    names = dict.fromkeys(name for one in result.recordings for name in one.measurement.signals)
    return [name for name in names if name != "time_s" and name not in result.signals]


def _worst(result: Comparison, times: Sequence[Array]) -> list[Lines]:
    if not result.worst_regions:
        return [Lines(["No region stands out of the floor."])]
    time = np.concatenate(times)
    told = []
    for region in result.worst_regions:
        _, at = worst_moment(result.residuals, region)
        told.append(Lines([details(result, region), f"Worst at {time[at]:.4g} s."], region.sentence))
    return told


def _configuration(
    result: Comparison, times: Sequence[Array], shifts: Sequence[float], configuration: Mapping[str, Any]
) -> list[Any]:
    settings = {"actuator": result.actuator.name, **configuration}
    settings["block"] = f"{1e3 * result.residuals.block_s:.4g} ms"
    said = configured(settings, [one.name for one in result.recordings], times, shifts)
    fit, axes = result.calibration, result.actuator.axes
    return [said, *([] if fit is None else [Lines([convergence(fit)]), *map(Note, warnings(fit, axes))])]


# --- the whole, in reading order --------------------------------------------------------------------------------------


def _title(result: Comparison) -> str:
    if result.adequate and not result.is_within_band:
        return "The model leaves a little more than noise"
    titles = {"adequate": "The model is adequate", "uninformative": "The recordings tell nothing of the model"}
    return titles.get(result.verdict, "Where the model fails")


def _lead(result: Comparison) -> str:
    return f"{result.actuator.name} against {', '.join(one.name or 'recording' for one in result.recordings)}"


def _table(result: Comparison) -> Mapping[str, ArrayLike]:
    """A row for each signal, over all recordings; numbers in the unit that ends its name."""
    every = list(result.signals.values())
    numbers = ("rmse", "rmse_initial", "mean_absolute", "nrmse", "noise_floor", "over_floor")
    return {
        "signal": np.array(list(result.signals)),
        **{name: np.array([getattr(one, name) for one in every]) for name in numbers},
    }


VIEW = View(
    of=Comparison,
    name="comparison",
    title=_title,
    lead=_lead,
    sections=(
        Section("The answer", "answer", of=_answer),
        Section("Errors", "errors", of=_errors),
        Section("Not fitted", "held-out", of=_held_out),
        Section("Where it fails", "regions", of=_regions),
        Section("What explains the residual", "explained", of=_explained),
        Section("Recordings", "recordings", of=_recordings),
        Section("Calibration", "calibration", of=_calibration),
        Section("Data health", "health", of=_health),
    ),
    meaning=of_comparison,
    columns=_table,
    record=_record,
)
