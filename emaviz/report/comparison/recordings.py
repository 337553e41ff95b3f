"""Each recording beside the model, and what is left over time."""

from __future__ import annotations

from ema_model.comparison.result import Comparison
from emaviz.figures import overlay, quantity, residual_time
from emaviz.report.markup import escape, folded
from emaviz.report.section import Figures, Section


class Recordings(Section[Comparison]):
    """The primary signal of each; the others folded away."""

    title = "Recordings"
    anchor = "recordings"
    place = 60

    def body(self, subject: Comparison, figures: Figures) -> str:
        """Always there."""
        return "".join(self._one(subject, figures, i) for i in range(len(subject.recordings)))

    def _one(self, comparison: Comparison, figures: Figures, index: int) -> str:
        one = comparison.recordings[index]
        first = comparison.primary if comparison.primary in one.measured else next(iter(one.measured))
        parts = [f'<h3 id="recording-{index + 1}">{index + 1}. {escape(one.name or "recording")}</h3>']
        parts.append(_figures(comparison, figures, first, index))
        for name in one.measured:
            if name != first:
                title = quantity.of_signal(comparison, name).title
                parts.append(folded(title, _figures(comparison, figures, name, index)))
        return "".join(parts)


def _figures(comparison: Comparison, figures: Figures, signal: str, index: int) -> str:
    return figures.place(overlay.figure(comparison, signal, index), 360) + figures.place(
        residual_time.figure(comparison, signal, index), 300
    )
