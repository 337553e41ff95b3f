"""All candidates: what each alone would take away from the error, and what could not be seen at all."""

from __future__ import annotations

from ema_model.discovery.words import effect_title
from emaviz.figures import candidates
from emaviz.report.discovery.subject import Told
from emaviz.report.markup import folded, paragraph, table
from emaviz.report.section import Figures, Section

_NOTE = (
    "Predicted: from the effect's fingerprint, less what the calibrated parameters can do as well. The promising ones "
    "are fitted together with all parameters; that is the refitted fall. The ranking is of the first step."
)


class Candidates(Section[Told]):
    """Bars, and the numbers folded away."""

    title = "Candidates"
    anchor = "candidates"
    place = 60

    def body(self, subject: Told, figures: Figures) -> str:
        """Left out where none was scored."""
        found = subject.found
        if not found.candidates:
            return ""
        rows = [
            [
                effect_title(one.name),
                "–" if one.untestable_reason else f"{one.predicted_drop:.0f}",
                "–" if one.refitted_drop is None else f"{one.refitted_drop:.0f}".replace("-", "−"),
            ]
            for one in found.ranked
        ]
        reasons: dict[str, list[str]] = {}
        for one in found.candidates:
            if one.untestable_reason:
                reasons.setdefault(one.untestable_reason, []).append(effect_title(one.name))
        return (
            figures.place(candidates.figure(found), candidates.height(found), "candidate-bars")
            + paragraph(_NOTE, "small")
            + "".join(paragraph(f"{', '.join(names)}: {why}.", "small") for why, names in reasons.items())
            + folded("The ranking in numbers", table(["Effect", "predicted fall of χ²", "refitted"], rows))
        )
