"""How a discovery's recording opens: Ladder, Candidates, Signals, Residuals, Configuration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import rerun.blueprint as rrb

from emaviz.recording.blueprint import Contents, arranged, plot, signal_view
from emaviz.recording.style import series_title

LADDER, CANDIDATES, VERDICT = "/discovery/ladder", "/discovery/candidates", "/discovery/verdict"
_AIR = 1.05
_NO_LEGEND = rrb.PlotLegend(visible=False)  # a bar's entry there would be its path: the view's title names the bars


@dataclass(frozen=True)
class Step:
    """The residual of one signal after one step of the ladder."""

    number: int
    title: str  # of the step
    signal: str
    largest: float  # of the residuals of all steps, in the signal's unit: one scale for all


def build(contents: Contents, steps: Sequence[Step]) -> rrb.Blueprint:
    """The tabs, of which the first, the verdict with the ladder beside it, is open."""
    fitted = contents.signals.get("residual", [])
    tabs: list[rrb.Container | rrb.View] = [_ladder(), _candidates()]
    if fitted:
        tabs.append(rrb.Vertical(*(signal_view(contents, name) for name in fitted), name="Signals"))
    if steps:
        tabs.append(rrb.Vertical(*(_residual(step) for step in steps), name="Residuals"))
    if contents.config:
        tabs.append(rrb.TextDocumentView(origin="/config", name="Configuration"))
    return arranged(contents, tabs, active=0)


def _ladder() -> rrb.Container:
    bars = rrb.BarChartView(
        origin="/",
        contents=[f"{LADDER}/fitted", f"{LADDER}/held_out", f"{LADDER}/floor"],
        name="Error over floor after each step (teal, left: fitted; purple, right: held out; grey: the floor, 1)",
        plot_legend=_NO_LEGEND,
    )
    words = rrb.TextDocumentView(origin=VERDICT, name="What was found")
    return rrb.Horizontal(words, bars, column_shares=[1, 1], name="Ladder")


def _candidates() -> rrb.Container:
    bars = rrb.BarChartView(
        origin="/",
        contents=[f"{CANDIDATES}/predicted", f"{CANDIDATES}/refitted"],
        name="Fall of χ² by rank (grey, left: predicted; teal, right: refitted)",
        plot_legend=_NO_LEGEND,
    )
    table = rrb.TextDocumentView(origin=CANDIDATES, name="Ranking")
    return rrb.Horizontal(table, bars, column_shares=[1, 1], name="Candidates")


def _residual(step: Step) -> rrb.View:
    limit = _AIR * step.largest
    return plot(
        f"{series_title('residual', step.signal)}, step {step.number}: {step.title}",
        [f"/{group}/{step.signal}" for group in (f"residual/step_{step.number}", "floor_high", "floor_low")],
        range_=(-limit, limit) if limit > 0.0 else None,
    )
