"""A data health card in words: what is wrong first."""

from __future__ import annotations

from ema_model.recordings.health.card import Health
from ema_model.recordings.health.finding import MARKS
from ema_model.text import Document, Lines


def document_of(card: Health) -> Document:
    """A line for each finding, with its mark."""
    lines = [f"{MARKS[one.severity]} {one.sentence}" for one in card.worst_first]
    return Document([Lines(lines, f"Data health {card.name}")])
