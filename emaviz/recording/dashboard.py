"""Curves over seconds that follow the timeline `iteration`: measured and model, drawn as line strips in 2D views.

One timeline serves all views of a recording, so that curves over time beside what happens over iterations cannot be
plots over time.  A 2D view keeps x and y alike and its y points down: what is drawn is scaled by hand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import ArrayLike, NDArray

from ema_model.quantities.round_numbers import round_numbers
from emaviz import colours
from emaviz.recording.style import Colour, algorithm_path, signal_title

Array = NDArray[np.float64]

AXES = "/identification_axes"
CURVES = "/curves"  # of the answer, for the tab of signals
POINTS = 600  # of a curve, about
_WIDTH, _HEIGHT = 2.3, 1.0  # as wide as a dashboard's views
_TICKS = 5.0  # of an axis, about
_AIR = 0.08  # of the range, above and below
_GRID, _INK = [134, 142, 150, 90], [134, 142, 150]  # legible on the viewer's own background, light or dark
_MEASURED, _MODEL_WIDTH = (2.6, 1.3), 1.3  # ui points: light and broad beneath, as in the app


@dataclass(frozen=True)
class Chart:
    """Axes: across from first to last, and up from low to high, each in its unit."""

    unit: str
    first: float
    last: float
    low: float
    high: float
    across: str = "s"

    @staticmethod
    def of(signal: str, time_s: ArrayLike, values: ArrayLike) -> Chart:
        """Axes that hold a measured curve (n,), with air for a model that is off."""
        time, y = np.asarray(time_s, dtype=float), np.asarray(values, dtype=float)
        low, high = float(np.min(y)), float(np.max(y))
        air = _AIR * ((high - low) or abs(high) or 1.0)
        unit = signal_title(signal).rpartition("[")[2].rstrip("]")
        return Chart(unit, float(time[0]), float(time[-1]), low - air, high + air)

    def strip(self, across: ArrayLike, values: ArrayLike) -> Array:
        """A curve's points in the view, (m, 2); what lies beyond the axes is drawn at their edge."""
        x, y = (np.asarray(one, dtype=float) for one in (across, values))
        kept = _peaks(y)
        return self._line(x[kept], np.clip(y[kept], self.low, self.high))

    def log_axes(self, stream: rr.RecordingStream, root: str) -> None:
        """The grid and its numbers, static."""
        at, up = round_numbers(self.first, self.last, _TICKS), round_numbers(self.low, self.high, _TICKS)
        lines = [self._line([x, x], [self.low, self.high]) for x in at]
        lines += [self._line([self.first, self.last], [y, y]) for y in up]
        grid = rr.LineStrips2D(lines, colors=[_GRID], radii=rr.Radius.ui_points(0.5), draw_order=-1.0)
        stream.log(f"{root}/grid", grid, static=True)
        spots = [(float(line[0][0]), 0.5 * _HEIGHT + 0.08) for line in lines[: len(at)]]
        spots += [(-0.15, float(line[0][1])) for line in lines[len(at) :]]
        names = [f"{x:.3g} {self.across}".rstrip() for x in at] + [f"{y:.3g} {self.unit}".rstrip() for y in up]
        ticks = rr.Points2D(spots, labels=names, show_labels=True, colors=[_INK], radii=rr.Radius.ui_points(0.0))
        stream.log(f"{root}/ticks", ticks, static=True)

    def _line(self, x: ArrayLike, y: ArrayLike) -> Array:
        across = (np.asarray(x) - self.first) / ((self.last - self.first) or 1.0) * _WIDTH
        up = (np.asarray(y) - self.low) / (self.high - self.low)
        return np.stack([across, (0.5 - up) * _HEIGHT], axis=1)


def measured(points: Array) -> rr.LineStrips2D:
    """The measured curve, broad and pale beneath the model's."""
    colour = [*colours.rgb(colours.REFERENCE), 150]
    return rr.LineStrips2D([points], colors=[colour], radii=rr.Radius.ui_points(_MEASURED[0]), draw_order=0.0)


def model(points: Array, colour: Colour, width: float = _MODEL_WIDTH) -> rr.LineStrips2D:
    """A model's curve; width in ui points."""
    return rr.LineStrips2D([points], colors=[colour], radii=rr.Radius.ui_points(width), draw_order=1.0)


def name_at(point: Array, name: str, colour: Colour) -> rr.Points2D:
    """The name of a curve, beside one of its points (2,)."""
    return rr.Points2D([point], labels=[name], show_labels=True, colors=[colour], radii=rr.Radius.ui_points(2.0))


def model_columns(points: Array, colour: Colour) -> Any:
    """The same for `send_columns`, in one row; a negative radius is in ui points."""
    return rr.LineStrips2D.columns(strips=[points], colors=[colour], radii=[-_MODEL_WIDTH], draw_order=[1.0])


def fit_path(algorithm: str, signal: str, which: str) -> str:
    """'/identification/hba/fit/current_A/model'."""
    return f"{algorithm_path(algorithm)}/fit/{signal}/{which}"


def axes_path(signal: str) -> str:
    """Where a signal's grid is."""
    return f"{AXES}/{signal}"


def view(title: str, paths: Sequence[str]) -> rrb.Spatial2DView:
    """Entities of one signal in one picture."""
    bounds = rrb.VisualBounds2D(x_range=(-0.3, _WIDTH + 0.08), y_range=(-0.58, 0.7))
    return rrb.Spatial2DView(origin="/", contents=list(paths), name=title, visual_bounds=bounds)


def _peaks(values: Array) -> NDArray[np.intp]:
    """About POINTS places that keep a curve's peaks: of each stretch its least and its largest, in their order."""
    if len(values) <= POINTS:
        return np.arange(len(values))
    edges = np.linspace(0, len(values), POINTS // 2 + 1).astype(int)
    kept = {0, len(values) - 1}
    for first, last in pairwise(edges):
        part = values[first:last]
        kept |= {first + int(np.argmin(part)), first + int(np.argmax(part))}
    return np.array(sorted(kept), dtype=np.intp)
