"""What was answered how often: verdicts of discoveries, explanations of comparisons."""

from __future__ import annotations

from collections import Counter
from typing import Any

from emaviz.figures import counted
from emaviz.report.campaign.subject import Rows
from emaviz.report.section import Figures, Section

_MOST_ANSWERS = 8
_ROW_PX = 24


class Answers(Section[Rows]):
    """Bars, a row a case."""

    title = "Answers"
    anchor = "answers"
    place = 40

    def body(self, subject: Rows, figures: Figures) -> str:
        """Left out where nothing was discovered or compared."""
        parts = []
        for kind, title, answer in (
            ("discover", "What was named", _named),
            ("compare", "What explains the residual first", _explained),
        ):
            rows = [(row, answer(row)) for row in subject.answers(kind)]
            told = [(row, one) for row, one in rows if one is not None]
            if not told:
                continue
            often = {one for one, _ in Counter(one for _, one in told).most_common(_MOST_ANSWERS)}
            counts: dict[str, Counter[str]] = {}
            for row, one in told:
                case = " · ".join(filter(None, (row["group"], row["case"])))
                counts.setdefault(case, Counter())[one if one in often else "another"] += 1
            height = 130 + _ROW_PX * len(counts)
            parts.append(figures.place(counted.figure(title, counts), height))
        return "".join(parts)


def _named(row: dict[str, Any]) -> str | None:
    if row["verdict"] is None:
        return None
    return " + ".join(row["effects"]) or row["verdict"]


def _explained(row: dict[str, Any]) -> str:
    return f"{row['variable']} × {row['modulator']}" if row["variable"] else "nothing"
