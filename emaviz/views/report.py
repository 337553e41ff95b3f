"""A result as a file: what its view lists, as a report, as a recording for the Rerun viewer, or as a table."""

from __future__ import annotations

import base64
import csv
import hashlib
import html
import io
import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from ema_model.errors import InputError, quoted
from ema_model.files.written import write_text
from ema_model.result import Result, shown_by
from ema_model.text import Block, InWords, Lines, Note, Table
from emaviz import __version__
from emaviz.figures.theme import DARK, LIGHT
from emaviz.views import Bullets, Columns, Group, Line, Links, Markup, Piece, Row, Section, Verdict, View, view_of

# --- what a report is made of: markup, sections with their figures, and the page that holds them ----------------------

_FEW_COLUMNS = 2  # that a narrow page has room for
_STRONG = "\x1e"  # before the number that a row is marked by


def escape(text: object) -> str:
    """Text as HTML shows it, in an element or in a quoted attribute."""
    return html.escape(str(text), quote=True)


def paragraph(text: object, kind: str = "") -> str:
    """A paragraph of plain text."""
    return f"<p{_class(kind)}>{escape(text)}</p>"


def bullets(texts: Iterable[object], kind: str = "") -> str:
    """A list of plain texts; nothing for none."""
    items = "".join(f"<li>{escape(text)}</li>" for text in texts)
    return f"<ul{_class(kind)}>{items}</ul>" if items else ""


def marked(texts: Iterable[object], marks: Iterable[tuple[str, str]]) -> str:
    """A list of plain texts, each behind a mark: its name, and the sign."""
    items = (
        f'<li><span class="{name}" title="{name}">{sign}</span>{escape(text)}</li>'
        for text, (name, sign) in zip(texts, marks)
    )
    return f'<ul class="findings">{"".join(items)}</ul>'


def table(heads: Sequence[str], rows: Iterable[Sequence[object]], *, text_columns: int = 1, marked: str = "") -> str:
    """A table of plain texts; the first `text_columns` are set left, the others, numbers, right.

    marked: a cell that starts with this sign is set strongly, without the sign.  On a narrow page, a row of more
    columns than it has room for becomes a list, in which each value has its column's title beside it.
    """

    def cell(tag: str, at: int, value: object) -> str:
        text = str(value)
        strong = bool(marked) and text.startswith(marked)
        kind = " ".join(["" if at < text_columns else "n", "strong" if strong else ""]).strip()
        of = f' data-of="{escape(heads[at])}"' if tag == "td" and at < len(heads) else ""
        return f"<{tag}{_class(kind)}{of}>{escape(text.removeprefix(marked) if strong else text)}</{tag}>"

    head = "".join(cell("th", i, title) for i, title in enumerate(heads))
    body = "".join("<tr>" + "".join(cell("td", i, v) for i, v in enumerate(row)) + "</tr>" for row in rows)
    many = " many" if len(heads) > _FEW_COLUMNS else ""
    return f'<div class="wide{many}"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def with_remarks(told: Table) -> str:
    """A table of a result's document; what stands beside its rows is a last column."""
    remarks = told.remarks or [""] * len(told.rows)
    beside = any(remarks)
    strong = [one in ("warning", "bad") for one in told.severities] or [False] * len(told.rows)
    rows = [
        [*row[:-1], f"{_STRONG if marked else ''}{row[-1]}", *([remark] if beside else [])]
        for row, remark, marked in zip(told.rows, remarks, strong)
    ]
    return table([told.title, *told.head, *([""] if beside else [])], rows, marked=_STRONG)


def link(anchor: str, text: object) -> str:
    """A link to a place in the same page."""
    return f'<a href="#{escape(anchor)}">{escape(text)}</a>'


def folded(title: object, body: str) -> str:
    """A part that opens with a click; body is HTML."""
    return f"<details><summary>{escape(title)}</summary>{body}</details>"


def _class(kind: str) -> str:
    return f' class="{kind}"' if kind else ""


# --- what a report is made of: sections as HTML, and the figures that they place --------------------------------------


class Figures:
    """The figures of a page in their order; drawn in the browser when they come into sight."""

    def __init__(self) -> None:
        self.placed: list[go.Figure] = []

    def place(self, figure: go.Figure, height_px: int = 320, anchor: str = "") -> str:
        """The element in which the figure will stand; anchor: what links to it name."""
        self.placed.append(figure)
        named = f' id="{escape(anchor)}"' if anchor else ""
        return f'<div class="figure"{named} style="height:{height_px}px" data-figure="{len(self.placed) - 1}"></div>'


def pair(*figures: str) -> str:
    """Placed figures side by side where there is room, else one below the other."""
    return f'<div class="pair">{"".join(figures)}</div>'


class Written(NamedTuple):
    """One part of a report, with a heading of its own and an anchor to link to."""

    title: str
    anchor: str
    body: str  # HTML


