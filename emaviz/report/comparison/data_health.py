"""What the recordings' own numbers say about sampling, sensors, signs and limits."""

from __future__ import annotations

from ema_model.comparison.result import Comparison
from ema_model.recordings.health.card import Health
from ema_model.recordings.health.finding import MARKS
from emaviz.report.markup import bullets, escape
from emaviz.report.section import Figures, Section


class DataHealth(Section[Comparison]):
    """Each recording's findings, warnings first, and what reading it did."""

    title = "Data health"
    anchor = "health"
    place = 80

    def body(self, subject: Comparison, figures: Figures) -> str:
        """Always there."""
        parts = []
        for i, one in enumerate(subject.recordings):
            m = one.measurement
            size = f"{m.samples} samples" if m.is_map else f"{m.samples} samples, {m.duration_s:.4g} s"
            parts.append(f"<h3>{i + 1}. {escape(one.name or 'recording')}</h3>")
            parts.append(f'<p class="dim">{escape(size)}</p>{findings(one.health)}{bullets(m.notes, "small")}')
        return "".join(parts)


def findings(health: Health) -> str:
    """A line for each, with its mark."""
    items = [
        f'<li><span class="{finding.severity}" title="{finding.severity}">{MARKS[finding.severity]}</span>'
        f"{escape(finding.sentence)}</li>"
        for finding in health.worst_first
    ]
    return f'<ul class="findings">{"".join(items)}</ul>'
