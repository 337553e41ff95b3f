"""How the searches converged."""

from __future__ import annotations

from emaviz.figures import convergence_bands
from emaviz.report.campaign.subject import Rows
from emaviz.report.markup import paragraph
from emaviz.report.section import Figures, Section


class Convergence(Section[Rows]):
    """A figure a group, a band an algorithm."""

    title = "Convergence"
    anchor = "convergence"
    place = 50

    def body(self, subject: Rows, figures: Figures) -> str:
        """Left out where nothing was identified."""
        parts = []
        for group, rows in subject.grouped("identify").items():
            histories: dict[str, list[list[float]]] = {}
            for row in rows:
                if row["rmse_history_A"]:
                    histories.setdefault(row["algorithm"], []).append(row["rmse_history_A"])
            if histories:
                parts += [paragraph(f"{group}: {len(rows)} searches"), _placed(histories, figures)]
        return "".join(parts)


def _placed(histories: dict[str, list[list[float]]], figures: Figures) -> str:
    return figures.place(convergence_bands.figure(histories), 320)
