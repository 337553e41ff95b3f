"""TOML of plain tables, lists, texts and numbers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any


def toml_text(document: Mapping[str, Any]) -> str:
    """A document: tables at its top, what is in them inline."""
    lines = [f"{_key(name)} = {_inline(value)}" for name, value in document.items() if not isinstance(value, dict)]
    for name, table in document.items():
        if isinstance(table, dict):
            for inner, value in table.items():
                lines += ["", f"[{_key(name)}.{_key(inner)}]"]
                lines += [f"{_key(key)} = {_inline(one)}" for key, one in value.items()]
    return "\n".join(lines) + "\n"


def _inline(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(name)} = {_inline(one)}" for name, one in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return _key(value) if isinstance(value, str) else json.dumps(value)


def _key(text: str) -> str:
    """A text in quotes, which is a key, too."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
