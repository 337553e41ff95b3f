"""What is left of each recording over time, before and after."""

from __future__ import annotations

from ema_model.discovery.shown.tracks import Track, primary
from ema_model.recordings import SIGNALS
from emaviz.figures import residual_steps
from emaviz.report.discovery.subject import Told
from emaviz.report.markup import escape, folded, paragraph
from emaviz.report.section import Figures, Section

_NOTE = "Grey: what a perfect model would leave 95 of 100 times. Held-out recordings: see the error ladder."


class Residuals(Section[Told]):
    """The signal that tells most of each recording; the others folded away."""

    title = "Residuals before and after"
    anchor = "residuals"
    place = 80

    def body(self, subject: Told, figures: Figures) -> str:
        """Always there."""
        first = primary(subject.found)
        return paragraph(_NOTE, "small") + "".join(
            _one(track, i, first, figures) for i, track in enumerate(subject.tracks, 1)
        )


def _one(track: Track, index: int, first: str, figures: Figures) -> str:
    names = sorted(track.measured, key=lambda name: name != first)
    if not names:
        return ""
    parts = [f'<h3 id="recording-{index}">{index}. {escape(track.name or "recording")}</h3>']
    parts.append(figures.place(residual_steps.figure(track, names[0]), 300))
    parts += [folded(SIGNALS[n].title, figures.place(residual_steps.figure(track, n), 300)) for n in names[1:]]
    return "".join(parts)
