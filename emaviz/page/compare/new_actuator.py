"""A form that makes an actuator's file: its axes, controller and drive, then each parameter with its meaning."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import viser

from ema_model.actuator.describe import DRIVES
from ema_model.actuator.keys import KINDS
from ema_model.quantities.axes import KINDS as AXES
from ema_model.quantities.axes import Axes
from ema_model.text import COLOURS
from emaviz.page.page import Page
from emaviz.page.style import LONG_LABELS
from emaviz.session.compare.comparing import Comparing
from emaviz.session.new_actuator import Description, Question
from emaviz.text.html import Html, HtmlPiece, add_html, html, joined

_BOX = Html('style="padding:0 10px 6px;font-size:12.5px;line-height:1.4"')
_BELOW = Html('style="padding:0 10px 8px;margin-top:-6px;font-size:12px;line-height:1.35;opacity:.75"')


class NewActuator:
    """A folder of the Compare tab.  take(name) chooses the actuator that was made; it runs on the screen's thread."""

    def __init__(self, page: Page, comparing: Comparing, take: Callable[[str], None]) -> None:
        self._page, self._comparing, self._take = page, comparing, take
        self._fields: dict[str, Any] = {}  # by the parameter's path
        self._about: list[HtmlPiece] = []
        gui = page.server.gui
        with gui.add_folder("New actuator", expand_by_default=False):
            self._name = gui.add_text("Name", "New actuator")
            self._motor = gui.add_dropdown("Motor is", AXES, hint="Whether the motor turns or is a linear motor")
            self._user = gui.add_dropdown("User is", AXES, hint="Whether what it moves turns or slides")
            self._controller = gui.add_dropdown("Controller", tuple(DRIVES))
            self._drive = gui.add_dropdown("Drive", tuple(KINDS["inverter"]))
            self._kinds = add_html(gui)
            self._place = gui.add_folder("Parameters")
            self._button = gui.add_button(
                "Make this actuator", icon=viser.Icon.PLUS, hint="Its file goes to the data folder"
            )
            self._told = add_html(gui)
        for control in (self._motor, self._user, self._controller, self._drive):
            control.on_update(lambda event: event.client and page.screen.post("new actuator", self._ask))
        self._button.on_click(lambda _: page.screen.post("make actuator", self._make))
        self._ask()

    def _description(self) -> Description:
        return Description(
            str(self._name.value),
            Axes(str(self._motor.value), str(self._user.value)),
            str(self._controller.value),
            str(self._drive.value),
            {path: str(field.value) for path, field in self._fields.items()},
            self._comparing.sample_rate_Hz,
        )

    def _ask(self) -> None:
        """The kinds in words, and a field for each parameter that such an actuator has; answers stay."""
        said = self._description()
        answers, drives = said.answers, said.drives
        self._drive.visible = bool(drives)
        if drives and tuple(self._drive.options) != drives:
            self._drive.options, self._drive.value = drives, drives[0]
        kinds = {"controller": said.controller} | ({"inverter": str(self._drive.value)} if drives else {})
        meanings = joined(html("<div><b>{}</b>: {}</div>", kind, KINDS[what][kind]) for what, kind in kinds.items())
        self._kinds.content = html("<div {}>{}</div>", _BOX, meanings)
        with self._page.server.atomic():
            for one in (*self._fields.values(), *self._about):
                one.remove()
            gui = self._page.server.gui
            with self._place:
                self._about = [add_html(gui, LONG_LABELS + html("<div {}>{}</div>", _BOX, _HOW))]
                self._fields = {}
                for one in self._description().questions:
                    label = f"{one.title} [{one.unit}]" if one.unit else one.title
                    self._fields[one.path] = gui.add_text(label, answers.get(one.path, ""))
                    self._about.append(add_html(gui, _about(one)))

    def _make(self) -> None:
        self._page.checked(self._save, self._button)

    def _save(self) -> None:
        name, doubts = self._description().save(self._comparing.folder)
        self._take(name)
        lines = joined(html('<div style="color:{}">▲ {}</div>', COLOURS["warning"], line) for line in doubts)
        self._told.content = html("<div {}><b>{}</b> is made, and chosen above.{}</div>", _BOX, name, lines)


_HOW = html(
    "A number, or one with its tolerance, 1 σ: <code>1e-4 ± 5%</code>, <code>0 ± 0.02</code>; <code>3.5 fixed</code> "
    "is not calibrated. What is left empty is guessed. The model's step and the filter of a measured motion fit the "
    "loop, and the sampling of the measurements that are open."
)


def _about(one: Question) -> Html:
    other = f", also {one.other}" if one.other else ""
    usual = html(" Usual tolerance: {}.", one.tolerance) if one.tolerance else ""
    return html("<div {}>{}{}. Left empty: {}.{}</div>", _BELOW, one.meaning, other, one.empty, usual)
