"""The live chart of identifications: the best error of each iteration, all optimisers in one plot.

While they search it is the simplified model's own; once all have ended, what that model is known to lack is added.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import viser

from ema_model.identification.run import ROBUST, algorithm_title
from emaviz.colours import ALGORITHMS, MONITOR
from emaviz.figures.signals import AXIS, PADDING, legend
from emaviz.text.html import Html, add_html, html

_LEAST_A = 1e-9  # a logarithmic axis has no zero


class LiveConvergence:
    """Error against iteration, logarithmic; an optimiser that has ended keeps its level."""

    def __init__(self, gui: viser.GuiApi, height: int = 200) -> None:
        self._algorithms: tuple[str, ...] = ()
        self._iterations = 150
        self._corrected = False
        self._legend: Any = add_html(gui)
        self.handle: Any = gui.add_uplot(
            data=(np.array([0.0, 1.0]), np.array([1.0, 1.0])),
            series=({"label": "iteration"}, _UNSEEN),
            title="Convergence",
            scales=_scales(150),
            axes=_axes(False),
            legend={"show": False},
            padding=(PADDING[0], 14, *PADDING[2:]),  # half of the last number
            height=height,
        )

    def begin(self, algorithms: Sequence[str], iterations: int) -> None:
        """A new race: its colours and the length of its axis, which build the chart anew."""
        if tuple(algorithms) != self._algorithms:
            self._algorithms = tuple(algorithms)
            self.handle.data = (np.array([0.0, 1.0]), *(np.array([1.0, 1.0]) for _ in algorithms))
            self.handle.series = ({"label": "iteration"}, *(_line(name) for name in algorithms))
            self._legend.content = legend(*((colour(name), _told(name)) for name in algorithms))
        if iterations != self._iterations:
            self._iterations = iterations
            self.handle.scales = _scales(iterations)

    def show(self, errors: Mapping[str, Sequence[float]], *, corrected: bool) -> None:
        """Draws the errors so far, A, by algorithm, all corrected or none; the last of a fitted answer is its fit."""
        if tuple(errors) != self._algorithms:
            return
        if corrected != self._corrected:
            self._corrected = corrected
            self.handle.axes = _axes(corrected)
        count = max([2, *map(len, errors.values())])
        lines = [_to_length(values, count) for values in errors.values()]
        self.handle.data = (np.arange(count, dtype=float), *lines)


def colour(algorithm: str) -> str:
    """The algorithm's own colour; the monitor's for one without."""
    return ALGORITHMS.get(algorithm, MONITOR)


def named(algorithm: str) -> Html:
    """The algorithm's name behind a mark of its colour, in which text would be hard to read on dark or on light."""
    return html('<span style="color:{}">●</span> <b>{}</b>', colour(algorithm), algorithm_title(algorithm))


def _told(algorithm: str) -> str:
    """In the legend: what rises has a reason."""
    if algorithm != ROBUST:
        return algorithm_title(algorithm)
    return f"{algorithm_title(algorithm)}: ranks by all signals, so that this may rise; the last is its fit"


def _to_length(errors: Sequence[float], count: int) -> np.ndarray:
    """The last value goes on: it stays the best."""
    values = np.asarray(errors if len(errors) else [1.0], dtype=float)
    values = np.maximum(np.where(np.isfinite(values), values, 1e3), _LEAST_A)
    return np.concatenate([values, np.full(count - len(values), values[-1])])


def _line(algorithm: str) -> Any:
    return {"label": f"{algorithm} [A]", "stroke": colour(algorithm), "width": 2, "points": {"show": False}}


_UNSEEN: Any = {**_line(""), "stroke": "#00000000"}  # before anything is searched


def error_title(corrected: bool) -> str:
    """Of an axis of errors, A."""
    return f"{'Corrected' if corrected else 'Uncorrected'} error of the best [A]"


def _axes(corrected: bool) -> Any:
    return {**AXIS, "label": "Iteration", "size": 30}, {**AXIS, "label": error_title(corrected), "size": 56}


def _scales(iterations: int) -> Any:
    """With a place for the answer, behind the last iteration."""
    return {"x": {"time": False, "range": (0.0, iterations + 1.0)}, "y": {"distr": 3}}
