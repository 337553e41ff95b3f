"""What chapter 6 asks for: error against population, iterations and evaluations, and when to stop."""

from __future__ import annotations

from collections.abc import Callable

from ema_model.campaign.thesis.cases import ALGORITHMS
from ema_model.campaign.thesis.trade_off import STOP_A, Point
from emaviz.figures import search_effort
from emaviz.figures.search_effort import Effort
from emaviz.report.markup import paragraph, table
from emaviz.report.reproduce.subject import Reproduced
from emaviz.report.section import Figures, Section, pair
from emaviz.text.reproduce import NAMES, number


class TradeOff(Section[Reproduced]):
    """Figures by actuator, and a table of stops."""

    title = "How much search an answer takes (chapter 6)"
    anchor = "effort"
    place = 70

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Left out where nothing was searched."""
        return self._stops(subject) + self._effort(subject, figures)

    def _stops(self, subject: Reproduced) -> str:
        stops = subject.evaluation.stops
        if not stops:
            return ""
        reached, count = (sum(getattr(one, what) for one in stops) for what in ("reached", "count"))
        told = (
            f"The thesis's stop at an RMSE of {STOP_A:g} A: {reached} of {count} searches reached it; the lowest RMSE "
            f"of any was {min(one.least_A for one in stops):.3g} A. When each could have ended, by its RMSE falling no "
            "more:"
        )
        heads = [
            "",
            "searches",
            "within 1 % from iteration (median)",
            "95 % of them by",
            "Err % there",
            "Err % at the end",
        ]
        lines = [
            [NAMES[one.algorithm], one.count, f"{one.settled:.0f}", f"{one.settled_high:.0f}",
             number(one.error_settled_percent), number(one.error_percent)]
            for one in stops
        ]  # fmt: skip
        return paragraph(told) + table(heads, lines)

    def _effort(self, subject: Reproduced, figures: Figures) -> str:
        every = subject.evaluation.points
        parts = []
        for case in dict.fromkeys(one.case.name for one in every):
            points = [one for one in every if one.case.name == case]
            populations, iterations = ({getattr(one, of) for one in points} for of in ("population", "iterations"))
            usual_n, usual_t = (
                (50 if 50 in populations else max(populations)),
                (150 if 150 in iterations else max(iterations)),
            )
            title = points[0].case.title
            by_n = [one for one in points if one.iterations == usual_t]
            by_t = [one for one in points if one.population == usual_n]
            several = f"median Err of {points[0].count} searches each, with 5 to 95 %"
            parts.append(paragraph(f"{title}: {several if points[0].count > 1 else 'Err of one search each'}."))
            parts.append(
                pair(
                    _placed(figures, f"{usual_t} iterations", "Population", by_n, lambda one: one.population),
                    _placed(figures, f"Population of {usual_n}", "Iterations", by_t, lambda one: one.iterations),
                )
            )
            parts.append(
                _placed(figures, "All of them", "Evaluations", points, lambda one: one.evaluations, joined=False)
            )
        return "".join(parts)


def _placed(
    figures: Figures, title: str, x: str, points: list[Point], at: Callable[[Point], float], *, joined: bool = True
) -> str:
    found = {
        name: [
            Effort(at(one), one.low_percent, one.error_percent, one.high_percent)
            for one in points
            if one.algorithm == name
        ]
        for name in ALGORITHMS
    }
    drawn = search_effort.figure(title, x, {n: its for n, its in found.items() if its}, NAMES, joined=joined)
    return figures.place(drawn, 320)
