"""The live chart of an identification: the best error of each iteration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import viser

from emaviz.figures.colours import ALGORITHMS


class LiveConvergence:
    """RMSE against iteration, logarithmic."""

    def __init__(self, gui: viser.GuiApi, height: int = 190) -> None:
        grey = {"stroke": "#868e96", "labelSize": 16, "labelGap": 0, "grid": {"stroke": "#86868625", "width": 1}}
        axes: Any = ({**grey, "label": "iteration", "size": 26}, {**grey, "label": "rmse [A]", "size": 52})
        self._handle: Any = gui.add_uplot(
            data=(np.array([0.0, 1.0]), np.array([1.0, 1.0])),
            series=({"label": "iteration"}, {"label": "best rmse [A]", "stroke": ALGORITHMS["hba"], "width": 2}),
            title="Convergence",
            scales={"x": {"time": False, "range": (0.0, 150.0)}, "y": {"distr": 3}},
            axes=axes,
            legend={"show": False},
            height=height,
        )

    def begin(self, algorithm: str, iterations: int) -> None:
        """A new run: its colour and the length of its axis (which builds the chart anew)."""
        line = {"label": "best rmse [A]", "stroke": ALGORITHMS.get(algorithm, "#868e96"), "width": 2}
        self._handle.series = ({"label": "iteration"}, line)
        self._handle.scales = {"x": {"time": False, "range": (0.0, float(iterations))}, "y": {"distr": 3}}

    def show(self, rmse: Sequence[float]) -> None:
        """Draws the errors so far, A."""
        y = np.maximum(np.asarray(rmse, dtype=float), 1e-9)
        x = np.arange(len(y), dtype=float)
        if len(y) == 1:
            x, y = np.array([0.0, 0.1]), np.repeat(y, 2)
        self._handle.data = (x, y)
