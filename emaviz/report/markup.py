"""HTML from plain text.  Whatever comes from files goes through `escape`."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

from ema_model.text import Table

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


def table(heads: Sequence[str], rows: Iterable[Sequence[object]], *, text_columns: int = 1, marked: str = "") -> str:
    """A table of plain texts; the first `text_columns` are set left, the others, numbers, right.

    marked: a cell that starts with this sign is set strongly, without the sign.
    """

    def cell(tag: str, at: int, value: object) -> str:
        text = str(value)
        strong = bool(marked) and text.startswith(marked)
        kind = " ".join(["" if at < text_columns else "n", "strong" if strong else ""]).strip()
        return f"<{tag}{_class(kind)}>{escape(text.removeprefix(marked) if strong else text)}</{tag}>"

    head = "".join(cell("th", i, title) for i, title in enumerate(heads))
    body = "".join("<tr>" + "".join(cell("td", i, v) for i, v in enumerate(row)) + "</tr>" for row in rows)
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def document_table(told: Table | None, title: str) -> str:
    """A table of a result's document, with what stands beside its rows as a last column; nothing for none."""
    if told is None:
        return ""
    return folded(f"{title} {told.unit}".rstrip(), with_remarks(told))


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
