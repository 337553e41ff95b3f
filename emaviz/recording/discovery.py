"""A discovery as a recording: its ladder, candidates, and layout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import ArrayLike, NDArray

from ema_model.discovery import Discovery
from ema_model.discovery.words import (
    PAUSE_S,
    Track,
    candidates,
    one_after_another,
    primary,
    rung_title,
    tracks,
    verdict_name,
)
from ema_model.errors import InputError
from ema_model.estimation.calibrate import calibration_table, convergence, warnings
from ema_model.estimation.noise import BAND_SIGMAS
from ema_model.text import Block, Lines, Note
from emaviz import colours
from emaviz.recording import writer as drawn_as
from emaviz.recording.blueprint import Contents, arranged, plot, signal_view
from emaviz.recording.entry import GROUP_COLOURS, ITERATION, RecordingError, configured, plain, series_title
from emaviz.recording.writer import RecordingWriter, written

# --- how a discovery's recording opens: Ladder, Candidates, Signals, Residuals, Configuration -------------------------

LADDER, CANDIDATES, VERDICT = "/discovery/ladder", "/discovery/candidates", "/discovery/verdict"
_AIR = 1.05
_NO_LEGEND = rrb.PlotLegend(visible=False)  # a bar's entry there would be its path: the view's title names the bars


@dataclass(frozen=True)
class Step:
    """The residual of one signal after one step of the ladder."""

    number: int
    title: str  # of the step
    signal: str
    largest: float  # of the residuals of all steps, in the signal's unit: one scale for all


def build(contents: Contents, steps: Sequence[Step]) -> rrb.Blueprint:
    """The tabs, of which the first, the verdict with the ladder beside it, is open."""
    fitted = contents.signals.get("residual", [])
    tabs: list[rrb.Container | rrb.View] = [_ladder(), _candidates()]
    if fitted:
        tabs.append(rrb.Vertical(*(signal_view(contents, name) for name in fitted), name="Signals"))
    if steps:
        tabs.append(rrb.Vertical(*(_residual(step) for step in steps), name="Residuals"))
    if contents.config:
        tabs.append(rrb.TextDocumentView(origin="/config", name="Configuration"))
    return arranged(contents, tabs, active=0)


def _ladder() -> rrb.Container:
    bars = rrb.BarChartView(
        origin="/",
        contents=[f"{LADDER}/fitted", f"{LADDER}/held_out", f"{LADDER}/floor"],
        name="Error over floor after each step (teal, left: fitted; purple, right: held out; grey: the floor, 1)",
        plot_legend=_NO_LEGEND,
    )
    words = rrb.TextDocumentView(origin=VERDICT, name="What was found")
    return rrb.Horizontal(words, bars, column_shares=[1, 1], name="Ladder")


def _candidates() -> rrb.Container:
    bars = rrb.BarChartView(
        origin="/",
        contents=[f"{CANDIDATES}/predicted", f"{CANDIDATES}/refitted"],
        name="Fall of χ² by rank (grey, left: predicted; teal, right: refitted)",
        plot_legend=_NO_LEGEND,
    )
    table = rrb.TextDocumentView(origin=CANDIDATES, name="Ranking")
    return rrb.Horizontal(table, bars, column_shares=[1, 1], name="Candidates")


def _residual(step: Step) -> rrb.View:
    limit = _AIR * step.largest
    return plot(
        f"{series_title('residual', step.signal)}, step {step.number}: {step.title}",
        [f"/{group}/{step.signal}" for group in (f"residual/step_{step.number}", "floor_high", "floor_low")],
        range_=(-limit, limit) if limit > 0.0 else None,
    )


# --- a discovery told as a recording ----------------------------------------------------------------------------------
# A discovery told as a recording: the signals, the ladder of errors, the candidates, what each step leaves.

Array = NDArray[np.float64]

_LINES = {
    "fitted": (*colours.rgb(colours.FITTED), 255),
    "held out": (*colours.rgb(colours.HELD_OUT), 255),
    "floor": GROUP_COLOURS["floor_low"],
}
_WIDTH = 0.36  # of a bar, in steps


def write_discovery(found: Discovery, path: str | Path, configuration: Mapping[str, Any] | None = None) -> None:
    """Writes a whole .rrd file; InputError in one line where that cannot be done.

    Recordings stand one after another on sim_time, as in a comparison's file.  /monitor and /residual are the last
    model's; /residual/step_0/…, /residual/step_1/… are what each step of the ladder leaves.
    """
    runs = tracks(found)
    times, shifts = one_after_another(runs)
    names = sorted(runs[0].measured, key=lambda name: name != primary(found)) if runs else []
    try:
        with DiscoveryWriter(path, found, names[:1]) as writer:
            writer.config(_configuration(found, runs, times, shifts, configuration or {}))
            writer.properties({"discovery": found.to_dict(), "shift_s": shifts})
            writer.document("verdict", written("The verdict", _in_words(found)))
            writer.ladder()
            writer.candidates()
            for name in names:
                _write_signal(writer, name, runs, times, len(found.ladder))
    except RecordingError as error:
        raise InputError(str(error)) from None
    if writer.failed is not None:
        raise InputError(writer.failed)


def _in_words(found: Discovery) -> list[Block]:
    """What is shown of it in words, without the verdict's name: it stands above."""
    first, *others = found.document.blocks
    assert isinstance(first, Lines), "it begins with the verdict"
    named, *more = first.lines
    return [Lines([named.removeprefix(f"{verdict_name(found)}: "), *more]), *others]


