"""k1 … k8 with their intervals, and what they mean."""

from __future__ import annotations

from ema_model import faults
from ema_model.actuator.readings import readings, sentences
from ema_model.quantities.numbers import number
from emaviz.figures.fault_bars import fault_bars
from emaviz.report.identification.subject import Identified
from emaviz.report.markup import bullets, table
from emaviz.report.section import Figures, Section
from emaviz.text.identification import sure_words

_MARK = "\x1e"  # before a k that is surely not healthy


class Faults(Section[Identified]):
    """The answer: in words, as bars, in numbers."""

    title = "Faults"
    anchor = "faults"
    place = 10

    def body(self, subject: Identified, figures: Figures) -> str:
        """Always there."""
        answer, actuator = subject.answer, subject.objective.actuator
        sure = answer.uncertainty
        rows = [
            [
                f"{fault.name} {fault.title}",
                phrase,
                f"{_MARK if fault.name in sure.alarms else ''}{answer.k[i]:.4f}",
                f"{sure.interval90[i, 0]:.4f} … {sure.interval90[i, 1]:.4f}",
                *([] if answer.truth is None else [f"{answer.truth[i]:.4f}"]),
            ]
            for i, (fault, phrase) in enumerate(zip(faults.FAULTS, sentences(answer.k, actuator)))
        ]
        heads = ["Fault", "meaning", "k", "90 % interval", *([] if answer.truth is None else ["truth"])]
        physical = [[name.replace("_", " "), number(v)] for name, v in readings(answer.k, actuator).items()]
        return "".join(
            [
                sure_words(answer),
                fault_bars(
                    answer.k, actuator, answer.truth, sure.interval90, sure.alarms, sure.detectable, sure.adequate
                ),
                table(heads, rows, text_columns=2, marked=_MARK),
                table(["Physical reading", "value"], physical),
                bullets(sure.warnings, "warning"),
            ]
        )
