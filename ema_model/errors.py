"""What a user can do wrong, told in one line.

Such lines quote names and values of files, which anybody may have made: as long as a file, or full of signs that turn a
terminal's text round.  `quoted` shortens one piece; what quotes foreign text calls it.
"""

from __future__ import annotations

from collections.abc import Iterable

MOST_QUOTED = 300  # characters of any one piece of foreign text
_LONGEST_LINE = 1000  # of whole lines; each is shorter where its pieces are quoted
_KEPT = 300  # of either end of a longer one


class InputError(ValueError):
    """A user's mistake.  Its message is one line: what is wrong, where, and what to do about it.

    Whatever the message quotes, it stays one line without control characters, and no longer than a paragraph.
    """

    def __init__(self, message: str = "") -> None:
        super().__init__(_ends(_visible(_ends(message))))  # signs that are made visible can grow


def quoted(value: object, most: int = MOST_QUOTED) -> str:
    """Foreign text on one line, cut to `most` characters, its control characters as signs that can be seen."""
    text = str(value)
    # Cut first: what is cut off may be as long as a file.  A sign that was made visible can be several characters.
    shown = _visible(text[: most + 1])
    return shown if len(shown) <= most else shown[: most - 1] + "…"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """ "; did you mean 'x'?" where one of the known names is like this one, else ""; to end the line of a refusal."""
    from difflib import get_close_matches  # takes a while to import, and few need it

    like = get_close_matches(str(name)[:MOST_QUOTED], list(known), n=1, cutoff=0.6)
    return f"; did you mean {quoted(like[0])!r}?" if like else ""


def _ends(line: str) -> str:
    return line if len(line) <= _LONGEST_LINE else f"{line[:_KEPT]} … {line[-_KEPT:]}"


def _visible(text: str) -> str:
    return text if text.isprintable() else "".join(map(_sign, text))


def _sign(character: str) -> str:
    """␊ for a newline, a space for any wide or narrow one, ⟨U+202E⟩ for what turns text round or has no sign."""
    code = ord(character)
    if character.isprintable():
        return character
    if code < 0x20:
        return chr(0x2400 + code)
    if code == 0x7F:
        return "␡"
    return " " if character.isspace() and code not in (0x85, 0x2028, 0x2029) else f"⟨U+{code:04X}⟩"
