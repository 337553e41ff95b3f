"""How sure an identification is, in words: health, what cannot be told apart, and what would tell it."""

from __future__ import annotations

from ema_model.faults import FAULTS
from ema_model.identification.run import Identification
from ema_model.quantities.titles import in_sentence
from ema_model.simulation.words import run_in_words
from emaviz.text.html import Html, html, joined

_BOX = Html('style="padding:4px 12px;font-size:13px;line-height:1.45"')
_GOOD, _BAD, _WARNING = "#2b8a3e", "#e03131", "#e8590c"


def sure_words(answer: Identification | None) -> Html:
    """HTML below the bars; empty while a search runs."""
    if answer is None:
        return Html()
    sure = answer.uncertainty
    lines = []
    if not sure.adequate:
        lines.append(_line(_BAD, "The model does not fit", " ".join(sure.warnings)))
    elif sure.healthy:
        lines.append(_line(_GOOD, "Healthy", "no k is surely off (joint test at 1 %)"))
    else:
        named = ", ".join(fault.label for fault in FAULTS if fault.name in sure.alarms)
        lines.append(_line(_BAD, "Not healthy", named or "all k together, though no single one stands out"))
    for group in sure.ambiguous:
        names = " and ".join(_named(name) for name in group)
        lines.append(_line(_WARNING, "Cannot be told apart", f"{names} do the same to this recording"))
    if sure.hardly_known:
        names = ", ".join(_named(name) for name in sure.hardly_known)
        told = f"this recording says hardly anything of {names}, and the other intervals rest on them"
        lines.append(_line(_WARNING, "Hardly known", told))
    if run := sure.separated_by:
        lines.append(_line(_WARNING, "What would tell more", run_in_words(run.command, run.settings, run.duration_s)))
    if not answer.polished:
        told = "The intervals are those of a fit from here; the answer of the search alone may lie at their edge."
        lines.append(html("<div {}><span style='opacity:.7'>{}</span></div>", _BOX, told))
    return joined(lines)


def _named(name: str) -> str:
    return next(f"{fault.name} ({in_sentence(fault.title)})" for fault in FAULTS if fault.name == name)


def _line(colour: str, head: str, text: str) -> Html:
    return html('<div {}><b style="color:{}">{}</b>: {}</div>', _BOX, colour, head, text)
