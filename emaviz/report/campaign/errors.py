"""What could not be computed."""

from __future__ import annotations

from ema_model.campaign.summary import failed
from emaviz.report.campaign.subject import Rows
from emaviz.report.markup import paragraph, table
from emaviz.report.section import Figures, Section

_MOST = 200


class Errors(Section[Rows]):
    """A line a task."""

    title = "Errors"
    anchor = "errors"
    place = 60

    def body(self, subject: Rows, figures: Figures) -> str:
        """Left out where there are none."""
        errors = failed(subject.store)
        if not errors:
            return ""
        lines = [[row["group"], row["case"], row["seed"], row["error"], row["name"]] for row in errors[:_MOST]]
        heads = ["Group", "case", "seed", "error", "task"]
        more = f", of which the first {_MOST} are shown" if len(errors) > _MOST else ""
        return paragraph(f"{len(errors)} tasks ended in an error{more}.") + table(heads, lines, text_columns=5)
