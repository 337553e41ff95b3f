"""A result in words: made once, beside the result, and shown as plain text or in a notebook."""

from __future__ import annotations

from ema_model.text.document import COLOURS, Document, InWords, Lines, Note, Remark, Remarks, Table

__all__ = ["COLOURS", "Document", "InWords", "Lines", "Note", "Remark", "Remarks", "Table"]
