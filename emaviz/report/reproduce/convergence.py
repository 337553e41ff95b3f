"""Figure 5.4: how the searches converge."""

from __future__ import annotations

from ema_model.campaign.thesis.cases import ALGORITHMS, CASES, MULTIPLE, Case, case_of
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
    place = 60

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Left out where nothing was searched."""
        shown = [case for case in CASES if self._histories(subject, case.name, "rmse_history_A")]
        if not shown:
            return ""
        first = next((case for case in shown if case.name == MULTIPLE), shown[0])
        ends = [one[-1] for its in self._histories(subject, first.name, "rmse_history_A").values() for one in its]
        told = (
            f"{first.title}: the best so far, with the thesis's fitness. The best of all searches ends at "
            f"{min(ends):.3g} A, which is what chopping leaves between the two models: from there on the RMSE tells "
            "hardly anything of the error."
        )
        others = "".join(self._drawn(subject, case, figures) for case in shown if case is not first)
        return (
            paragraph(told)
            + self._drawn(subject, first, figures)
            + (folded("The other actuators", others) if others else "")
        )

    def _drawn(self, subject: Reproduced, case: Case, figures: Figures) -> str:
        """RMSE, and the error that the thesis does not draw."""
        rmse, error = (
            self._histories(subject, case.name, what) for what in ("rmse_history_A", "error_history_percent")
        )
        return pair(
            figures.place(convergence_bands.figure(rmse, title=case.title, names=NAMES), 340),
            figures.place(convergence_bands.figure(error, title="Its error", y="Err [%]", names=NAMES), 340),
        )

    def _histories(self, subject: Reproduced, case: str, what: str) -> dict[str, list[list[float]]]:
        found: dict[str, list[list[float]]] = {}
        for name in ALGORITHMS:
            for row in subject.evaluation.of(AS_THE_THESIS):
                known = case_of(row["k_true"])
                if row["algorithm"] == name and known is not None and known.name == case:
                    found.setdefault(name, []).append(row[what])
        return found
