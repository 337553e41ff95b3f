"""HTML and MathML of the page and reports, escaped."""

from __future__ import annotations

import re
import string
from collections.abc import Iterable, Sequence
from html import escape
from html import escape as _escape
from typing import TYPE_CHECKING, Any, Literal, LiteralString

if TYPE_CHECKING:
    import viser


# --- text on the page: what comes from files and people is shown as it is, and never becomes markup -------------------
# A name of a file, a column or an actuator, an expression, an error that quotes them: all are plain text. `html` puts
# them into a template of ours, escaped. `add_html` is the one place from which the page gets HTML: what was not made
# by `html` is plain text to it, and shown letter by letter. Markdown on the page is for texts of our own alone, as
# its renderer takes HTML and turns bare addresses into links.


class Html(str):
    """Text that is HTML already: literals of ours, and what the functions below return.  Foreign text never is."""

    __slots__ = ()

    def __new__(cls, literal: LiteralString = "") -> Html:
        return str.__new__(cls, literal)

    def __add__(self, other: str) -> Html:
        return unescaped(str.__add__(self, html_escape(other)))

    def __radd__(self, other: str) -> Html:
        return unescaped(str.__add__(html_escape(other), self))


def unescaped(text: str) -> Html:
    """Text that is taken for HTML as it is: for style sheets and drawings, made of numbers and colours of ours."""
    return str.__new__(Html, text)


def html_escape(value: object) -> Html:
    """As HTML shows it, in an element or in a quoted attribute; HTML stays what it is."""
    return value if isinstance(value, Html) else unescaped(_escape(str(value), quote=True))


def html(template: LiteralString, *values: object, **named: object) -> Html:
    """A template as of `str.format`, its values escaped; only a literal can be one, so no name gets into it."""
    return unescaped(_ESCAPING.vformat(template, values, named))


def joined(parts: Iterable[str], between: LiteralString = "") -> Html:
    """Pieces one after another, escaped where they are plain text."""
    return unescaped(between.join(html_escape(part) for part in parts))


def add_html(gui: viser.GuiApi, content: str = "", *, visible: bool = True) -> HtmlPiece:
    """A piece of the page; plain text is shown as it is."""
    return HtmlPiece(gui.add_html(_sent(content), visible=visible))


class HtmlPiece:
    """A piece of the page that can be written anew."""

    def __init__(self, handle: viser.GuiHtmlHandle) -> None:
        self._handle: Any = handle

    @property
    def content(self) -> Html:
        """What it shows.  Plain text that is set is escaped."""
        return unescaped(self._handle.content)

    @content.setter
    def content(self, content: str) -> None:
        self._handle.content = _sent(content)

    def remove(self) -> None:
        """Takes it off the page."""
        self._handle.remove()

    @property
    def visible(self) -> bool:
        """Whether it is seen."""
        return self._handle.visible

    @visible.setter
    def visible(self, visible: bool) -> None:
        self._handle.visible = visible


def said(text: str) -> Html:
    """A line or more in the page's ordinary size, as below a button; nothing for no text."""
    return html('<div style="padding:0 12px 10px;font-size:14px;line-height:1.55">{}</div>', text) if text else Html()


def _sent(content: str) -> str:
    """What goes to the browser, which viser packs only as a `str` and no kind of it."""
    return str(html_escape(content))


class _Escaping(string.Formatter):
    def format_field(self, value: Any, format_spec: str) -> str:
        return html_escape(value if isinstance(value, Html) and not format_spec else format(value, format_spec))


_ESCAPING = _Escaping()


# --- an effect's equation, as its file has it, typeset ----------------------------------------------------------------
# An effect's equation, as its file has it, typeset: plain text to MathML, which browsers draw without a script.
#
# Known: names with _ and ^ (one sign, or braces around several), fractions where "/" stands without spaces, functions
# of names of several letters, brackets, bars. What is not known is shown as it stands.

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


# --- small texts between the page's controls --------------------------------------------------------------------------

BOX = Html('style="padding:2px 12px 6px;font-size:13px;line-height:1.45"')
DIM = Html('style="opacity:.65"')


