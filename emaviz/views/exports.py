"""An export: what a target cannot hold, and each beside the monitor model and the recording."""

from __future__ import annotations

import math
from collections.abc import Iterator

import plotly.graph_objects as go

from ema_model.exports.replay import Export, TargetProof
from ema_model.quantities import of_signal
from emaviz.figures import theme
from emaviz.figures.theme import line
from emaviz.views import ANSWER, Group, Piece, Row, Section, View

_MOST = 12  # recordings that are drawn of a target
_FIRST = ("user_position_rad", "motor_position_rad", "current_A", "motor_speed_rad_s")

_COLOUR = theme.RESIDUAL  # of what is exported


def _beside(result: Export, proof: TargetProof, recording: int, signal: str) -> go.Figure:
    """One signal of one recording: measured, by the monitor model, and by what was exported."""
    loss = proof.recordings[recording]
    shown = of_signal(signal, result.axes).scaled(loss.ours[signal])
    chart = theme.new(f"{shown.title}, {loss.name}" if loss.name else shown.title, "Time [s]", shown.label)
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


def _budget(proof: TargetProof) -> go.Figure | None:
    """What the target cannot hold, by how much of the model's error grows without it; None where nothing is known."""
    known = [one for one in proof.cannot_hold if math.isfinite(one.share)]
    if not known:
        return None
    chart = theme.new(f"What {proof.title} cannot hold", "Share of our error [%]", "")
    names, shares = [one.what for one in reversed(known)], [100.0 * one.share for one in reversed(known)]
    chart.add_trace(
        go.Bar(x=shares, y=names, orientation="h", marker={"color": _COLOUR}, hovertemplate="%{x:.3g} %<extra></extra>")
    )
    chart.update_yaxes(automargin=True)
    return chart


def _lost(result: Export) -> Iterator[Piece]:
    """Bars for each target; left out where every target holds all of the model."""
    for proof in result.targets:
        if (chart := _budget(proof)) is not None:
            yield Row([chart], 130 + 30 * len(proof.cannot_hold))


def _replayed(result: Export) -> Iterator[Piece]:
    """The signal that says most of each recording; the others, and targets that are the model itself, folded away."""
    for proof in result.targets:
        pieces: list[Piece] = []
        for index, loss in enumerate(proof.recordings[:_MOST]):
            names = [name for name in _FIRST if result.simulated or name in loss.measured]
            rows = [Row([_beside(result, proof, index, name)], 340) for name in names]
            pieces += rows[:1]
            pieces += [Group("More signals", rows[1:], folded=True)] if rows[1:] else []
        yield Group(proof.title, pieces, folded=not proof.cannot_hold)


def _lead(result: Export) -> str:
    titles = ", ".join(proof.title for proof in result.targets)
    on = "a run made for it" if result.simulated else ", ".join(result.names)
    return f"{result.name} as {titles}, replayed on {on}"


VIEW = View(
    of=Export,
    name="home",
    title=lambda result: "Taken home, proved",
    lead=_lead,
    sections=(
        ANSWER,
        Section("What is lost", "lost", of=_lost),
        Section("Replayed", "replayed", of=_replayed),
    ),
    meaning=lambda result: "warning" if any(proof.cannot_hold for proof in result.targets) else "good",
)
