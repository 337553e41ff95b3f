"""Takes TOML that comes from elsewhere: whatever is wrong with it ends in one kind of error, and soon."""

from __future__ import annotations

import re
import tomllib
from typing import Any

MARK = "\ufeff"  # what editors of Windows put before a text in UTF-8
# tomllib takes a time that grows with the square of a dotted key's parts: minutes for 100 kB of a.a.a.a….
_MOST_PARTS = 30
_PART = r"""(?: [\w-]+ | "[^"\n]*" | '[^'\n]*' ) [ \t]* \. [ \t]*"""
_LONG_KEY = re.compile(rf"(?<![\w-]) (?: {_PART} ){{{_MOST_PARTS}}}", re.VERBOSE)
# Whole numbers that Python reads, but does not write out into an error's line.
_LONG_NUMBER = re.compile(r"0[xob][0-9a-fA-F_]{1000}")


def toml_of(text: str) -> dict[str, Any]:
    """The document; ValueError, its text for a person, if it is none.  A byte order mark before it is no part of it."""
    text = text.removeprefix(MARK)
    if _LONG_KEY.search(text):
        raise ValueError(f"a key has more than {_MOST_PARTS} parts")
    if _LONG_NUMBER.search(text):
        raise ValueError("a number has too many digits")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    except tomllib.TOMLDecodeError:
        raise
    except ValueError:  # Python's own, of thousands of digits
        raise ValueError("a number has too many digits") from None
