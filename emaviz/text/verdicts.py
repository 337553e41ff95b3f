"""What verdicts mean, by their colours, and the sentences of results that page and reports share."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Literal

from ema_model.comparison.result import Comparison
from ema_model.discovery.result import Discovery
from ema_model.fleet.result import UnitsCompared
from ema_model.identification.run import Identification, remarks
from ema_model.text import COLOURS, Block, Document, Table
from emaviz.text.html import Html, boxed, html, joined, unescaped

# --- what a verdict means, which its colour says on the page as in a report -------------------------------------------

Meaning = Literal["good", "found", "warning", "bad", "open"]
MEANINGS: dict[Meaning, str] = {
    "good": COLOURS["good"],  # nothing is missing
    "found": "light-dark(#1c5fc4,#74b0ff)",  # something is, and is named
    "warning": COLOURS["warning"],  # something is, of which nothing is known
    "bad": COLOURS["bad"],
    "open": "inherit",  # it is still looked at
}


def of_comparison(comparison: Comparison) -> Meaning:
    """A comparison says where the model fails, and never why; it is good where no more is left than a true model's."""
    return "good" if comparison.adequate and comparison.is_within_band else "warning"


def of_units(found: UnitsCompared) -> Meaning:
    """Units that differ call for attention, and models that miss something cannot say that none does."""
    return "warning" if found.differences or found.scattering or found.is_missed else "good"


def of_discovery(found: Discovery) -> Meaning:
    """An actuator with a fault, or with another controller or parameters than its file's, is not as it should be."""
    if found.verdict == "adequate":
        other = found.faults or found.parameters_outside_tolerance or found.controller_seen or found.loop_lag
        return "found" if other else "good" if found.is_within_band else "warning"
    return "found" if found.verdict == "effects_found" else "warning"


# --- a line as a sentence on the page ---------------------------------------------------------------------------------
# A line as a sentence on the page: errors and notes begin with a small letter where they follow a program's name.

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


# --- what a result says, on the page: its document's blocks, and how an answer begins ---------------------------------


def shown(block: Block | None) -> Html:
    """A block of a document, escaped by itself; nothing for none."""
    return Html() if block is None else unescaped(block.html)


def whole(told: Document) -> Html:
    """All that a result says, as a notebook shows it: its blocks escape what is not theirs."""
    return html('<div style="padding:2px 12px;font-size:12.5px;overflow-x:auto">{}</div>', unescaped(told.html))


def folded(title: str, told: Table | None) -> Html:
    """A table below its title, which opens it; nothing for none."""
    if told is None:
        return Html()
    return html('<details><summary style="cursor:pointer">{}</summary>{}</details>', title, shown(told))


def large(text: str, meaning: Meaning) -> Html:
    """The answer in one line."""
    style = f"font-size:16px;font-weight:600;color:{MEANINGS[meaning]};padding:4px 0"
    return html('<div style="{}">{}</div>', style, text)


def warned(warnings: Iterable[str], names: Iterable[str] = ()) -> Html:
    """A line for each warning; names that may stand first in one stay as they are written."""
    style = f"color:{COLOURS['warning']};overflow-wrap:anywhere"
    return joined(html('<div style="{}">▲ {}</div>', style, begun(text, names)) for text in warnings)


# --- how sure an identification is, on the page -----------------------------------------------------------------------


def sure_words(answer: Identification | None) -> Html:
    """HTML below the bars; empty while a search runs."""
    if answer is None:
        return Html()
    return joined(
        boxed(html('<b style="color:{}">{}</b>: {}', COLOURS[one.severity], _capital(one.head), one.line))
        for one in remarks(answer)
    )


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
