"""How the errors of the identifications are spread."""

from __future__ import annotations

import numpy as np

from ema_model import faults
from emaviz.figures import error_distribution
from emaviz.report.campaign.subject import Rows
from emaviz.report.section import Figures, Section, pair

_LEAST = 3


class Distributions(Section[Rows]):
    """Err %, and how far each k is off."""

    title = "Distributions"
    anchor = "distributions"
    place = 30

    def body(self, subject: Rows, figures: Figures) -> str:
        """Left out where no truth is known."""
        known = {
            group: [row for row in rows if row["k_true"] is not None]
            for group, rows in subject.grouped("identify").items()
        }
        known = {group: rows for group, rows in known.items() if len(rows) >= _LEAST}
        if not known:
            return ""
        errors = {group: [row["error_wrapped_percent"] for row in rows] for group, rows in known.items()}
        parts = [figures.place(error_distribution.figure("Error of the identified k", "Err [%]", errors), 360)]
        drawn = []
        for i, fault in enumerate(faults.FAULTS):
            off = {group: [_off(row, i) for row in rows] for group, rows in known.items()}
            title = f"{fault.label}: found − true"
            drawn.append(figures.place(error_distribution.figure(title, f"Δ{fault.name} [-]", off), 280))
        parts += [pair(*drawn[at : at + 2]) for at in range(0, len(drawn), 2)]
        return "".join(parts)


def _off(row: dict, i: int) -> float:
    """k7 is an angle."""
    off = row[faults.NAMES[i]] - row["k_true"][i]
    return off - float(np.round(off)) if faults.NAMES[i] == "k7" else off
