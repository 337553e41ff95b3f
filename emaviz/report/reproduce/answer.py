"""The answer, and a line for each actuator."""

from __future__ import annotations

from emaviz.figures import errors_beside
from emaviz.report.markup import paragraph, table
from emaviz.report.reproduce.subject import Reproduced
from emaviz.report.section import Figures, Section
from emaviz.text.reproduce import NAMES, answer, short_table


class Answer(Section[Reproduced]):
    """In words, in numbers, and as figure 5.2 has it."""

    title = "Answer"
    anchor = "answer"
    place = 10

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Always there."""
        of = subject.evaluation
        first, *more = answer(of)
        told = paragraph(first, "answer") + "".join(paragraph(one) for one in more)
        heads, lines = short_table(of)
        if not lines:
            return told
        ours, theirs = {}, {}
        for one in of.scores:
            if one.error.count:
                ours.setdefault(one.algorithm, {})[one.case.title] = one.error.mean
                if one.printed is not None:
                    theirs.setdefault(one.algorithm, {})[one.case.title] = one.printed.mean
        drawn = errors_beside.figure("Mean error of each actuator (figure 5.2)", ours, theirs, NAMES)
        note = "Mean Err in % (T 5.2 as printed): the thesis's ten runs, and ours, by algorithm."
        rows = len({one.case.name for one in of.scores if one.error.count})
        return told + paragraph(note, "small") + table(heads, lines) + figures.place(drawn, 150 + 32 * rows)
