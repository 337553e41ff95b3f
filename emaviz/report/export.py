"""The report of an export: each target beside the recordings, and its loss budget."""

from __future__ import annotations

from pathlib import Path

from ema_model.exports.result import Export, TargetProof
from emaviz.figures import export as export_figures
from emaviz.report.html_document import Figures, Section, WordsSection, escape, folded, page, write

_MOST = 12  # recordings that are drawn of a target
_FIRST = ("user_position_rad", "motor_position_rad", "current_A", "motor_speed_rad_s")


class Budget(Section[Export]):
    """Left out where every target holds all of the model."""

    title = "What is lost"
    anchor = "lost"

    def body(self, subject: Export, figures: Figures) -> str:
        """Bars for each target."""
        drawn = [(len(proof.cannot_hold), export_figures.budget(proof)) for proof in subject.targets]
        return "".join(figures.place(chart, 130 + 30 * count) for count, chart in drawn if chart is not None)


class Replayed(Section[Export]):
    """The signal that says most of each recording; the others, and targets that are the model itself, folded away."""

    title = "Replayed"
    anchor = "replayed"

    def body(self, subject: Export, figures: Figures) -> str:
        """Always there."""
        return "".join(self._target(subject, proof, figures) for proof in subject.targets)

    def _target(self, result: Export, proof: TargetProof, figures: Figures) -> str:
        parts = []
        for index, loss in enumerate(proof.recordings[:_MOST]):
            names = [name for name in _FIRST if result.simulated or name in loss.measured]
            charts = [figures.place(export_figures.beside(result, proof, index, name), 340) for name in names]
            parts += charts[:1]
            parts += [folded("More signals", "".join(charts[1:]))] if charts[1:] else []
        body = "".join(parts)
        return f"<h3>{escape(proof.title)}</h3>{body}" if proof.cannot_hold else folded(proof.title, body)


SECTIONS: tuple[Section[Export], ...] = (WordsSection(), Budget(), Replayed())


def write_export_report(result: Export, path: str | Path) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written."""
    titles = ", ".join(proof.title for proof in result.targets)
    on = "a run made for it" if result.simulated else ", ".join(result.names)
    write(path, page("Taken home, proved", f"{result.one.given.name} as {titles}, replayed on {on}", SECTIONS, result))
