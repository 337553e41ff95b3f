"""Figures 3.17–3.24: the Reference Model against the Monitor Model."""

from __future__ import annotations

from ema_model.quantities.shown import of_signal
from ema_model.quantities.titles import in_sentence
from emaviz.figures import model_pair
from emaviz.report.markup import paragraph
from emaviz.report.reproduce.subject import Reproduced
from emaviz.report.section import Figures, Section, pair

_SIGNALS = {  # the thesis's figures: the signal, and its error
    "motor_position_rad": "3.17, 3.18",
    "user_position_rad": "3.19, 3.20",
    "motor_speed_rad_s": "3.21, 3.22",
    "current_A": "3.23, 3.24",
}


class Models(Section[Reproduced]):
    """Four signals, healthy and faulty."""

    title = "Reference against monitor model (figures 3.17–3.24)"
    anchor = "models"
    place = 80

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Always there."""
        axes = subject.drawn.actuator.axes
        parts = []
        for one in subject.drawn.pairs:
            told = []
            for name in _SIGNALS:
                whole = of_signal(name, axes)
                rms = one.rms_difference(name)
                told.append(f"{in_sentence(whole.title)} {whole.scaled(rms).text(rms)}")
            parts.append(
                paragraph(f"{one.title}, on the chirp, at 10 kHz; rms of monitor − reference: {', '.join(told)}.")
            )
            drawn = [
                figures.place(
                    model_pair.figure(
                        f"{of_signal(name, axes).title}, {in_sentence(one.title)}"
                        + (f" ({number})" if one.name == "healthy" else ""),
                        one.reference,
                        one.monitor,
                        name,
                        axes=axes,
                    ),
                    340,
                )
                for name, number in _SIGNALS.items()
            ]
            parts += [pair(*drawn[at : at + 2]) for at in range(0, len(drawn), 2)]
        return "".join(parts)
