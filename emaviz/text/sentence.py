"""A line as a sentence on the page: errors and notes begin with a small letter where they follow a program's name."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

_WORD = re.compile(r"[a-z]+(?=[ ,;])")  # no file's name, no key of an actuator's file, no k1


def begun(line: str, names: Iterable[str] = ()) -> str:
    """With a capital letter; a name, of those given or by its signs, stays as it is written."""
    if _WORD.match(line) is None or line.startswith(tuple(f"{name} " for name in names)):
        return line
    return line[:1].upper() + line[1:]


def within(text: str, folder: Path) -> str:
    """A text that names what lies in a folder relative to it."""
    for root in sorted({str(folder.absolute()), str(folder.resolve())}, key=len, reverse=True):
        text = re.sub(rf"(?<![\w./-]){re.escape(root)}[/\\]", "", text)
        text = re.sub(rf"(?<![\w./-]){re.escape(root)}(?![\w./-])", "the data folder", text)
    return text
