"""What an effect does to a run: live charts with and without it, and a small picture for a card."""

from __future__ import annotations

from typing import Any
from urllib.parse import quote

import numpy as np
import viser

from ema_model.quantities.axes import Axes
from ema_model.simulation.with_effect import SHOWN, WithEffect
from emaviz.colours import DIFFERENCE, MONITOR, REFERENCE
from emaviz.figures.decimate import envelope
from emaviz.figures.signal_charts import charts
from emaviz.figures.signals import LAST_MORE_PX, PLANT_LINE, legend, time_axis, value_axis
from emaviz.text.html import add_html

_POINTS, _SMALL_POINTS = 800, 160
_WIDTH, _HEIGHT = 120, 44  # of a small picture, pixels


class EffectCharts:
    """A chart for each signal, and one of what changes in it; unseen until there is a run."""

    def __init__(self, gui: viser.GuiApi, axes: Axes, height: int = 92) -> None:
        empty = np.array([0.0, 1.0])
        lines = legend((REFERENCE, "without"), (MONITOR, "with the effect"), (DIFFERENCE, "difference, below"))
        self._legend = add_html(gui, lines, visible=False)
        self._charts: list[tuple[Any, Any, Any]] = []
        for chart in (one for one in charts(axes) if one.signal in SHOWN):
            last = chart.signal == SHOWN[-1]
            both = gui.add_uplot(
                data=(empty, empty, empty),
                series=({}, PLANT_LINE, _line("with", MONITOR, 1.5)),
                title=chart.title,
                axes=(time_axis(False), value_axis(chart.unit)),
                **_layout(height),
            )
            change = gui.add_uplot(
                data=(empty, empty),
                series=({}, _line("difference", DIFFERENCE, 1.5)),
                title="",
                axes=(time_axis(last), value_axis(chart.difference_unit)),
                # its topmost number has no title above it
                **_layout(height - 10 + (LAST_MORE_PX if last else 0), above=8),
            )
            self._charts.append((chart, both, change))

    @property
    def handles(self) -> list[Any]:
        """The charts, from above."""
        return [handle for _, *both in self._charts for handle in both]

    def show(self, felt: WithEffect) -> None:
        """Draws a run."""
        time = felt.with_it.time_s
        self._legend.visible = True
        for chart, both, change in self._charts:
            with_it, without = felt.with_it[chart.signal], felt.without[chart.signal]
            both.data = envelope(time, [chart.scale * without, chart.scale * with_it], _POINTS)
            both.visible = change.visible = True
            change.data = envelope(time, [chart.difference_scale * (with_it - without)], _POINTS)


def _line(label: str, colour: str, width: float) -> Any:
    return {"label": label, "stroke": colour, "width": width}


def _layout(height: int, above: int = 0) -> dict[str, Any]:
    return {
        "scales": {"x": {"time": False}, "y": {"auto": True}},
        "cursor": {"sync": {"key": "library"}},
        "legend": {"show": False},
        "padding": (above, 8, 0, 0),
        "height": height,
        "visible": False,
    }


def small_picture(felt: WithEffect) -> str:
    """An SVG as a data address: what changes in the signal that shows the effect most."""
    change = felt.change(felt.shows)[1]
    most = float(np.max(np.abs(change)))
    if most == 0.0 or not np.isfinite(most):
        return ""
    x, y = envelope(felt.with_it.time_s, [change], _SMALL_POINTS)
    across = _WIDTH * (x - x[0]) / (x[-1] - x[0])
    down = 0.5 * _HEIGHT * (1.0 - 0.92 * y / most)
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across, down))
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" preserveAspectRatio="none">'
        f'<line x1="0" x2="{_WIDTH}" y1="{_HEIGHT / 2}" y2="{_HEIGHT / 2}" stroke="#868e96" stroke-width=".5"/>'
        f'<polyline points="{points}" fill="none" stroke="{DIFFERENCE}" stroke-width="1"/></svg>'
    )
    return f"data:image/svg+xml,{quote(svg)}"
