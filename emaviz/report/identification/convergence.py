"""How the search came to its answer."""

from __future__ import annotations

import plotly.graph_objects as go

from ema_model.identification.run import algorithm_title
from emaviz.figures import theme
from emaviz.figures.convergence import colour, error_title
from emaviz.report.identification.subject import Identified
from emaviz.report.markup import paragraph
from emaviz.report.section import Figures, Section


class Convergence(Section[Identified]):
    """The best error of each iteration."""

    title = "Convergence"
    anchor = "convergence"
    place = 30

    def body(self, subject: Identified, figures: Figures) -> str:
        """Always there."""
        answer = subject.answer
        chart = theme.new("Best error of each iteration", "Iteration", error_title(True))
        drawn = {"color": colour(answer.algorithm), "width": 2}
        chart.add_trace(go.Scatter(y=answer.corrected_history, mode="lines", line=drawn, showlegend=False))
        chart.update_yaxes(type="log")
        ended = ", stopped by the user" if answer.stopped else ", then a least-squares fit" if answer.polished else ""
        told = f"{algorithm_title(answer.algorithm)}{ended}: {answer.evaluations} simulations"
        return paragraph(f"{told} in {answer.elapsed_s:.2f} s.") + figures.place(chart, 300)
