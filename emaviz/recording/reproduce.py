"""The thesis's evaluation as a recording: tables, convergence as static curves, responses on `sim_time`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import ArrayLike

from ema_model.campaign.thesis import (
    ALGORITHMS,
    AS_THE_THESIS,
    CASES,
    FAMILIES,
    MULTIPLE,
    SIGNALS,
    Drawn,
    Evaluation,
    case_of,
)
from ema_model.campaign.thesis_words import NAMES, answer, coefficient_table, row_table
from ema_model.errors import InputError
from emaviz import colours
from emaviz.recording import blueprint, entry
from emaviz.recording import writer as drawn_as
from emaviz.recording.blueprint import Array, Chart, plot
from emaviz.recording.entry import RecordingError, algorithm_colour, signal_title
from emaviz.recording.writer import RecordingWriter, escaped

ROOT = "/reproduce"
_PERCENTILES = (("p05", 5.0, 0.5), ("median", 50.0, 1.5), ("p95", 95.0, 0.5))  # with their lines' widths
_AIR = 0.1  # of the curves' range, above and below
_SIGNALS = ("current_A", "user_position_rad", "motor_position_rad", "motor_speed_rad_s")
_SHADES = tuple((*colours.rgb(shade), 255) for shade in colours.REFERENCE_SHADES)


def write_reproduction(evaluation: Evaluation, path: str | Path) -> None:
    """Writes a whole .rrd file; InputError in one line where that cannot be done."""
    try:
        with ReproductionWriter(path) as writer:
            writer.properties({"reproduce": evaluation.to_dict()})
            writer.tables(evaluation)
            for case in CASES:
                writer.convergence(evaluation, case.name)
            if evaluation.drawn is not None:
                writer.responses(evaluation.drawn)
    except RecordingError as error:
        raise InputError(str(error)) from None
    if writer.failed is not None:
        raise InputError(writer.failed)


class ReproductionWriter(RecordingWriter):
    """A recording of the evaluation: what stands in the report, to be looked at closely."""

    def __init__(self, path: str | Path) -> None:
        super().__init__(path)
        self._searched: list[str] = []  # cases

    def __enter__(self) -> ReproductionWriter:
        return self

    def tables(self, of: Evaluation) -> None:
        """The answer, and the thesis's numbers beside ours."""
        with self._file.lock:
            parts = [*map(escaped, answer(of)), _markdown(*row_table(of)), _markdown(*coefficient_table(of))]
            self._text(f"{ROOT}/tables", "\n\n".join(parts))

    def convergence(self, of: Evaluation, case: str) -> None:
        """Median and band of the best RMSE over the iterations, log10 of A, by algorithm.

        Static: of the timelines, the one that the file opens on is the responses'.
        """
        curves = {name: curve for name in ALGORITHMS if (curve := _percentiles(of, case, name)) is not None}
        if not curves:
            return
        every = np.concatenate([curve.ravel() for curve in curves.values()])
        last = max(curve.shape[1] for curve in curves.values()) - 1
        air = _AIR * (float(np.ptp(every)) or 1.0)
        chart = Chart("", 0.0, last, float(every.min()) - air, float(every.max()) + air, across="")
        root = f"{ROOT}/convergence/{case}"
        with self._file.lock:
            self._searched.append(case)
            self._file.do(lambda stream: chart.log_axes(stream, f"{root}/axes"))
            for place, (name, curve) in enumerate(curves.items(), 1):
                colour = algorithm_colour(name)
                named = place * last // (len(curves) + 1)  # each at another place: the curves come to lie together
                there = blueprint.name_at(chart.strip([named], [curve[1, named]])[0], NAMES[name], colour)
                self._file.do(lambda stream, at=f"{root}/{name}/name", there=there: stream.log(at, there, static=True))
                for (what, _, width), values in zip(_PERCENTILES, curve):
                    strip = chart.strip(np.arange(len(values)), values)
                    drawn = blueprint.model(strip, colour, width)
                    self._file.do(
                        lambda stream, at=f"{root}/{name}/{what}", one=drawn: stream.log(at, one, static=True)
                    )

    def responses(self, drawn: Drawn) -> None:
        """Both models, healthy and faulty; the actuator at five severities of each fault."""
        for pair in drawn.pairs:
            for group, run in (("reference", pair.reference), ("monitor", pair.monitor)):
                for name in _SIGNALS:
                    self._plotted(
                        f"models/{pair.name}/{name}/{group}",
                        drawn_as.signal_style(group, name),
                        _time(run),
                        run[name],
                    )
        for family in FAMILIES:
            for command in ("chirp", "step"):
                runs = drawn.families[family.name, command]
                for at, (severity, run) in enumerate(runs.items()):
                    for name in SIGNALS:
                        line = drawn_as.line(f"{severity}, {signal_title(name)}", _SHADES[at % len(_SHADES)], 1.5)
                        self._plotted(f"severities/{family.name}/{command}/{name}/s{at}", line, _time(run), run[name])

    def _plotted(self, place: str, drawn: drawn_as.Style, time: list[rr.TimeColumn], values: ArrayLike) -> None:
        self._send(f"{ROOT}/{place}", drawn, time, np.asarray(values, dtype=float))

    def _layout(self) -> rrb.Blueprint:
        tabs: list[Any] = [rrb.TextDocumentView(origin=f"{ROOT}/tables", name="Thesis beside ours")]
        if self._searched:
            first = sorted(self._searched, key=lambda case: case != MULTIPLE)
            tabs.append(
                rrb.Grid(
                    *[blueprint.view(_title(case), [f"{ROOT}/convergence/{case}/**"]) for case in first],
                    name="Convergence (log10 RMSE [A], iterations)",
                )
            )
        for pair in ("healthy", "faulty"):
            tabs.append(_grid(f"RM and MM, {pair}", f"{ROOT}/models/{pair}", _SIGNALS))
        for family in FAMILIES:
            views = [
                plot(f"{signal_title(name)}, {command}", [f"{ROOT}/severities/{family.name}/{command}/{name}/**"])
                for command in ("chirp", "step")
                for name in SIGNALS
            ]
            tabs.append(rrb.Grid(*views, grid_columns=3, name=family.title))
        return rrb.Blueprint(
            rrb.Tabs(*tabs),
            rrb.BlueprintPanel(state="collapsed"),
            rrb.SelectionPanel(state="collapsed"),
            rrb.TimePanel(state="collapsed", timeline=entry.SIM_TIME, play_state="Paused"),
            auto_views=False,
            auto_layout=False,
        )


