"""Texts and styles of the Discover tab's cards: what each candidate would do, in one glance."""

from __future__ import annotations

from collections.abc import Sequence

from ema_model.discovery import Candidate
from ema_model.discovery.shown.fault_pages import size
from ema_model.discovery.shown.labels import effect_title
from ema_model.discovery.steps.snapshot import Look
from ema_model.effects import find
from ema_model.faults import BY_NAME
from ema_model.quantities.numbers import amount, number, with_uncertainty
from ema_model.quantities.titles import in_sentence
from emaviz.text.html import Html, unescaped

_CARD = (
    "height:auto!important;min-height:2em;padding:5px 9px;font-weight:400;font-size:12.5px;"
    "background-color:rgba(134,142,150,.10)!important;color:inherit!important;"
)
_LABEL = "display:block;height:auto;overflow:visible;white-space:pre-line;text-align:left;line-height:1.35;width:100%"
_LITTLE = 0.005  # of the error
_BAR = "rgba(240,140,0,.28)"


def label(look: Look, one: Candidate) -> str:
    """The lines of a card; its first is the effect's or fault's name."""
    title = effect_title(one.name)
    if one.untestable_reason:
        return title
    lines = [title]
    if look.is_worth(one):
        before, after = number(look.rmse), number(look.predicted_rmse(one))
        if look.share(one) < _LITTLE:
            lines.append("explains a part, but hardly reduces the error by itself")
        else:
            lines.append(f"error {before} → ≈ {after} × floor (−{100.0 * look.share(one):.0f} %)")
        lines += [strength(look, one), confidence(one)]
        same = look.assessment.alike.get(one.name, ()) if look.assessment else ()
        if same:
            lines.append("≈ same as " + ", ".join(in_sentence(effect_title(name)) for name in same))
    return "\n".join(lines)


def strength(look: Look, one: Candidate) -> str:
    """'amplitude 20.4 ± 0.8 mN·m, order 14', as the residual suggests it; of a fault its size."""
    if one.name in BY_NAME:
        return size(one, look.found.actuator)
    first = find(one.name, look.found.actuator.axes).parameters[0]
    value, half = one.settings[first.name], look.uncertainty(one)
    shown = amount(value, first.unit) if half is None else with_uncertainty(value, half, first.unit)
    told = f"{in_sentence(first.title)} {shown}"
    order = one.settings.get("order")
    return told if order is None else f"{told}, order {order:g}"


def confidence(one: Candidate) -> str:
    """How strong the evidence is that something like this is missing: 'strong evidence (Δχ² −405)'."""
    drop = one.predicted_drop
    word = "strong" if drop > 200.0 else "moderate" if drop > 50.0 else "weak"
    return f"{word} evidence (Δχ² −{drop:.0f})"


def style(look: Look | None, shown: Sequence[tuple[str, Candidate | None]], opened: str | None) -> Html:
    """viser's buttons have one line and one colour; these become cards.  shown: (the button's id, its candidate)."""
    rules = []
    for uuid, one in shown:
        if one is None or look is None:
            continue
        button = f'[id="{uuid}"]'
        share = 100.0 * look.share(one) if look.is_worth(one) else 0.0
        bar = f"background-image:linear-gradient(to right,{_BAR} {share:.1f}%,transparent {share:.1f}%)!important;"
        edge = "#f08c00" if one.name == opened else "rgba(134,142,150,.5)" if share else "rgba(134,142,150,.25)"
        grey = "opacity:.55;" if one.untestable_reason else ""
        rules.append(f"{button}{{{_CARD}{bar}{grey}border-left:3px solid {edge}}}")
        rules.append(f"{button} .mantine-Button-inner{{justify-content:flex-start}}")
        rules.append(f"{button} .mantine-Button-label{{{_LABEL}}}{button} .mantine-Button-label::first-line")
        rules.append("{font-weight:600;font-size:13.5px}")
    return unescaped(f"<style>{''.join(rules)}</style>")
