"""The error after each step, fitted and held out, and by signal."""

from __future__ import annotations

from ema_model.discovery.words import FLOOR_NOTE, per_recording, rung_title
from ema_model.quantities.numbers import number
from ema_model.quantities.shown import of_signal
from emaviz.figures import error_ladder
from emaviz.report.discovery.subject import Told
from emaviz.report.markup import document_table, paragraph, table
from emaviz.report.section import Figures, Section


class Ladder(Section[Told]):
    """Figure and table."""

    title = "The ladder"
    anchor = "ladder"
    place = 20

    def body(self, subject: Told, figures: Figures) -> str:
        """Always there."""
        found = subject.found
        held = any(rung.holdout_rmse is not None for rung in found.ladder)
        shown = {
            name: of_signal(name, found.actuator.axes).scaled([rung.signals[name] for rung in found.ladder])
            for name in found.ladder[0].signals
        }
        heads = ["Step", "fitted / floor", *(["held out / floor"] if held else [])]
        heads += [f"{one.title}, rms" for one in shown.values()]
        rows = []
        for rung in found.ladder:
            row = [rung_title(rung.change, found.actuator.axes), number(rung.rmse)]
            if held:
                row.append("–" if rung.holdout_rmse is None else number(rung.holdout_rmse))
            rows.append([*row, *(one.text(rung.signals[name]) for name, one in shown.items())])
        return (
            figures.place(error_ladder.figure(found), 360, "error-ladder")
            + table(heads, rows)
            + paragraph(FLOOR_NOTE, "small")
            + document_table(per_recording(found), "Each recording")
        )