# --- a whole page: styles, sections, figures and the script that draws them, in one file that asks no network ---------


def page(title: str, lead: str, sections: Iterable[Written], figures: Figures) -> str:
    """The HTML of a report; lead: plain text below the title.  A section without a body is left out."""
    written = [one for one in sections if one.body]
    contents = "".join(f'<a href="#{escape(s.anchor)}">{escape(s.title)}</a>' for s in written)
    parts = "".join(f'<section id="{escape(s.anchor)}"><h2>{escape(s.title)}</h2>{s.body}</section>' for s in written)
    style, script = _own("report.css"), _own("report.js")
    plotly = get_plotlyjs()
    now = datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z")
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_policy(plotly, script)}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<title>{escape(title)} – emaviz</title>\n<style>{style}</style>\n</head>\n<body>\n<main>\n"
        f'<header><h1>{escape(title)}</h1><p class="lead">{escape(lead)}</p></header>\n'
        f"<nav>{contents}</nav>\n{parts}\n"
        f"<footer>Written by emaviz {escape(__version__)}, {escape(now)}.</footer>\n</main>\n"
        f'<script type="application/json" id="figures">{_figures(figures)}</script>\n'
        f"<script>{plotly}</script>\n<script>{script}</script>\n</body>\n</html>\n"
    )


def write_page(path: str | Path, text: str) -> None:
    """Writes a page, whole or not at all; InputError in one line where that cannot be done."""
    write_text(path, text, "the report")


def _figures(figures: Figures) -> str:
    """Figures and templates as JSON that cannot end the element it stands in."""
    drawn = ",".join(json.dumps(_without_template(json.loads(str(f.to_json())))) for f in figures.placed)
    themes = json.dumps({"light": LIGHT.template().to_plotly_json(), "dark": DARK.template().to_plotly_json()})
    text = f'{{"themes":{themes},"figures":[{drawn}]}}'
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _without_template(figure: dict) -> dict:
    """The page gives each figure the template of light or dark."""
    figure["layout"].pop("template", None)
    return figure


def _policy(*scripts: str) -> str:
    """Nothing may be fetched, and no script may run but these."""
    hashes = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'" for script in scripts
    )
    return f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'"


def _own(name: str) -> str:
    return resources.files("emaviz.views").joinpath(name).read_text(encoding="utf-8")


# --- the section that says what the terminal says ---------------------------------------------------------------------


def in_words(blocks: Iterable[Block]) -> str:
    """Blocks of a result's document, one after another."""
    return "".join(map(_block, blocks))


def _block(block: Block) -> str:
    if isinstance(block, Lines):
        head = paragraph(block.title) if block.title else ""
        return head + "".join(paragraph(line) for line in block.lines)
    if isinstance(block, Note):
        return bullets([block.line], "warning")
    return with_remarks(block) if isinstance(block, Table) else ""


# --- a result as a file -----------------------------------------------------------------------------------------------
# This module is the package's entry point in the group `ema_model.views`: by it results show and export themselves.

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
        drawn = Figures()
        written = [Written(one.title, one.anchor, markup(one.pieces(result), drawn)) for one in sections]
        write_page(path, page(view.title(result), view.lead(result), written, drawn))


# --- a section as HTML ------------------------------------------------------------------------------------------------


def markup(pieces: Iterable[Piece], figures: Figures) -> str:
    """Pieces of a section as HTML, their figures placed."""
    return "".join(_piece(one, figures) for one in pieces)


def _piece(one: Piece, figures: Figures) -> str:
    if isinstance(one, Row):
        anchors = [*one.anchors, *[""] * len(one.figures)]
        placed = [figures.place(each, one.height_px, anchor) for each, anchor in zip(one.figures, anchors)]
        return pair(*placed) if len(placed) > 1 else "".join(placed)
    if isinstance(one, Group):
        body, title = markup(one.pieces, figures), escape(one.title)
        if one.folded:
            return folded(one.title, body)
        anchor = f' id="{escape(one.anchor)}"' if one.anchor else ""
        if one.framed:
            return f'<div class="region"{anchor}><h3>{title}</h3>{body}</div>'
        return f"<h3{anchor}>{title}</h3>{body}"
    if isinstance(one, Line):
        return paragraph(one.text, one.tone)
    if isinstance(one, Verdict):
        return f'<p><span class="verdict {one.meaning}">{escape(one.text)}</span></p>'
    if isinstance(one, Bullets):
        return marked(one.lines, one.marks) if one.marks else bullets(one.lines, one.tone)
    if isinstance(one, Links):
        links = " · ".join(link(anchor, text) for anchor, text in one.to.items())
        return f'<p class="small">{escape(one.lead)}: {links}</p>'
    if isinstance(one, Columns):
        return table(one.head, one.rows, text_columns=one.text_columns, marked=one.marked)
    return one.html if isinstance(one, Markup) else in_words([one])


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
