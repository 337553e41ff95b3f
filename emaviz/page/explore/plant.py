"""What the plant has and the monitor does not know: sensor noise, the state at the start, hidden effects."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import viser

from ema_model.effects import CATALOGUE, find
from ema_model.quantities.shown import of_signal
from ema_model.quantities.sides import USER
from emaviz.page.page import Page
from emaviz.session.described import limits
from emaviz.session.settings import Settings
from emaviz.text.html import Html, add_html, html, said

_NONE = "–"


class PlantControls:
    """Folders of the Explore tab, closed at first."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._reads: list[tuple[Any, Callable[[], Any]]] = []  # controls, and what the session holds for them
        gui, settings, axes = page.server.gui, page.session.settings, page.session.actuator.axes
        of = partial(limits, Settings)
        away = "Distance" if axes.is_linear(USER) else "Angle"
        with gui.add_folder("Sensor noise", expand_by_default=False):
            self._listen(
                gui.add_number("Current noise [A]", 0.0, min=0.0, max=50.0, step=0.05, hint="White, rms"),
                partial(settings.set, "current_noise_A"),
                lambda: settings.current_noise_A,
            )
            self._listen(
                gui.add_number("Encoder [bit per turn]", 0, **of("encoder_bits"), step=1, hint="0: a perfect encoder"),
                partial(settings.set, "encoder_bits"),
                lambda: settings.encoder_bits,
            )
        with gui.add_folder("State at the start", expand_by_default=False):
            self._listen(
                gui.add_number(
                    f"{away} off the command [m{axes.unit('rad', USER)}]", 0.0, min=-500.0, max=500.0, step=1.0
                ),
                lambda value: settings.set("start_offset_rad", 1e-3 * float(value)),
                lambda: 1e3 * settings.start_offset_rad,
            )
            hint = "Of the plant; the monitor starts at rest.  An identification starts at rest, too."
            self._listen(
                gui.add_number(
                    of_signal("motor_speed_rad_s", axes).label, 0.0, **of("start_speed_rad_s"), step=10.0, hint=hint
                ),
                partial(settings.set, "start_speed_rad_s"),
                lambda: settings.start_speed_rad_s,
            )
            self._listen(
                gui.add_slider("Position in the backlash", -1.0, 1.0, 0.1, 0.0, hint="−1 and 1: at one of its walls"),
                partial(settings.set, "start_side"),
                lambda: settings.start_side,
            )
        self._folder = gui.add_folder("Hidden effects", expand_by_default=False)
        with self._folder:
            add_html(
                gui,
                Html(
                    '<div style="font-size:12px;opacity:.75;padding:0 10px">They act in the plant only, so the monitor '
                    "fails where they matter. The first use of each combination is compiled, which takes seconds.</div>"
                ),
            )
            self._titles = {effect.title: name for name, effect in CATALOGUE.items()}
            self._choice = gui.add_dropdown("Effect", (_NONE, *self._titles), initial_value=_NONE)
            self._about = add_html(gui, visible=False)
            self._add = gui.add_button("Hide it in the plant", icon=viser.Icon.PLUS, color="gray", disabled=True)
        self._shown: dict[str, Any] = {}
        self._choice.on_update(lambda event: event.client and page.screen.post("effect", self._chosen))
        self._add.on_click(lambda _: page.screen.post("hide", self._hide))

    def _chosen(self) -> None:
        name = self._titles.get(str(self._choice.value))
        self._add.disabled = name is None
        self._about.visible = name is not None
        if name is not None:
            effect = CATALOGUE[name]
            self._about.content = said(html("{}<br><i>Shows:</i> {}", effect.explanation, effect.shows))

    def _hide(self) -> None:
        name = self._titles.get(str(self._choice.value))
        if name is None or name in self._shown:
            return
        if self._change(lambda: self._page.session.settings.set_effect(name, *self._clear(name))):
            self._show(name)
            self._choice.value = _NONE
            self._chosen()

    def _clear(self, name: str) -> tuple[str, float]:
        """The first parameter at its clear severity."""
        effect = find(name, self._page.session.actuator.axes)
        return effect.parameters[0].name, effect.severities[1]

    def _show(self, name: str) -> None:
        """The parameters of an effect that is in the plant now."""
        gui, session = self._page.server.gui, self._page.session
        effect = find(name, session.actuator.axes)
        with self._folder:
            folder = gui.add_folder(effect.title)
        self._shown[name] = folder
        with folder:
            for parameter in effect.parameters:
                value = session.settings.effects[name][parameter.name]
                span = parameter.high - parameter.low
                entry = gui.add_number(
                    parameter.label,
                    int(value) if parameter.integer else value,
                    min=parameter.low,
                    max=parameter.high,
                    step=1 if parameter.integer else float(f"{span / 500.0:.0e}"),
                    hint=f"{parameter.meaning}, {parameter.low:g} … {parameter.high:g}",
                )

                def setter(value: Any, parameter: str = parameter.name) -> None:
                    if name in session.settings.effects:
                        session.settings.set_effect(name, parameter, value)

                self._listen(entry, setter)
            remove = gui.add_button("Remove the effect", icon=viser.Icon.X, color="gray")
        remove.on_click(lambda _: self._page.screen.post(f"take out {name}", lambda: self._remove(name)))

    def _remove(self, name: str) -> None:
        folder = self._shown.pop(name, None)
        if folder is not None:
            folder.remove()
            self._change(lambda: self._page.session.settings.remove_effect(name))

    def show_settings(self) -> None:
        """Sets every control to what the session holds; on the screen's thread."""
        for entry, read in self._reads:
            entry.value = str(read()) if isinstance(entry.value, str) else read()
        for folder in self._shown.values():
            folder.remove()
        self._shown.clear()
        for name in self._page.session.settings.effects:
            self._show(name)

    def _listen(self, entry: Any, setter: Callable[[Any], None], read: Callable[[], Any] | None = None) -> None:
        if read is not None:
            self._reads.append((entry, read))
        entry.on_update(lambda event: event.client and self._change(lambda: setter(entry.value), entry))

    def _change(self, change: Callable[[], Any], control: Any = None) -> bool:
        good = self._page.checked(change, control)
        if good:
            self._page.session.refresh()
        return good
