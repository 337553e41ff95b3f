"""What of the error is the search's, and what the model's."""

from __future__ import annotations

from ema_model.campaign.thesis.cases import ALGORITHMS, CASES
from ema_model.campaign.thesis.scores import MISSED_PERCENT
from emaviz.report.markup import paragraph, table
from emaviz.report.reproduce.subject import Reproduced
from emaviz.report.section import Figures, Section
from emaviz.text.reproduce import NAMES, NONE, number


class ModelBias(Section[Reproduced]):
    """The k that tells each fault, and the same searches with another fitness."""

    title = "Search or model?"
    anchor = "bias"
    place = 40

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Left out where nothing was computed."""
        of = subject.evaluation
        if not any(one.error.count for one in of.scores):
            return ""
        heads = ["Median of the runs", "true"]
        for name in NAMES:
            heads += [f"{NAMES[name]}, thesis", NAMES[name]] if name in ALGORITHMS else [NAMES[name]]
        lines = []
        for case in CASES:
            own = {one.algorithm: one for one in of.scores if one.case is case}
            if not any(one.error.count for one in own.values()):
                continue
            line = [f"{case.main}: {case.title}", f"{case.k[int(case.main[1:]) - 1]:g}"]
            for name in NAMES:
                one = own.get(name)
                k = NONE if one is None else number(one.k, 3)
                line += [number(None if one is None else one.printed_k, 3), k] if name in ALGORITHMS else [k]
            lines.append(line)
        told = (
            "Where three different searches agree on a wrong value, no search is to blame: that part of the error is "
            "the monitor model's and the fitness's, and more iterations do not take it away."
        )
        return paragraph(told) + table(heads, lines) + self._missed(subject) + self._filtered(subject)

    def _missed(self, subject: Reproduced) -> str:
        heads = ["", "Thesis: missed", "Err % of the others", "Ours: missed", "Err % of the others"]
        lines = [
            [
                NAMES[one.algorithm],
                f"{one.printed_missed} of {one.printed_count}" if one.printed_count else NONE,
                number(one.printed_error_of_others),
                f"{one.missed} of {one.count}",
                number(one.error_of_others, 2 if one.algorithm in ALGORITHMS else 3),
            ]
            for one in subject.evaluation.missed
        ]
        told = (
            f"Runs whose Err is above {MISSED_PERCENT:g} % have ended in a minimum that is not the fault's; that part "
            "is the search's, and few of them make the mean."
        )
        return paragraph(told) + table(heads, lines)

    def _filtered(self, subject: Reproduced) -> str:
        found = subject.evaluation.fitness_compared()
        if not found:
            return ""
        heads = ["Mean Err %", "thesis", "every sample, the thesis's circuit", "means, equivalent circuit"]
        told = (
            "The same searches on the same actuators, with the fitness on means over 0.5 ms, which takes out the "
            "chopping ripple, and the circuit that is the phases' equivalent:"
        )
        return paragraph(told) + table(heads, [[NAMES[name], *map(number, means)] for name, means in found.items()])
