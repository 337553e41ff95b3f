"""Tables 5.1–5.38, row by row."""

from __future__ import annotations

from emaviz.report.markup import paragraph, table
from emaviz.report.reproduce.subject import Reproduced
from emaviz.report.section import Figures, Section
from emaviz.text.reproduce import row_table


class RowByRow(Section[Reproduced]):
    """Every actuator and algorithm."""

    title = "Row by row"
    anchor = "rows"
    place = 20

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Always there: the thesis's rows are."""
        told = (
            "Mean ± standard deviation over the runs. Err is T 5.2 as printed, which takes k7 as a number; beside it, "
            "k7 is the angle that it is. The difference is ours − the thesis's. Times are by the clock, of different "
            "computers; ours of one core a search, and longer where others used the machine."
        )
        heads, lines = row_table(subject.evaluation)
        return paragraph(told) + table(heads, lines, text_columns=2)
