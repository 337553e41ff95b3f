"""The Explore tab: break the actuator with sliders and see both models answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import partial
from typing import Any

import viser

from ema_model.commands import COMMANDS
from ema_model.faults import FAULTS, HEALTHY, sentences
from emaviz.panels.page import Page
from emaviz.state import MONITORS


class ExplorePanel:
    """Sliders of the faults, the command and its settings, the load."""

    def __init__(self, page: Page) -> None:
        self._page = page
        gui = page.server.gui
        self.status = gui.add_markdown("Starting…")
        with gui.add_folder("Faults"):
            self._sliders = [self._fault(i) for i in range(len(FAULTS))]
            reset = gui.add_button("Reset to healthy", icon=viser.Icon.HEART)
            reset.on_click(lambda _: self.set_faults(HEALTHY))
        with gui.add_folder("Command"):
            self._command = gui.add_dropdown(
                "Command", [cls.title for cls in COMMANDS.values()], initial_value=COMMANDS["chirp"].title
            )
            self._groups = {name: self._command_settings(name) for name in COMMANDS}
            self._show_group()
            duration = gui.add_number("Duration [s]", 0.5, min=0.01, max=5.0, step=0.01)
            load = gui.add_number("Load torque [N·m]", 0.0, min=-1000.0, max=1000.0, step=1.0)
        with gui.add_folder("Monitor model"):
            self.monitor = gui.add_dropdown("Faults of the monitor", MONITORS, initial_value="healthy")
        settings = page.session.settings
        self._command.on_update(lambda _: self._choose_command())
        for entry, setter in (
            (duration, settings.set_duration),
            (load, settings.set_load),
            (self.monitor, settings.set_monitor),
        ):
            self._listen(entry, setter)

    def set_faults(self, k: Any) -> None:
        """Moves every slider, and simulates once."""
        for i, slider in enumerate(self._sliders):
            slider.value = float(k[i])
        self._page.session.refresh()

    def show_monitor(self, monitor: str) -> None:
        """Sets the dropdown to what the session has chosen."""
        self.monitor.value = next(name for name in MONITORS if name == monitor)

    def _fault(self, index: int) -> Any:
        fault = FAULTS[index]
        slider = self._page.server.gui.add_slider(
            self._label(index), 0.0, 1.0, 0.005, fault.healthy, hint=f"{fault.name}: {fault.title}, 0 … 1"
        )
        slider.on_update(lambda _: self._slide(index))
        return slider

    def _label(self, index: int) -> str:
        settings = self._page.session.settings
        return f"{FAULTS[index].name} {sentences(settings.k, self._page.session.actuator)[index]}"

    def _slide(self, index: int) -> None:
        slider = self._sliders[index]
        settings = self._page.session.settings
        if self._change(lambda: settings.set_fault(index, slider.value)):
            label = self._label(index)
            if slider.label != label:
                slider.label = label

    def _command_settings(self, name: str) -> list[Any]:
        inputs = []
        for f in fields(COMMANDS[name]):
            default: Any = f.default
            label = _label(f.name)
            if isinstance(default, tuple):
                entry = self._page.server.gui.add_text(label, "+".join(f"{value:g}" for value in default))
            else:
                entry = self._page.server.gui.add_number(label, float(default), step=_step(float(default)))
            self._listen(entry, partial(self._page.session.settings.set_command_setting, name, f.name))
            inputs.append(entry)
        return inputs

    def _listen(self, entry: Any, setter: Callable[[Any], None]) -> None:
        """A control's new value goes through its setter, then both models run."""

        def changed(_: Any) -> None:
            self._change(lambda: setter(entry.value))

        entry.on_update(changed)

    def _choose_command(self) -> None:
        name = next((n for n, cls in COMMANDS.items() if cls.title == self._command.value), None)
        if self._change(lambda: self._page.session.settings.set_command(name)):
            self._show_group()

    def _show_group(self) -> None:
        chosen = self._page.session.settings.command
        for name, inputs in self._groups.items():
            for entry in inputs:
                entry.visible = name == chosen

    def _change(self, change: Callable[[], Any]) -> bool:
        good = self._page.checked(change)
        if good:
            self._page.session.refresh()
        return good


def _label(setting: str) -> str:
    """`amplitude_rad` as "Amplitude [rad]"."""
    for unit, shown in (("_rad_s", "rad/s"), ("_rad", "rad"), ("_Hz", "Hz"), ("_s", "s")):
        if setting.endswith(unit):
            return f"{setting.removesuffix(unit).replace('_', ' ').capitalize()} [{shown}]"
    return setting.replace("_", " ").capitalize()


def _step(default: float) -> float:
    return 0.1 if default == 0.0 else 10.0 ** int(f"{abs(default):e}".split("e")[1]) / 10.0
