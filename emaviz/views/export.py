"""A result as a file: what its view lists, as a report, as a recording for the Rerun viewer, or as a table.

This module is the package's entry point in the group `ema_model.views`: by it results show and export themselves.
"""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go

from ema_model.errors import InputError, quoted
from ema_model.files.written import write_text
from ema_model.result import Result, shown_by
from ema_model.text import InWords
from emaviz.report import html_document as document
from emaviz.views import Bullets, Columns, Group, Line, Links, Markup, Piece, Row, Section, Verdict, View, view_of

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
        sections = [*view.sections]
        if view.made is not None:
            made = view.made
            sections.append(Section("How it was made", "made", of=lambda result: made(result, configuration or {})))
        drawn = document.Figures()
        written = [document.Written(one.title, one.anchor, markup(one.pieces(result), drawn)) for one in sections]
        document.write(path, document.page(view.title(result), view.lead(result), written, drawn))


# --- a section as HTML ------------------------------------------------------------------------------------------------


def markup(pieces: Iterable[Piece], figures: document.Figures) -> str:
    """Pieces of a section as HTML, their figures placed."""
    return "".join(_piece(one, figures) for one in pieces)


def _piece(one: Piece, figures: document.Figures) -> str:
    if isinstance(one, Row):
        anchors = [*one.anchors, *[""] * len(one.figures)]
        placed = [figures.place(each, one.height_px, anchor) for each, anchor in zip(one.figures, anchors)]
        return document.pair(*placed) if len(placed) > 1 else "".join(placed)
    if isinstance(one, Group):
        body, title = markup(one.pieces, figures), document.escape(one.title)
        if one.folded:
            return document.folded(one.title, body)
        anchor = f' id="{document.escape(one.anchor)}"' if one.anchor else ""
        if one.framed:
            return f'<div class="region"{anchor}><h3>{title}</h3>{body}</div>'
        return f"<h3{anchor}>{title}</h3>{body}"
    if isinstance(one, Line):
        return document.paragraph(one.text, one.tone)
    if isinstance(one, Verdict):
        return f'<p><span class="verdict {one.meaning}">{document.escape(one.text)}</span></p>'
    if isinstance(one, Bullets):
        return document.marked(one.lines, one.marks) if one.marks else document.bullets(one.lines, one.tone)
    if isinstance(one, Links):
        links = " · ".join(document.link(anchor, text) for anchor, text in one.to.items())
        return f'<p class="small">{document.escape(one.lead)}: {links}</p>'
    if isinstance(one, Columns):
        return document.table(one.head, one.rows, text_columns=one.text_columns, marked=one.marked)
    return one.html if isinstance(one, Markup) else document.in_words([one])


# --- a result as a table ----------------------------------------------------------------------------------------------


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
