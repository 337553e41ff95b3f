"""Mappings as Markdown tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_SIGNS = str.maketrans({"|": r"\|", "\n": " ", "\r": " ", "`": "'", "<": "&lt;", "[": r"\[", "*": r"\*", "_": r"\_"})


def escaped(value: object) -> str:
    """Text that Markdown shows as it is, and that cannot break a table."""
    return str(value).translate(_SIGNS)


def table(title: str, values: Mapping[str, Any]) -> str:
    """A heading and a table of two columns; a cell's line breaks and bars cannot break the table."""
    rows = "".join(f"| {_cell(name)} | {_cell(value)} |\n" for name, value in values.items())
    return f"# {_cell(title)}\n\n| quantity | value |\n|---|---|\n{rows}"


def _cell(value: object) -> str:
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return " ".join(text.replace("|", "\\|").split())
