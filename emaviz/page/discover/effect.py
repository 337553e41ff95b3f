"""One candidate opened: its signature beside what is left, its equation, cause, size, and what it is mistaken for."""

from __future__ import annotations

import html
from collections.abc import Callable
from typing import Any

import plotly.graph_objects as go
import viser

from ema_model.discovery import Candidate
from ema_model.discovery.snapshot import Look
from ema_model.effects import Effect, find
from ema_model.quantities.numbers import Quantity, number
from ema_model.quantities.titles import in_sentence, parameter_title, unit_of
from emaviz.figures import signature
from emaviz.page.discover import cards
from emaviz.page.page import Page
from emaviz.session.discover.discovering import Discovering
from emaviz.text.discovery import effect_title

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
            self._head = gui.add_html("")
            self._add = gui.add_button("Add it to the model", icon=viser.Icon.PLUS)
            self._plot: Any = gui.add_plotly(go.Figure(), config=CONFIG, aspect=0.52, visible=False)
            self._text = gui.add_html("")
            self._close = gui.add_button("Close", icon=viser.Icon.X, color="gray")

    def connect(self, ask: Callable[[Callable[[], bool]], None], close: Callable[[], None]) -> None:
        """ask(begin) starts a step; close() closes the card."""
        self._close.on_click(lambda _: close())

        def add(_: Any) -> None:
            name = self._name
            if name is not None:
                ask(lambda: self._discovering.add(name))

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
        self._text.content = about(find(one.name))
        self._untestable = bool(one.untestable_reason)
        self._enable()
        self._plot.visible = not self._untestable
        if not self._untestable:
            self._plot.figure = signature.figure(look, one)


def head(look: Look, one: Candidate) -> str:
    """What adding it is expected to do."""
    if one.untestable_reason:
        why = one.untestable_reason[:1].upper() + one.untestable_reason[1:]
        return f'<div {cards.BOX}><span style="color:#e8590c">▲ {html.escape(why)}.</span></div>'
    if not look.is_worth(one):
        return f"<div {cards.BOX}>Nothing speaks for it: it would take away no more than chance does.</div>"
    lines = [
        f"The error would fall from <b>{number(look.rmse)}</b> to about "
        f"<b>{number(look.predicted_rmse(one))} times the floor</b> ({100.0 * look.share(one):.0f} % of it).",
        f"Suggested: {html.escape(cards.strength(look, one))}; the refit finds it for good.",
    ]
    same = look.assessment.alike.get(one.name, ()) if look.assessment else ()
    if same:
        names = ", ".join(in_sentence(effect_title(name)) for name in same)
        lines.append(f'<span style="color:#e8590c">▲ These recordings cannot tell it from {html.escape(names)}.</span>')
    return f"<div {cards.BOX}>{'<br>'.join(lines)}</div>"


def about(effect: Effect, equation: bool = True) -> str:
    """Equation (unless it stands elsewhere), cause, typical size, where it shows, what it is mistaken for."""
    rows = [("Why", effect.explanation), ("Typical", typical(effect)), ("Shows", effect.shows)]
    if effect.mistaken_for:
        rows.append(("Mistaken for", effect.mistaken_for))
    rows.append(("Source", effect.source))
    table = "".join(
        f'<tr><td style="opacity:.65;vertical-align:top;padding-right:8px;white-space:nowrap">{title}</td>'
        f"<td>{html.escape(text)}</td></tr>"
        for title, text in rows
    )
    written = f'<div style="font-family:serif;font-size:17px;padding:4px 0 6px">{html.escape(effect.equation)}</div>'
    return f"<div {cards.BOX}>{written if equation else ''}<table>{table}</table></div>"


def typical(effect: Effect) -> str:
    """'Amplitude 6, 12, 24 mN·m: slight, clear, strong.'"""
    first = effect.parameters[0]
    shown = Quantity("", unit_of(first.name)).scaled(effect.severities)
    values = ", ".join(number(shown.factor * one, 2) for one in effect.severities)
    return f"{parameter_title(first.name)} {values} {shown.unit}".rstrip() + ": slight, clear, strong"
