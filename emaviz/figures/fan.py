"""The live charts of a fan: three signals, five severities each, from light to dark."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import viser

from ema_model.quantities.axes import Axes
from ema_model.recordings import Measurement
from emaviz.colours import COMMAND
from emaviz.colours import MONITOR_SHADES as SHADES
from emaviz.figures.decimate import envelope
from emaviz.figures.signal_charts import charts
from emaviz.figures.signals import CURSOR, LAST_MORE_PX, PADDING, POINTS, legend, time_axis, value_axis
from emaviz.text.html import add_html

_SHOWN = ("current_A", "user_position_rad", "motor_speed_rad_s")


class LiveFan:
    """Charts in a panel of the page; empty, and unseen, until there is a fan."""

    def __init__(self, gui: viser.GuiApi, axes: Axes, height: int = 155) -> None:
        self._legend: Any = add_html(gui)
        self._charts: list[tuple[Any, Any]] = []
        empty, shown = np.array([0.0, 1.0]), [one for one in charts(axes) if one.signal in _SHOWN]
        for chart in shown:
            command = ({"label": "command", "stroke": COMMAND, "width": 1, "dash": [4, 4], "points": {"show": False}},)
            series: Any = (
                {"label": "t [s]"},
                *(_line(f"severity {i + 1}", shade) for i, shade in enumerate(SHADES)),
                *(command if chart.with_command else ()),
            )
            last = chart is shown[-1]
            handle = gui.add_uplot(
                data=(empty,) * len(series),
                series=series,
                title=chart.title,
                scales={"x": {"time": False}, "y": {"auto": True}},
                axes=(time_axis(last), value_axis(chart.unit)),
                cursor=CURSOR,
                legend={"show": False},
                padding=PADDING,
                height=height + (LAST_MORE_PX if last else 0),
                visible=False,
            )
            self._charts.append((chart, handle))
        self.handles = [handle for _, handle in self._charts]

    def show(self, labels: Sequence[str], runs: Sequence[Measurement]) -> None:
        """labels: what each run is; both from the mildest to the worst, five."""
        self._legend.content = legend(*zip(SHADES, labels), (COMMAND, "command"))
        for chart, handle in self._charts:
            lines = [chart.scale * one[chart.signal] for one in runs]
            if chart.with_command:
                lines.append(chart.scale * runs[0]["command_rad"])
            named = [_line(label, shade) for label, shade in zip(labels, SHADES)]
            if [one.get("label") for one in handle.series[1 : 1 + len(named)]] != list(labels):
                handle.series = (handle.series[0], *named, *handle.series[1 + len(named) :])
            handle.data = envelope(runs[0].time_s, lines, POINTS)
            handle.visible = True


def _line(label: str, colour: str) -> Any:
    return {"label": label, "stroke": colour, "width": 1.6, "points": {"show": False}}