def _percentiles(of: Evaluation, case: str, algorithm: str) -> Array | None:
    """log10 of the best RMSE, A, (percentiles, iterations); None where nothing was searched."""
    own = [
        row["rmse_history_A"]
        for row in of.of(AS_THE_THESIS)
        if row["algorithm"] == algorithm and (known := case_of(row["k_true"])) is not None and known.name == case
    ]
    if not own:
        return None
    length = max(map(len, own))
    whole = np.array([[*one, *[one[-1]] * (length - len(one))] for one in own])
    return np.log10(np.percentile(whole, [percentile for _, percentile, _ in _PERCENTILES], axis=0))


def _grid(title: str, root: str, names: Sequence[str]) -> rrb.Grid:
    return rrb.Grid(*[plot(signal_title(name), [f"{root}/{name}/**"]) for name in names], name=title)


def _title(case: str) -> str:
    return next(one.title for one in CASES if one.name == case)


def _time(run: Any) -> list[rr.TimeColumn]:
    nanoseconds = np.rint(np.asarray(run.time_s) * 1e9).astype("timedelta64[ns]")
    return [rr.TimeColumn(entry.SIM_TIME, duration=nanoseconds)]


def _markdown(heads: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    rows = [heads, ["---"] * len(heads), *lines]
    return "\n".join(
        "| " + " | ".join(escaped(cell) if row is not rows[1] else cell for cell in row) + " |" for row in rows
    )
