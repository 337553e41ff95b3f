"""The live charts of one run: reference, monitor, and their difference on an axis of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from ema_model.measurement import Measurement
from emaviz.figures.colours import COMMAND, DIFFERENCE, MONITOR, REFERENCE
from emaviz.figures.decimate import envelope

Array = NDArray[np.float64]
_GREY = "#868e96"
_LEGEND = (
    '<div style="font-size:12px;padding:0 10px">'
    + " &nbsp; ".join(
        f'<span style="color:{colour}">━</span> {name}'
        for name, colour in (
            ("reference model", REFERENCE),
            ("monitor model", MONITOR),
            ("monitor − reference (right axis)", DIFFERENCE),
            ("command", COMMAND),
        )
    )
    + "</div>"
)


@dataclass(frozen=True)
class SignalChart:
    """What one chart shows, and in which units."""

    signal: str
    title: str
    unit: str
    scale: float = 1.0
    difference_unit: str = ""
    difference_scale: float = 1.0
    with_command: bool = False


CHARTS = (
    SignalChart("current_A", "Equivalent current", "A", difference_unit="A"),
    SignalChart("user_position_rad", "User position", "mrad", 1e3, "µrad", 1e6, with_command=True),
    SignalChart("motor_position_rad", "Motor position", "rad", 1.0, "mrad", 1e3),
    SignalChart("motor_speed_rad_s", "Motor speed", "rad/s", difference_unit="rad/s"),
)


class LiveSignals:
    """The charts in a panel of the page."""

    def __init__(self, gui: viser.GuiApi, height: int = 154) -> None:
        empty = np.array([0.0, 1.0])
        gui.add_html(_LEGEND)
        self._charts: list[tuple[SignalChart, Any]] = []
        for chart in CHARTS:
            count = 5 + chart.with_command
            handle = gui.add_uplot(
                data=tuple(empty for _ in range(count)),
                series=_series(chart),
                title=chart.title,
                scales={"x": {"time": False}, "y": {"auto": True}, "difference": {"auto": True}},
                axes=_axes(chart, last=chart is CHARTS[-1]),
                cursor={"sync": {"key": "time"}},
                legend={"show": False},
                height=height + (16 if chart is CHARTS[-1] else 0),
            )
            self._charts.append((chart, handle))

    def show(self, reference: Measurement, monitor: Measurement) -> None:
        """Draws a run of both models on one time base."""
        time = reference.time_s
        for chart, handle in self._charts:
            rm, mm = reference[chart.signal], monitor[chart.signal]
            difference = chart.difference_scale * (mm - rm)
            lines = [difference, chart.scale * rm, chart.scale * mm]
            if chart.with_command:
                lines.append(chart.scale * reference["command_rad"])
            # in the middle third of the chart, so that it does not cover the signals
            drawn = envelope(time, lines)
            most = 3.0 * max(float(np.max(np.abs(difference))), 1e-6)
            frame = np.full(len(drawn[0]), most)
            frame[0] = -most
            handle.data = (*drawn, frame)


def _series(chart: SignalChart) -> Any:
    series: list[dict[str, Any]] = [
        {"label": "t [s]"},
        {"label": "difference", "stroke": DIFFERENCE + "b0", "width": 1, "scale": "difference"},
        {"label": "reference", "stroke": REFERENCE, "width": 1.5},
        {"label": "monitor", "stroke": MONITOR, "width": 1.5},
    ]
    if chart.with_command:
        series.append({"label": "command", "stroke": COMMAND, "width": 1, "dash": [4, 4]})
    # unseen; it sets the range of the difference's axis, which viser cannot change without a new chart
    unseen = {"stroke": "#00000000", "width": 0, "points": {"show": False}}
    series.append({"label": "range", "scale": "difference", **unseen})
    return tuple(series)


def _axes(chart: SignalChart, last: bool) -> Any:
    common = {"stroke": _GREY, "labelSize": 16, "labelGap": 0, "grid": {"stroke": "#86868625", "width": 1}}
    return (
        {**common, "label": "time [s]" if last else "", "size": 30, "labelSize": 16 if last else 0},
        {**common, "scale": "y", "label": f"[{chart.unit}]", "size": 48},
        {
            **common,
            "scale": "difference",
            "side": 1,
            "label": f"difference [{chart.difference_unit}]",
            "size": 48,
            "stroke": DIFFERENCE,
            "grid": {"show": False},
        },
    )
