"""A result as a file: what its view lists, as a report, as a recording for the Rerun viewer, or as a table.

This module is the package's entry point in the group `ema_model.views`: by it results show and export themselves.
"""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go

from ema_model.errors import InputError, quoted
from ema_model.files.written import write_text
from ema_model.result import Result, shown_by
from ema_model.text import InWords
from emaviz.report import html_document as document
from emaviz.views import Figures, Section, View, view_of

SUFFIXES = (".html", ".rrd", ".csv")


def figures(result: Result) -> list[go.Figure]:
    """All figures of a result, in reading order."""
    return view_of(result).figures(result)


def export(result: InWords, path: str | Path, configuration: Mapping[str, Any] | None = None) -> None:
    """Writes one of `SUFFIXES`, whole or not at all; InputError, one line, where that cannot be done.

    configuration: the options that it was computed with, which a recording holds.
    """
    view, path = view_of(result), Path(path)
    if path.suffix == ".rrd":
        write = view.record
        if write is None:
            if not isinstance(result, Result):
                raise InputError(f"{quoted(path)}: a {type(result).__name__} is no recording; write it as .html")
            from emaviz.views.recording import write_recording  # rerun takes a second to import

            write_recording(view, result, path, configuration or {})
        else:
            write(result, path, configuration or {})
    elif path.suffix == ".csv":
        _write_table(view, result, path)
    else:
        sections = [_Written(one) for one in view.sections]
        document.write(path, document.page(view.title(result), view.lead(result), sections, result))


class _Written(document.Section[Any]):
    """A section of a view as a section of a report."""

    def __init__(self, section: Section[Any]) -> None:
        self.title, self.anchor, self._parts = section.title, section.anchor, section.parts

    def body(self, subject: Any, figures: document.Figures) -> str:
        """ "" where a result has nothing for any of its parts."""
        return "".join(self._written(subject, figures))

    def _written(self, subject: Any, figures: document.Figures) -> Iterator[str]:
        for part in self._parts:
            if not isinstance(part, Figures):
                yield document.in_words(part.of(subject))
                continue
            for row in part.of(subject):
                placed = [figures.place(one, part.height(subject)) for one in row]
                yield document.pair(*placed) if len(placed) > 1 else "".join(placed)


def _write_table(view: View[Any], result: InWords, path: Path) -> None:
    if view.columns is None:
        raise InputError(f"{quoted(path)}: a {type(result).__name__} is no table; write it as .json")
    columns = {name: np.atleast_1d(values) for name, values in view.columns(result).items()}
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(columns)
    rows.writerows(zip(*([_cell(one) for one in values.tolist()] for values in columns.values())))
    write_text(path, text.getvalue(), "the table")


def _cell(value: object) -> object:
    """What is no number stays empty."""
    return "" if isinstance(value, float) and not np.isfinite(value) else value


shown_by(sys.modules[__name__])  # type: ignore[arg-type]  a module is what it offers
