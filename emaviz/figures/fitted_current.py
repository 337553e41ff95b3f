"""The measured current and the monitor's of each optimiser, live, and what they leave."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from ema_model.identification.run import algorithm_title
from emaviz.colours import DIFFERENCE, REFERENCE
from emaviz.figures import cut
from emaviz.figures.convergence import colour
from emaviz.figures.decimate import envelope
from emaviz.figures.signals import CURSOR, LAST_MORE_PX, PADDING, PLANT_LINE, POINTS, legend, time_axis, value_axis
from emaviz.text.html import add_html

Array = NDArray[np.float64]
_LEFT = "Monitor − measured"


def _line(label: str, drawn: str, width: float = 1.5) -> Any:
    return {"label": label, "stroke": drawn, "width": width, "points": {"show": False}}


def _scales(end: float | None) -> dict[str, Any]:
    """The chart's, whose values end there on either side of zero; None: with the values."""
    return {"x": {"time": False}, "y": {"auto": True} if end is None else {"range": (-end, end)}}


MEASURED: Any = {**PLANT_LINE, "label": "measured"}


class LiveFit:
    """Two charts on one time base: the currents, and monitor − measured, whose axis a start does not set."""

    def __init__(self, gui: viser.GuiApi, height: int = 171) -> None:
        empty = np.array([0.0, 1.0])
        self._algorithms: tuple[str, ...] = ()
        self._legend: Any = add_html(gui)
        common: Any = {
            "scales": _scales(None),
            "legend": {"show": False},
            "cursor": CURSOR,
            "padding": PADDING,
        }
        self._currents: Any = gui.add_uplot(
            data=(empty, empty),
            series=({"label": "t [s]"}, MEASURED),
            title="Measured and fitted current",
            axes=(time_axis(False), value_axis("A")),
            height=height,
            **common,
        )
        self._left: Any = gui.add_uplot(
            data=(empty, empty),
            series=({"label": "t [s]"}, _line("left", REFERENCE)),
            title=_LEFT,
            axes=(time_axis(True), value_axis("A")),
            height=height + LAST_MORE_PX,
            **common,
        )
        self.handles = [self._currents, self._left]

    def show(self, time_s: Array, measured_A: Array, fitted_A: Mapping[str, Array]) -> None:
        """All arrays (blocks,); fitted by algorithm."""
        if not fitted_A:
            return
        if tuple(fitted_A) != self._algorithms:
            self._algorithms = tuple(fitted_A)
            names = [(name, colour(name)) for name in fitted_A]
            blank = np.array([0.0, 1.0])
            self._currents.data = (blank,) * (2 + len(names))
            self._left.data = (blank,) * (1 + len(names))
            self._currents.series = (
                {"label": "t [s]"},
                MEASURED,
                *(_line(name, drawn) for name, drawn in names),
            )
            lines = names if len(names) > 1 else [(names[0][0], DIFFERENCE)]
            self._left.series = ({"label": "t [s]"}, *(_line(name, drawn) for name, drawn in lines))
            self._legend.content = legend(
                (REFERENCE, "measured"), *((drawn, algorithm_title(name)) for name, drawn in names)
            )
        fitted = list(fitted_A.values())
        self._currents.data = envelope(time_s, [measured_A, *fitted], POINTS)
        left = [one - measured_A for one in fitted]
        self._left.data = envelope(time_s, left, POINTS)
        end = cut.end_of(left)
        title = _LEFT if end is None else f"{_LEFT}, {cut.told(end, left, 'A')}"
        if title != self._left.title:
            self._left.title, self._left.scales = title, _scales(end)
