"""An export beside the monitor model and the recording, and what a target cannot hold."""

from __future__ import annotations

import math

import plotly.graph_objects as go

from ema_model.exports.result import Export, TargetProof
from ema_model.quantities.axes import of_signal
from emaviz.figures import theme
from emaviz.figures.theme import line

_COLOUR = theme.RESIDUAL  # of what is exported


def beside(result: Export, proof: TargetProof, recording: int, signal: str, *, dark: bool = False) -> go.Figure:
    """One signal of one recording: measured, by the monitor model, and by what was exported."""
    loss = proof.recordings[recording]
    shown = of_signal(signal, result.axes).scaled(loss.ours[signal])
    chart = theme.new(f"{shown.title}, {loss.name}" if loss.name else shown.title, "Time [s]", shown.label, dark=dark)
    drawn = [
        ("measured", None if result.simulated else loss.measured.get(signal), theme.MEASURED, "solid"),
        ("monitor model", loss.ours[signal], theme.MODEL, "solid"),
        (proof.title, loss.shown[signal], _COLOUR, "dot"),
    ]
    for name, values, colour, dash in drawn:
        if values is not None:
            x, y = line(loss.time_s, shown.factor * values, theme.POINTS)
            look = {"color": colour, "width": 1.6, "dash": dash}
            chart.add_trace(go.Scatter(x=x, y=y, mode="lines", name=name, line=look, hovertemplate="%{y:.4g}"))
    return chart


def budget(proof: TargetProof, *, dark: bool = False) -> go.Figure | None:
    """What the target cannot hold, by how much of the model's error grows without it; None where nothing is known."""
    known = [one for one in proof.cannot_hold if math.isfinite(one.share)]
    if not known:
        return None
    chart = theme.new(f"What {proof.title} cannot hold", "Share of our error [%]", "", dark=dark)
    names, shares = [one.what for one in reversed(known)], [100.0 * one.share for one in reversed(known)]
    chart.add_trace(
        go.Bar(x=shares, y=names, orientation="h", marker={"color": _COLOUR}, hovertemplate="%{x:.3g} %<extra></extra>")
    )
    chart.update_yaxes(automargin=True)
    return chart
