"""Your own effect: an expression checked as it is typed, its parameters, and the curve of what is left."""

from __future__ import annotations

import html
from collections.abc import Callable
from typing import Any

import viser

from ema_model.errors import InputError
from ema_model.user_effects import Expression, parse, user_torque
from ema_model.user_effects.expression import FUNCTIONS, VARIABLES
from emaviz.discovering import Discovering
from emaviz.discovery_look import Look
from emaviz.panels import discover_cards as cards
from emaviz.panels.page import Page
from emaviz.state import number

_EXAMPLE = "-c*sign(omega)*sqrt(abs(omega))"
_START = 1e-3  # N·m and the like: a torque at the motor is some thousandths


class OwnEffect:
    """A folder of the Discover tab."""

    def __init__(self, page: Page, discovering: Discovering) -> None:
        self._page, self._discovering = page, discovering
        self._expression: Expression | None = None
        self._fields: dict[str, Any] = {}
        self._running = False
        self._look: Look | None = None
        gui = page.server.gui
        self._folder = gui.add_folder("Your own effect", visible=False, expand_by_default=False)
        with self._folder:
            gui.add_html(_help())
            self._text = gui.add_text("T [N·m] =", "", hint=f"For example {_EXAMPLE}")
            self._checked = gui.add_html("")
            self._parameters = gui.add_folder("Its parameters start at", visible=False)
            self._add = gui.add_button("Fit it in the model", icon=viser.Icon.PLUS, disabled=True)
            self._curve = gui.add_button(
                "From the curve",
                icon=viser.Icon.CHART_LINE,
                color="gray",
                disabled=True,
                hint="What is left, as a table of torque over the variable that explains it best",
            )
        self._text.on_update(lambda event: event.client and page.screen.post("own effect", self._check))

    def connect(self, ask: Callable[[Callable[[], bool]], None]) -> None:
        """ask(begin) starts a step."""
        self._add.on_click(lambda _: ask(self._begin))
        self._curve.on_click(lambda _: ask(self._discovering.add_curve))

    def busy(self, busy: bool) -> None:
        """Whether a step runs."""
        self._running = busy
        self._enable()

    def show(self, look: Look | None) -> None:
        """A story as it stands."""
        self._look = look
        self._folder.visible = look is not None
        self._enable()

    def _enable(self) -> None:
        left = self._look.assessment.left.explanation if self._look and self._look.assessment else None
        self._add.disabled = self._running or self._expression is None
        self._curve.disabled = self._running or left is None

    def _check(self) -> None:
        """Reads the text as it stands; on the screen's thread."""
        text = str(self._text.value)
        self._expression, line, colour = None, "", "inherit"
        if text.strip():
            try:
                self._expression = parse(text)
                used = ", ".join(self._expression.variables) or "no variable"
                free = ", ".join(self._expression.parameters) or "none"
                line, colour = f"✓ uses {used}; parameters to fit: {free}", "#2b8a3e"
            except InputError as error:
                line, colour = f"✗ {error}", "#e03131"
        self._checked.content = f'<div {cards.BOX}><span style="color:{colour}">{html.escape(line)}</span></div>'
        self._list(self._expression.parameters if self._expression else ())
        self._enable()

    def _list(self, names: tuple[str, ...]) -> None:
        """A field for each parameter; those that stay keep their values."""
        if tuple(self._fields) == names:
            return
        values = {name: entry.value for name, entry in self._fields.items()}
        for entry in self._fields.values():
            entry.remove()
        self._parameters.visible = bool(names)
        with self._parameters:
            self._fields = {
                name: self._page.server.gui.add_number(
                    name, values.get(name, _START), step=1e-4, hint="Where the fit starts; it finds the value"
                )
                for name in names
            }

    def _begin(self) -> bool:
        if self._expression is None:
            raise InputError("there is no expression that can be used yet; write one, for example " + _EXAMPLE)
        start = {name: number(entry.value, name) for name, entry in self._fields.items()}
        return self._discovering.add_own(user_torque(self._expression.text), start)


def _help() -> str:
    rows = "".join(f"<div><code>{name}</code> {html.escape(meaning)}</div>" for name, meaning in VARIABLES.items())
    functions = ", ".join(FUNCTIONS)
    return (
        f"<div {cards.BOX}>A torque at the motor's shaft, in N·m; positive drives it on. Every other name is a "
        f'parameter, and is fitted.<details><summary style="cursor:pointer">What can be used</summary>{rows}'
        f"<div><code>pi</code>, + − * / ** and {functions}</div></details></div>"
    )
