"""A result in words: made once, beside the result, and shown as plain text or in a notebook."""

from __future__ import annotations

from ema_model.text.document import Document, InWords, Lines, Note, Table

__all__ = ["Document", "InWords", "Lines", "Note", "Table"]