def _configuration(
    found: Discovery,
    runs: Sequence[Track],
    times: Sequence[Array],
    shifts: Sequence[float],
    settings: Mapping[str, Any],
) -> str:
    """What was fitted with which options, where each recording stands on sim_time, and the last calibration."""
    said = configured({"actuator": found.actuator.name, **settings}, [one.name for one in runs], times, shifts)
    fit, axes = found.calibration, found.actuator.axes
    told = [Lines([convergence(fit)]), calibration_table(fit, axes), *map(Note, warnings(fit, axes))]
    return written("Discovery", [said, *(one for one in told if one is not None)])


def _write_signal(
    writer: DiscoveryWriter, name: str, runs: Sequence[Track], times: Sequence[Array], steps: int
) -> None:
    known = [(track, time) for track, time in zip(runs, times) if name in track.measured]
    time = np.concatenate([time for _, time in known])

    def joined(parts: Sequence[Array]) -> Array:
        return np.concatenate(parts)

    sigma = joined([track.sigma[name] for track, _ in known])
    groups = {
        "measurement": joined([track.measured[name] for track, _ in known]),
        "monitor": joined([track.models[-1][name] for track, _ in known]),
        "residual": joined([track.residual(name, -1) for track, _ in known]),
        "floor_high": BAND_SIGMAS * sigma,
        "floor_low": -BAND_SIGMAS * sigma,
    }
    gaps = [float(time[at]) + 0.5 * PAUSE_S for at in np.flatnonzero(np.diff(time) > 0.99 * PAUSE_S)]
    for group, values in groups.items():
        writer.signals(group, time, {name: values})
        for at in gaps:
            writer.gap(group, name, at)
    for step in range(steps):
        writer.residual_step(step, name, time, joined([track.residual(name, step) for track, _ in known]))
        for at in gaps:
            writer.gap(f"residual/step_{step}", name, at)


