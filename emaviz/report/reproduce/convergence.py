"""Figure 5.4: how the searches converge."""

from __future__ import annotations

from ema_model.campaign.thesis.cases import ALGORITHMS, CASES, MULTIPLE, case_of
from ema_model.campaign.thesis.result import AS_THE_THESIS
from emaviz.figures import convergence_bands
from emaviz.report.markup import folded, paragraph
from emaviz.report.reproduce.subject import Reproduced
from emaviz.report.section import Figures, Section, pair
from emaviz.text.reproduce import NAMES


class Convergence(Section[Reproduced]):
    """Several faults at once, as in the thesis; the other actuators folded."""

    title = "Convergence (figure 5.4)"
    anchor = "convergence"

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Left out where nothing was searched."""
        histories = {case.name: self._histories(subject, case.name) for case in CASES}
        shown = [case for case in CASES if histories[case.name]]
        if not shown:
            return ""
        first = next((case for case in shown if case.name == MULTIPLE), shown[0])
        least = min(one[-1] for its in histories[first.name].values() for one in its)
        told = (
            f"{first.title}: RMSE of the best so far, with the thesis's fitness. The best of all searches ends at "
            f"{least:.3g} A, which is what chopping leaves between the two models."
        )
        others = [
            figures.place(convergence_bands.figure(histories[case.name], title=case.title, names=NAMES), 300)
            for case in shown
            if case is not first
        ]
        whole = figures.place(convergence_bands.figure(histories[first.name], title=first.title, names=NAMES), 360)
        more = "".join(pair(*others[at : at + 2]) for at in range(0, len(others), 2))
        return paragraph(told) + whole + (folded("The other actuators", more) if more else "")

    def _histories(self, subject: Reproduced, case: str) -> dict[str, list[list[float]]]:
        found: dict[str, list[list[float]]] = {}
        for name in ALGORITHMS:
            for row in subject.evaluation.of(AS_THE_THESIS):
                known = case_of(row["k_true"])
                if row["algorithm"] == name and known is not None and known.name == case:
                    found.setdefault(name, []).append(row["rmse_history_A"])
        return found
