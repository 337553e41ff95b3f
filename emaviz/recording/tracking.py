"""k over the flights of a unit as a recording, on the timeline `flight`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import ArrayLike

from ema_model.errors import InputError
from ema_model.quantities import HALF_90
from ema_model.tracking.track import Tracked
from emaviz.recording import writer as drawn_as
from emaviz.recording.blueprint import plot
from emaviz.recording.entry import GROUP_COLOURS, K_TITLES, RecordingError
from emaviz.recording.writer import RecordingWriter, escaped

FLIGHT = "flight"
ROOT = "/track"
_MOST_AHEAD = 400.0  # flights, to which the way to the threshold is drawn


def write_tracking(result: Tracked, path: str | Path, configuration: Mapping[str, Any] | None = None) -> None:
    """Writes a whole .rrd file; InputError in one line where that cannot be done."""
    try:
        with TrackingWriter(path, result) as writer:
            writer.properties({"track": result.to_dict(), "configuration": dict(configuration or {})})
            writer.answer()
            for name in result.faults:
                writer.fault(name)
    except RecordingError as error:
        raise InputError(str(error)) from None
    if writer.failed is not None:
        raise InputError(writer.failed)


class TrackingWriter(RecordingWriter):
    """A recording of a unit's flights: each k with its band, its threshold, and the way that remains."""

    def __init__(self, path: str | Path, result: Tracked) -> None:
        super().__init__(path)
        self._result = result
        self._at = np.array([i for i, one in enumerate(result.flights, 1) if not one.excluded])

    def __enter__(self) -> TrackingWriter:
        return self

    def answer(self) -> None:
        """What it says in words."""
        text = self._result.document.text
        with self._file.lock:
            self._text(f"{ROOT}/answer", "\n".join(f"    {escaped(line)}" for line in text.splitlines()))

    def fault(self, name: str) -> None:
        """One k."""
        one, colours = self._result.faults[name], GROUP_COLOURS
        self._line(f"{name}/k", f"{name} identified", colours["reference"], self._at, one.k)
        for side, sign in (("low", -1.0), ("high", 1.0)):
            band = one.k + sign * HALF_90 * one.sigma
            self._line(f"{name}/{side}", f"{name} 90 % {side}", colours["floor_low"], self._at, band)
        now = len(self._result.flights)
        ahead = 0.0
        if one.remaining_flights is not None and one.threshold is not None:
            ahead = min(one.remaining_flights.p95, _MOST_AHEAD)
            for share, flights in (
                ("p05", one.remaining_flights.p05),
                ("p50", one.remaining_flights.p50),
                ("p95", one.remaining_flights.p95),
            ):
                reach = min(flights, _MOST_AHEAD) / max(flights, 1e-9)
                times = np.array([now, now + max(1, round(reach * flights))])
                values = [one.level, one.level + reach * (one.threshold - one.level)]
                self._line(f"{name}/{share}", f"{name} to the threshold, {share}", colours["residual"], times, values)
        if one.threshold is not None:
            times = np.array([1, now + max(1, round(ahead))])
            self._line(f"{name}/threshold", f"{name} threshold", colours["monitor"], times, [one.threshold] * 2)

    def _line(self, place: str, title: str, colour: Any, at: ArrayLike, values: ArrayLike) -> None:
        time = [rr.TimeColumn(FLIGHT, sequence=np.asarray(at, dtype=np.int64))]
        self._send(f"{ROOT}/{place}", drawn_as.line(title, colour, 1.5), time, np.asarray(values, dtype=float))

    def _layout(self) -> rrb.Blueprint:
        views = [plot(K_TITLES[name], [f"{ROOT}/{name}/**"], legend=False) for name in self._result.faults]
        words = rrb.TextDocumentView(origin=f"{ROOT}/answer", name="Answer")
        return rrb.Blueprint(
            rrb.Vertical(words, rrb.Grid(*views, name="k over flights"), row_shares=[1, 2]),
            rrb.BlueprintPanel(state="collapsed"),
            rrb.SelectionPanel(state="collapsed"),
            rrb.TimePanel(state="collapsed", timeline=FLIGHT, play_state="Paused"),
            auto_views=False,
            auto_layout=False,
        )