_CARD = (
    "max-width:600px;margin:7vh auto 0;padding:18px 26px 20px;border:1px dashed rgba(134,142,150,.6);"
    "border-radius:8px;font-size:14px;line-height:1.55"
)


def begin(title: str, steps: Sequence[str], example: Html | None = None) -> Html:
    """Where there is no result yet: what to do, and what comes of it; example: a button that shows it."""
    rows = joined(html('<li style="padding:3px 0">{}</li>', step) for step in steps)
    return html(
        '<div class="emaviz-all-columns" style="{}">'
        '<div style="font-size:17px;font-weight:600;padding-bottom:6px">{}</div>'
        '<ol style="margin:0;padding-left:20px">{}</ol>{}</div>',
        _CARD,
        title,
        rows,
        example or Html(),
    )


WAITS = joined([Html('<div class="emaviz-waits"></div>')] * 3)  # where parts of a result will stand


def waiting(title: str, about: str) -> Html:
    """Where a result will be, while it is computed: what goes on, and a picture that moves."""
    head = html('<div style="font-size:16px;font-weight:600;padding:4px 0">{} …</div>', title)
    return html('<div class="emaviz-all-columns"><div {}>{}{}</div>{}</div>', BOX, head, about, WAITS)


def boxed(content: str) -> Html:
    """Plain text or HTML, as wide as the controls' names."""
    return html("<div {}>{}</div>", BOX, content)


def note(text: str) -> Html:
    """A line of small print."""
    return boxed(html("<span {}>{}</span>", DIM, text))


# --- abbreviations and terms of the field that the page uses, each explained where it stands --------------------------

TERMS = {
    "Err": "Error of k in %: how far the eight k that were found are from the true ones (the thesis's equation 5.2)",
    "PC": "Performance coefficient in %: error times time, beside the other algorithms of the same race; higher is "
    "better (the thesis's equation 5.4)",
    "uncorrected error": "rms of measured less model current as it is drawn; what the simplified model is known to "
    "lack counts as error here",
    "corrected error": "rms of measured less model current, with what the simplified model is known to lack added",
    "equivalent current": "The one current that makes the motor's torque as its three phase currents do together "
    "(the thesis's equation 3.14)",
    "times the floor": "The floor is what a true model would still leave: the sensors' noise, and what the model "
    "leaves out on purpose. At 1 nothing is missing",
    "× floor": "Error over the floor, which is what a true model would still leave: 1 means that nothing is missing",
    "cross-validated": "Fitted to parts of the recordings and judged on the others, so that chance explains nothing",
    "rms": "Root mean square: the usual size of an error, sign and moment aside",
    "mean |e|": "Mean size of the error, whatever its sign",
    "of range": "The rms error in % of what the signal goes through, from its least to its largest value",
    "σ": "Standard deviations: of a parameter, those of its tolerance in the actuator's file",
    "90 % interval": "Nine of ten such intervals hold the true value",
}
_EVERY = re.compile("|".join(rf"(?<![\w-]){re.escape(one)}(?![\w-])" for one in sorted(TERMS, key=len, reverse=True)))
_TAG = re.compile(r"(<[^>]*>)")


def explained(content: str) -> Html:
    """Text or HTML, each term underlined where it stands first, and explained to the pointer."""
    told: set[str] = set()

    def explain(found: re.Match[str]) -> str:
        term = found.group()
        if term in told:
            return term
        told.add(term)
        return str(html('<abbr title="{}">{}</abbr>', TERMS[term], term))

    parts, quiet = [], 0  # within what has a hint of its own, or is no text
    for part in _TAG.split(str(html_escape(content))):
        if part.startswith("<"):
            name = re.match(r"</?(\w*)", part)
            if name is not None and name.group(1) in ("abbr", "style", "svg", "math", "summary"):
                quiet += -1 if part.startswith("</") else 1
            parts.append(part)
        else:
            parts.append(part if quiet else _EVERY.sub(explain, part))
    return unescaped("".join(parts))
