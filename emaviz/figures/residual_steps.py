"""What is left of a signal over time before and after a discovery, about the band of a perfect model."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from ema_model.discovery.shown.tracks import Track
from ema_model.estimation.floor import BAND_SIGMAS
from ema_model.quantities.axes import ROTARY
from ema_model.quantities.shown import of_residual
from emaviz.figures import floor_band, theme
from emaviz.figures.lines import line

BEFORE, AFTER = theme.INITIAL, theme.RESIDUAL


def figure(track: Track, signal: str, first: int = 0, last: int = -1, *, dark: bool = False) -> go.Figure:
    """The residual of two steps of the ladder: the first and the last one, unless told otherwise."""
    told = of_residual(signal, ROTARY)  # by the name in files, which says all
    title = told.title
    if signal not in track.measured:
        return theme.missing(title, "not recorded here", dark=dark)
    before, after = track.residual(signal, first), track.residual(signal, last)
    shown = told.scaled(before)
    chart = theme.new(f"{title} (measured − model)", "Time [s]", shown.short_label, dark=dark)
    sigma = BAND_SIGMAS * shown.factor * track.sigma[signal]
    floor_band.below(chart, track.time_s, sigma)
    changed = len(track.models) > 1
    drawn = [(before, "calibrated model", BEFORE)] if changed else []
    drawn.append((after, "improved model" if changed else "residual", AFTER))
    for values, name, colour in drawn:
        x, y = line(track.time_s, shown.factor * values, theme.POINTS)
        style = {"width": 1, "color": colour}
        chart.add_trace(go.Scatter(x=x, y=y, mode="lines", name=name, line=style, hovertemplate="%{y:.4g}"))
    floor_band.above(chart, track.time_s, sigma)
    most = float(np.max(np.abs(np.concatenate([before, after])))) * shown.factor
    chart.update_yaxes(range=[-1.05 * most, 1.05 * most])
    return chart
