"""With what the report was made, so that it can be made again."""

from __future__ import annotations

from ema_model.actuator.naming import on_axes
from ema_model.quantities.numbers import number
from emaviz import __version__
from emaviz.report.identification.subject import Identified
from emaviz.report.markup import table
from emaviz.report.section import Figures, Section


class Settings(Section[Identified]):
    """Options, and the actuator's parameters that the fit moved beside k."""

    title = "How it was made"
    anchor = "made"
    place = 40

    def body(self, subject: Identified, figures: Figures) -> str:
        """Always there."""
        given = {name: value for name, value in subject.configuration.items() if value not in (None, [], "")}
        actuator = subject.objective.actuator
        rows = [[name.replace("_", " "), value] for name, value in ({"actuator": actuator.name} | given).items()]
        made = table(["Setting", "value"], [*rows, ["emaviz", __version__]], text_columns=2)
        moved = [
            [on_axes(path, actuator.axes).path, number(float(actuator.value(path)), 4), number(value, 4)]
            for path, value in subject.answer.parameters.items()
        ]
        return made + (table(["Moved beside k", "file", "fitted"], moved) if moved else "")
