"""A result in words: made once, beside the result, and shown as plain text or in a notebook."""

from __future__ import annotations

from ema_model.text.document import (
    COLOURS,
    Block,
    Document,
    Facts,
    InWords,
    Lines,
    Note,
    Remark,
    Remarks,
    Severity,
    Table,
)

__all__ = [
    "COLOURS",
    "Block",
    "Document",
    "Facts",
    "InWords",
    "Lines",
    "Note",
    "Remark",
    "Remarks",
    "Severity",
    "Table",
]
