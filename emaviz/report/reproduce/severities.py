"""Figures 3.27–3.70: what five severities of each fault do to a step and to a chirp."""

from __future__ import annotations

from ema_model.campaign.thesis.responses import FAMILIES, SIGNALS
from ema_model.quantities.shown import of_signal
from ema_model.quantities.titles import in_sentence
from emaviz.figures import responses
from emaviz.report.markup import folded, paragraph
from emaviz.report.reproduce.subject import Reproduced
from emaviz.report.section import Figures, Section, pair


class Severities(Section[Reproduced]):
    """A part a fault: the chirp open, the step folded."""

    title = "Severities of each fault (figures 3.27–3.70)"
    anchor = "severities"
    place = 90

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Always there."""
        axes = subject.drawn.actuator.axes
        parts = [paragraph("The reference model, on a step of 1 rad at 10 ms and on the chirp.")]
        for family in FAMILIES:
            parts.append(f"<h3>{family.title} (figures {family.figures})</h3>")
            for run in ("chirp", "step"):
                runs = subject.drawn.families[family.name, run]
                drawn = [
                    figures.place(
                        responses.figure(
                            f"{of_signal(name, axes).title}, {in_sentence(family.title)}, {run}",
                            runs,
                            name,
                            with_command=name.startswith("user_position"),
                            axes=axes,
                        ),
                        320,
                    )
                    for name in SIGNALS
                ]
                whole = pair(*drawn[:2]) + drawn[2]
                parts.append(whole if run == "chirp" else folded(f"{family.title}, step", whole))
        return "".join(parts)
