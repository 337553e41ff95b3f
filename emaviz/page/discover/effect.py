"""One candidate opened: its signature beside what is left, its equation, cause, size, and what it is mistaken for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import plotly.graph_objects as go
import viser

from ema_model.actuator import Actuator
from ema_model.discovery import Candidate
from ema_model.discovery.shown.fault_pages import page_of
from ema_model.discovery.shown.fault_pages import typical as typical_fault
from ema_model.discovery.shown.labels import effect_title
from ema_model.discovery.steps.snapshot import Look
from ema_model.effects import Effect, find
from ema_model.effects.effect import FAMILIES
from ema_model.faults import BY_NAME
from ema_model.quantities.numbers import Quantity, number
from ema_model.quantities.titles import in_sentence
from ema_model.text import COLOURS
from emaviz.figures import signature
from emaviz.page.discover import cards
from emaviz.page.page import Page
from emaviz.session.discover.discovering import Discovering
from emaviz.text.html import Html, add_html, html, joined
from emaviz.text.mathml import mathml
from emaviz.text.notes import BOX, boxed

CONFIG = {"displayModeBar": False, "responsive": False}


class EffectView:
    """A folder of the panel on the right, there while a card is open."""

    def __init__(self, page: Page, discovering: Discovering) -> None:
        self._discovering = discovering
        self._name: str | None = None
        self._busy = self._untestable = False
        self._drawn: tuple[Any, str | None] = (None, None)
        gui = page.server.gui
        self._folder = gui.add_folder("Candidate", visible=False)
        with self._folder:
            self._head = add_html(gui)
            self._add = gui.add_button("Add it to the model", icon=viser.Icon.PLUS)
            self._plot: Any = gui.add_plotly(go.Figure(), config=CONFIG, aspect=0.52, visible=False)
            self._text = add_html(gui)
            self._close = gui.add_button("Close", icon=viser.Icon.X, color="gray")

    def connect(self, ask: Callable[[Callable[[], bool], Any], None], close: Callable[[], None]) -> None:
        """ask(begin, button) starts a step; close() closes the card."""
        self._close.on_click(lambda _: close())

        def add(_: Any) -> None:
            name = self._name
            if name is not None:
                ask(lambda: self._discovering.add(name), self._add)

        self._add.on_click(add)

    def busy(self, busy: bool) -> None:
        """Whether a step runs."""
        self._busy = busy
        self._enable()

    def _enable(self) -> None:
        self._add.disabled = self._busy or self._untestable

    def open(self, look: Look | None, name: str | None) -> None:
        """Shows a candidate, or none."""
        one = look.candidate(name) if look is not None and name is not None else None
        self._name = one.name if one is not None else None
        self._folder.visible = one is not None
        if look is None or one is None or self._drawn == (look, one.name):
            return
        self._drawn = (look, one.name)
        self._folder.label = effect_title(one.name)
        self._head.content = head(look, one)
        actuator = look.found.actuator
        is_fault = one.name in BY_NAME
        self._text.content = about_fault(one.name, actuator) if is_fault else about(find(one.name, actuator.axes))
        self._untestable = bool(one.untestable_reason)
        self._enable()
        self._plot.visible = not self._untestable
        if not self._untestable:
            self._plot.figure = signature.figure(look, one)


def head(look: Look, one: Candidate) -> Html:
    """What adding it is expected to do."""
    if one.untestable_reason:
        why = one.untestable_reason[:1].upper() + one.untestable_reason[1:]
        return html('<div {}><span style="color:{}">▲ {}.</span></div>', BOX, COLOURS["warning"], why)
    if not look.is_worth(one):
        return html("<div {}>No evidence for it: adding it would not reduce the error significantly.</div>", BOX)
    lines: list[str] = [
        html(
            "The error would fall from <b>{}</b> to about <b>{} times the floor</b> ({:.0f} % of it).",
            number(look.rmse),
            number(look.predicted_rmse(one)),
            100.0 * look.share(one),
        ),
        f"Suggested: {cards.strength(look, one)} (estimated; adding it fits it).",
    ]
    same = look.assessment.alike.get(one.name, ()) if look.assessment else ()
    if same:
        names = ", ".join(in_sentence(effect_title(name)) for name in same)
        lines.append(
            html('<span style="color:{}">▲ These recordings cannot tell it from {}.</span>', COLOURS["warning"], names)
        )
    return boxed(joined(lines, "<br>"))


def about(effect: Effect, equation: bool = True) -> Html:
    """Equation (unless it stands elsewhere), cause, typical size, where it shows, what it is mistaken for."""
    rows = [
        ("Belongs to", FAMILIES[effect.family]),
        ("Why", effect.explanation),
        ("Typical", typical(effect)),
        ("Shows", effect.shows),
        ("Mistaken for", effect.mistaken_for),
        ("Source", effect.source),
    ]
    return _written(effect.equation if equation else "", rows)


def about_fault(name: str, actuator: Actuator) -> Html:
    """The same of a fault of the actuator."""
    page = page_of(name)
    rows = [
        ("Belongs to", "the actuator itself: a fault, and no missing physics"),
        ("Why", page.explanation),
        ("Typical", typical_fault(name, actuator)),
        ("Shows", page.shows),
        ("Mistaken for", page.mistaken_for),
    ]
    return _written(page.equation, rows)


def _written(equation: str, rows: list[tuple[str, str]]) -> Html:
    table = joined(
        html(
            '<tr><td style="opacity:.65;vertical-align:top;padding-right:8px;white-space:nowrap">{}</td>'
            "<td>{}</td></tr>",
            title,
            text,
        )
        for title, text in rows
        if text
    )
    shown = html('<div style="font-size:17px;padding:4px 0 6px">{}</div>', mathml(equation, "inline"))
    return html("<div {}>{}<table>{}</table></div>", BOX, shown if equation else "", table)


def typical(effect: Effect) -> str:
    """'Amplitude 6, 12, 24 mN·m: low, medium, high.'"""
    first = effect.parameters[0]
    shown = Quantity("", first.unit).scaled(effect.severities)
    values = ", ".join(number(shown.factor * one, 2) for one in effect.severities)
    return f"{first.title} {values} {shown.unit}".rstrip() + ": low, medium, high"
