"""Tables 5.39–5.43."""

from __future__ import annotations

from emaviz.report.markup import paragraph, table
from emaviz.report.reproduce.subject import Reproduced
from emaviz.report.section import Figures, Section
from emaviz.text.reproduce import coefficient_table


class Coefficients(Section[Reproduced]):
    """A line a fault and algorithm."""

    title = "Performance coefficients"
    anchor = "coefficients"
    place = 30

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Left out where no fault has been computed with all three algorithms."""
        heads, lines = coefficient_table(subject.evaluation)
        if not lines:
            return ""
        told = (
            "PC = 100 (1 − Err·t / Σ Err·t) over the three algorithms (T 5.4), errors and times of low and high "
            "averaged first, as the thesis does. It compares algorithms of one computer, and is blind to how good all "
            "three are."
        )
        return paragraph(told) + table(heads, lines, text_columns=2)
