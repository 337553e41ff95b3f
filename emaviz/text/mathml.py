"""An effect's equation, as its file has it, typeset: plain text to MathML, which browsers draw without a script.

Known: names with _ and ^ (one sign, or braces around several), fractions where "/" stands without spaces, functions
of names of several letters, brackets, bars.  What is not known is shown as it stands.
"""

from __future__ import annotations

import re
from html import escape
from typing import Literal

from emaviz.text.html import Html, unescaped

_TOKEN = re.compile(r"\s+|\d+(?:\.\d+)?|[^\W\d_]['̇]*(?:[^\W\d_]['̇]*)*|.", re.UNICODE)
_FUNCTIONS = frozenset("sin cos tan exp sgn max min sat".split())
_WORDS = frozenset(
    "at controls current else for held holds in is its limit loop motion play read rest speed the while with".split()
)
_WORD = "<mtext>"
_SPACE = '<mspace width="0.17em"/>'  # between factors, where the text has one
_OPEN, _CLOSE = {"(": ")", "[": "]", "{": "}"}, frozenset(")]}")


def mathml(equation: str, display: Literal["block", "inline"] = "block") -> Html:
    """'<math …>…</math>' of an equation's text, on a line of its own or within one."""
    tokens = [one.group() for one in _TOKEN.finditer(equation)]
    rows, _ = _row(tokens, 0, "")
    opened = f'<math xmlns="http://www.w3.org/1998/Math/MathML" display="{display}">'
    return unescaped(f"{opened}<mrow>{''.join(rows)}</mrow></math>")


def _row(tokens: list[str], at: int, until: str) -> tuple[list[str], int]:
    """The pieces up to the closing bracket, and where it stands (or the end)."""
    found: list[str] = []
    apart = False
    while at < len(tokens) and not (until and tokens[at] == until):
        if tokens[at].isspace():
            at, apart = at + 1, bool(found)
            continue
        is_fraction = tokens[at] == "/" and found and 0 < at < len(tokens) - 1
        if is_fraction and not tokens[at - 1].isspace() and not tokens[at + 1].isspace():
            below, at = _piece(tokens, at + 1)
            found[-1] = f"<mfrac>{found[-1]}{below}</mfrac>"
            continue
        piece, at = _piece(tokens, at)
        if piece.startswith(_WORD) and found and not found[-1].startswith(_WORD):
            piece = piece.replace(_WORD, f"{_WORD}\u00a0", 1)
        elif apart and not piece.startswith(("<mo>", _WORD)) and not found[-1].startswith(("<mo>", _WORD)):
            found.append(_SPACE)
        found.append(piece)
        apart = False
    return found, at


def _piece(tokens: list[str], at: int) -> tuple[str, int]:
    """One name, number, sign or bracket with what stands below and above it, and where the next begins."""
    base, at = _bare(tokens, at)
    parts = {}
    while at < len(tokens) - 1 and tokens[at] in "_^" and tokens[at] not in parts:
        sign = tokens[at]
        part, at = _bare(tokens, at + 1)
        parts[sign] = part.replace("\u00a0", "")
    if len(parts) == 2:
        return f"<msubsup>{base}{parts['_']}{parts['^']}</msubsup>", at
    if parts:
        tag = "msub" if "_" in parts else "msup"
        return f"<{tag}>{base}{next(iter(parts.values()))}</{tag}>", at
    return base, at


def _bare(tokens: list[str], at: int) -> tuple[str, int]:
    token = tokens[at]
    if token in _OPEN:
        inside, end = _row(tokens, at + 1, _OPEN[token])
        shown = "".join(inside)
        if token != "{":
            closing = f"<mo>{_OPEN[token]}</mo>" if end < len(tokens) else ""
            shown = f"<mo>{token}</mo>{shown}{closing}"
        return f"<mrow>{shown}</mrow>", end + 1
    if token == "|" and "|" in tokens[at + 1 :]:
        inside, end = _row(tokens, at + 1, "|")
        first, last = (f'<mo form="{form}" fence="true" stretchy="false">|</mo>' for form in ("prefix", "postfix"))
        return f"<mrow>{first}{''.join(inside)}{last}</mrow>", end + 1
    if token[0].isdigit():
        return f"<mn>{token}</mn>", at + 1
    if token[0].isalpha():
        if token in _WORDS:
            return f"{_WORD}{token}\u00a0</mtext>", at + 1
        if token in _FUNCTIONS:
            return f'<mi mathvariant="normal">{token}</mi>', at + 1
        return f"<mi>{escape(token)}</mi>", at + 1
    return f"<mo>{escape(token)}</mo>", at + 1