class DiscoveryWriter(RecordingWriter):
    """A recording that also holds what a discovery found, in words, bars and lines."""

    def __init__(self, path: str | Path, found: Discovery, shown: Sequence[str]) -> None:
        """shown: the signals whose residuals are arranged, step by step."""
        super().__init__(path)
        self._found = found
        self._shown = list(shown)
        self._largest: dict[str, float] = {}

    def __enter__(self) -> DiscoveryWriter:
        return self

    def document(self, name: str, text_markdown: str) -> None:
        """Text at /discovery/NAME."""
        with self._file.lock:
            self._text(f"/discovery/{plain(name)}", text_markdown)

    def ladder(self) -> None:
        """Errors in units of the floor: a row for each step, and the same as bars, which need no timeline."""
        rungs = self._found.ladder
        values = {"fitted": [rung.rmse for rung in rungs]}
        held = [rung.holdout_rmse for rung in rungs]
        if all(value is not None and np.isfinite(value) for value in held):
            values["held out"] = [float(value or 0.0) for value in held]
        values["floor"] = [1.0] * len(rungs)
        style = rr.SeriesLines(
            names=[f"{name} [× floor]" for name in values],
            colors=[_LINES[name] for name in values],
            widths=[1.5 if name == "floor" else 3.0 for name in values],
        )
        rows = np.array(list(values.values())).T
        columns = rr.Scalars.columns(scalars=rows.ravel()).partition([len(values)] * len(rungs))
        time = [rr.TimeColumn(ITERATION, sequence=np.arange(len(rungs)))]
        bars = [name for name in values if name != "floor"]
        with self._file.lock:
            self._send_columns(LADDER, style, time, columns)  # pyright: ignore[reportArgumentType]
            for i, name in enumerate(bars):
                at = np.arange(len(rungs)) + _WIDTH * (i - 0.5 * len(bars))  # the left edges
                chart = rr.BarChart(values[name], abscissa=at, color=_LINES[name], widths=[0.9 * _WIDTH] * len(rungs))
                self._static(f"{LADDER}/{name.replace(' ', '_')}", chart)
            edge = rr.BarChart([1.0], abscissa=[-0.5], color=(134, 142, 150, 60), widths=[len(rungs)])
            self._static(f"{LADDER}/floor", edge)

    def candidates(self) -> None:
        """The ranking as a table, and as bars in its order."""
        chosen = [one for one in self._found.ranked if not one.obstacle]
        with self._file.lock:
            told = candidates(self._found) or Lines(["None was scored."])
            self._text(CANDIDATES, written("Candidates", [told]))
            if chosen:
                at = np.arange(1, len(chosen) + 1)
                predicted = [one.predicted_drop for one in chosen]
                refitted = [max(one.refitted_drop or 0.0, 0.0) for one in chosen]
                for name, values, side, colour in (
                    ("predicted", predicted, -1.0, (*colours.rgb(colours.COMMAND), 255)),
                    ("refitted", refitted, 0.0, _LINES["fitted"]),
                ):
                    bars = rr.BarChart(
                        values, abscissa=at + side * _WIDTH, color=colour, widths=[0.9 * _WIDTH] * len(chosen)
                    )
                    self._static(f"{CANDIDATES}/{name}", bars)

    def residual_step(self, step: int, name: str, time_s: ArrayLike, values: Array) -> None:
        """What a step of the ladder leaves of a signal: (n,) at time_s (n,), at /residual/step_N/NAME."""
        group = f"residual/step_{step}"
        title = f"{series_title('residual', name)}, step {step}"
        line = rr.SeriesLines(
            names=title, colors=[GROUP_COLOURS["residual"]], widths=[1.3], aggregation_policy="MinMax"
        )
        self._largest[name] = max(self._largest.get(name, 0.0), float(np.max(np.abs(values), initial=0.0)))
        self._at(f"/{group}/{plain(name)}", line, time_s, values)

    def _layout(self) -> rrb.Blueprint:
        steps = [
            Step(i, rung_title(rung.change, self._found.actuator.axes), name, self._largest.get(name, 0.0))
            for name in self._shown
            for i, rung in enumerate(self._found.ladder)
        ]
        return build(self._contents, steps)

    def _static(self, path: str, value: rr.AsComponents) -> None:
        self._file.do(lambda stream: stream.log(path, value, static=True))

    def _at(self, path: str, drawn: drawn_as.Style, time_s: ArrayLike, values: Array) -> None:
        seconds = np.asarray(time_s, dtype=float)
        time = [rr.TimeColumn("sim_time", duration=np.rint(seconds * 1e9).astype("timedelta64[ns]"))]
        with self._file.lock:
            self._send(path, drawn, time, values)
