"""Your own effect: an expression checked as it is typed, a slider for each parameter, and the curve of what is left."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import plotly.graph_objects as go
import viser

from ema_model.discovery.steps.snapshot import Look
from ema_model.effects.user import UserEffect, user_torque
from ema_model.effects.user.expression import FUNCTIONS, VARIABLES
from ema_model.errors import InputError
from ema_model.quantities.numbers import number as shown
from ema_model.text import COLOURS
from emaviz.figures import signature
from emaviz.page.discover.sliders import ParameterSliders
from emaviz.page.page import Page
from emaviz.session.discover.discovering import Discovering
from emaviz.session.discover.own_effect import Preview, Typed, typed
from emaviz.text.html import Html, add_html, html, joined
from emaviz.text.notes import BOX, note

_EXAMPLE = "-c*sign(omega)*sqrt(abs(omega))"
_TYPED_S = 0.7  # after the last key, from which a text is taken for whole: its torque is compiled then
_CONFIG = {"displayModeBar": False, "responsive": False}


class OwnEffect:
    """A folder of the Discover tab."""

    def __init__(self, page: Page, discovering: Discovering) -> None:
        self._page, self._discovering = page, discovering
        self._typed = Typed(None, "")
        self._running = False
        self._look: Look | None = None
        self._timer: threading.Timer | None = None
        gui = page.server.gui
        self._folder = gui.add_folder("Your own effect", visible=False, expand_by_default=False)
        with self._folder:
            add_html(gui, _help())
            self._text = gui.add_text("T [N·m] =", "", hint=f"For example {_EXAMPLE}")
            self._checked = add_html(gui)
            self._sliders = ParameterSliders(page, self._preview)
            self._said = add_html(gui)
            self._plot: Any = gui.add_plotly(go.Figure(), config=_CONFIG, aspect=0.7, visible=False)
            self._add = gui.add_button("Fit it in the model", icon=viser.Icon.PLUS, disabled=True)
            self._curve = gui.add_button(
                "From the curve",
                icon=viser.Icon.CHART_LINE,
                color="gray",
                disabled=True,
                hint="What is left, as a table of torque over the variable that explains it best",
            )
        self._text.on_update(lambda event: event.client and page.screen.post("own effect", self._check))
        events = discovering.events
        events.previewed.connect(lambda found: page.screen.post("own preview", lambda: self._draw(found)))
        events.unpreviewed.connect(lambda why: page.screen.post("own preview", lambda: self._hide(why)))

    def connect(self, ask: Callable[[Callable[[], bool], Any], None]) -> None:
        """ask(begin, button) starts a step."""
        self._add.on_click(lambda _: ask(self._begin, self._add))
        self._curve.on_click(lambda _: ask(self._discovering.add_curve, self._curve))

    def busy(self, busy: bool) -> None:
        """Whether a step runs."""
        self._running = busy
        self._enable()

    def show(self, look: Look | None) -> None:
        """A story as it stands."""
        changed = look is None or self._look is None or look.steps != self._look.steps or self._look.assessment is None
        self._look = look
        self._folder.visible = look is not None
        self._enable()
        if changed:
            self._hide("")
            if look is not None and look.assessment is not None and not self._is_in(look):
                self._preview()

    def _is_in(self, look: Look) -> bool:
        found = self._typed.expression
        return found is not None and any(one.key == user_torque(found.text).name for one in look.added)

    def _enable(self) -> None:
        left = self._look.assessment.left.explanation if self._look and self._look.assessment else None
        self._add.disabled = self._running or self._typed.expression is None
        self._curve.disabled = self._running or left is None

    def _check(self) -> None:
        """Reads the text as it stands; on the screen's thread."""
        self._typed = typed(str(self._text.value))
        colour = COLOURS["good" if self._typed.expression else "bad"]
        self._checked.content = html('<div {}><span style="color:{}">{}</span></div>', BOX, colour, self._typed.line)
        self._sliders.list(self._typed.expression.parameters if self._typed.expression else ())
        self._hide("")
        self._enable()
        if self._timer is not None:
            self._timer.cancel()
        if self._typed.expression is not None:
            self._timer = threading.Timer(_TYPED_S, lambda: self._page.screen.post("own effect typed", self._preview))
            self._timer.daemon = True
            self._timer.start()

    def _effect(self) -> UserEffect:
        if self._typed.expression is None:
            raise InputError("there is no expression that can be used yet; write one, for example " + _EXAMPLE)
        return user_torque(self._typed.expression.text, self._sliders.ranges)

    # --- what it would change ---------------------------------------------------------------------------------------

    def _preview(self) -> None:
        """Asks for what the torque would change with the sliders' values."""
        if self._typed.expression is None or self._look is None or self._is_in(self._look):
            return
        if not self._plot.visible:
            self._said.content = note("Simulating; a new expression is compiled first, for some seconds …")
        try:
            self._discovering.preview_own(self._effect(), self._sliders.values)
        except InputError as error:
            self._hide(str(error))

    def _draw(self, found: Preview) -> None:
        if self._look is None or found.look.steps != self._look.steps or self._typed.expression is None:
            return
        if found.candidate.name != self._effect().name:
            return  # of a text that was typed before
        with self._page.server.atomic():
            self._plot.figure = signature.figure(found.look, found.candidate)
            self._plot.visible = True
            change = f"{shown(found.look.rmse)} → ≈ {shown(found.rmse)} × floor"
            self._said.content = html("<div {}>With these values, before any fit: error {}.</div>", BOX, change)

    def _hide(self, why: str) -> None:
        self._plot.visible = False
        self._said.content = (
            html('<div {}><span style="color:{}">{}</span></div>', BOX, COLOURS["warning"], why) if why else ""
        )

    def _begin(self) -> bool:
        return self._discovering.add_own(self._effect(), self._sliders.values)


def _help() -> Html:
    rows = joined(html("<div><code>{}</code> {}</div>", name, meaning) for name, meaning in VARIABLES.items())
    functions = ", ".join(FUNCTIONS)
    return html(
        "<div {}>A torque at the motor's shaft, in N·m; positive drives it on. Every other name is a "
        'parameter, and is fitted.<details><summary style="cursor:pointer">What can be used</summary>{}'
        "<div><code>pi</code>, + − * / ** and {}</div></details></div>",
        BOX,
        rows,
        functions,
    )
