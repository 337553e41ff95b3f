"""The Explore tab: break the actuator with sliders and see both models answer."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import partial
from typing import Any

import numpy as np
import viser

from ema_model.actuator import Actuator
from ema_model.actuator.readings import sentences
from ema_model.commands import COMMANDS
from ema_model.faults import FAULTS, HEALTHY
from ema_model.quantities.sides import USER
from ema_model.quantities.titles import labelled
from emaviz.page.explore.first_visit import StartHere
from emaviz.page.explore.load import LoadControls
from emaviz.page.explore.plant import PlantControls
from emaviz.page.explore.presets import CUSTOM, PRESETS, name_of
from emaviz.page.page import Page
from emaviz.page.style import LONG_LABELS
from emaviz.session.described import limits
from emaviz.session.session import Simulation
from emaviz.session.settings import MONITORS, Settings
from emaviz.session.undo import Undo
from emaviz.text.html import add_html, html, said

_DECIMALS = 6  # that a command's settings may have


class ExplorePanel:
    """Presets and sliders of the faults, the command and its settings, the load, and what the plant hides."""

    def __init__(self, page: Page, fan: Callable[[int], None]) -> None:
        """fan(fault): shows five severities of it."""
        self._page = page
        session = page.session
        self._undo = Undo(session.settings, lambda: session.plant, session.choose_plant)
        self._touched = 0  # the fault that was moved last
        self._reads: list[tuple[Any, Callable[[], Any]]] = []  # controls, and what the session holds for them
        gui = page.server.gui
        self.status = add_html(gui, said("Starting…"))
        self._note = add_html(gui)
        self._model = add_html(gui)
        self.start = StartHere(page)
        with gui.add_folder("Faults of the plant"):
            add_html(gui, LONG_LABELS)
            known = name_of(page.session.settings.k)
            self._preset = gui.add_dropdown("Preset", (*PRESETS, CUSTOM), initial_value=known)
            self._sliders = [self._fault(i) for i in range(len(FAULTS))]
            reset = gui.add_button("Reset to healthy", icon=viser.Icon.HEART)
            self._back: Any = gui.add_button(
                "Undo", icon=viser.Icon.ARROW_BACK_UP, color="gray", disabled=True, hint="The last change here; Ctrl+Z"
            )
            fanned = gui.add_button(
                "Fan of severities",
                icon=viser.Icon.CHART_AREA_LINE,
                color="gray",
                hint="Five severities of the fault that was moved last, beside each other",
            )
        reset.on_click(lambda _: page.screen.post("preset", lambda: self._move_all(HEALTHY)))
        self._back.on_click(lambda _: page.screen.post("undo", self.undo))
        fanned.on_click(lambda _: page.screen.post("fan asked", lambda: fan(self._touched)))
        with gui.add_folder("Command"):
            self._command = gui.add_dropdown(
                "Command", [cls.title for cls in COMMANDS.values()], initial_value=COMMANDS["chirp"].title
            )
            self._groups = {name: self._command_settings(name) for name in COMMANDS}
            self._show_group()
            duration = gui.add_number("Duration [s]", 0.5, **limits(Settings, "duration_s"), step=0.01)
        with gui.add_folder("Load"):
            self._load = LoadControls(page, self._listen)
        self._plant = PlantControls(page)
        self._own = gui.add_dropdown(
            "Plant's model", tuple(page.session.plants), visible=False, hint="What Discover has improved may play it"
        )
        with gui.add_folder("Monitor model"):
            self.monitor = gui.add_dropdown(
                "Its faults", MONITORS, initial_value="healthy", hint="The faults that the monitor model has here"
            )
        settings = page.session.settings
        self._preset.on_update(lambda event: event.client and page.screen.post("preset", self._take_preset))
        self._command.on_update(lambda event: event.client and self._choose_command())
        self._listen(duration, partial(settings.set, "duration_s"), lambda: settings.duration_s)
        # Set by the session as well, after which nothing is to be simulated again.
        self.monitor.on_update(lambda event: event.client and self._take_monitor())
        self._own.on_update(lambda event: event.client and page.screen.post("plant's model", self._take_plant))
        page.session.events.plants.connect(lambda: page.screen.post("plants", self._plant_taken))

    def _take_monitor(self) -> None:
        self._change(lambda: self._page.session.settings.set("monitor", self.monitor.value))

    def note(self, text: str) -> None:
        """What is to be read once, and stays: below the status."""
        self._note.content = said(text) if text else ""

    def show_model(self, simulation: Simulation) -> None:
        """Says which model is drawn beside which plant; on the screen's thread."""
        plant = html(" · plant: <b>{}</b>", simulation.plant) if simulation.plant else ""
        line = said(html("Monitor model: <b>{}</b>{}", simulation.model, plant))
        if self._model.content != line:
            self._model.content = line

    def _take_plant(self) -> None:
        session = self._page.session
        if not self._page.checked(lambda: self._change_plant(lambda: session.choose_plant(self._own.value)), self._own):
            self._own.value = session.plant

    def take_plant(self, name: str, actuator: Actuator) -> None:
        """An improved model plays the plant, on the screen's thread; InputError where Explore cannot simulate it."""
        self._change_plant(lambda: self._page.session.take_plant(name, actuator))

    def _change_plant(self, change: Callable[[], None]) -> None:
        """With what it does to the sliders said, and a step back."""
        settings = self._page.session.settings
        before = settings.k.copy()
        self._keep(None)
        change()
        if not np.array_equal(before, settings.k):
            text = (
                "They are now the faults that this model has; Undo brings back the model and the sliders from before."
            )
            self._page.notify("The sliders of Explore have moved", text, "yellow")

    def _plant_taken(self) -> None:
        session = self._page.session
        self._own.options, self._own.value = tuple(session.plants), session.plant
        self._own.visible = len(session.plants) > 1
        self.set_faults(session.settings.k)

    def _take_preset(self) -> None:
        k = PRESETS.get(str(self._preset.value))
        if k is not None:
            self._move_all(k)

    def _move_all(self, k: Any) -> None:
        moved = np.flatnonzero(np.asarray(k) != HEALTHY)
        self._touched = int(moved[0]) if len(moved) else self._touched
        self._keep(None)
        self.set_faults(k)

    def undo(self) -> None:
        """Takes the last change of a control back; on the screen's thread."""
        if self._undo.back():
            self.show_settings()
        self._back.disabled = not self._undo

    def _keep(self, control: Any) -> None:
        self._undo.keep(control)
        if self._back.disabled:
            self._back.disabled = False

    def show_preset(self) -> None:
        """Names the preset that the sliders make; on the screen's thread."""
        name = name_of(self._page.session.settings.k)
        if self._preset.value != name:
            self._preset.value = name

    def set_faults(self, k: Any) -> None:
        """Moves every slider, and simulates once."""
        settings = self._page.session.settings
        for i, value in enumerate(k):
            settings.set_fault(i, value)
        with self._page.server.atomic():
            for i, slider in enumerate(self._sliders):
                slider.value = float(k[i])
                slider.label = self._label(i)
        self._page.session.refresh()

    def take(
        self,
        *,
        command: str | None = None,
        settings: Mapping[str, Any] | None = None,
        duration_s: float | None = None,
        load_torque_Nm: float | None = None,
    ) -> None:
        """Sets what is given as if a person had, and simulates once; on the screen's thread.

        settings: of the command (the present one without it).  InputError, and nothing is changed, for a value that
        makes no sense.
        """
        tried = copy.deepcopy(self._page.session.settings)
        given = {"command": command, "duration_s": duration_s, "load_torque_Nm": load_torque_Nm}
        for name, value in given.items():
            if value is not None:
                tried.set(name, value)
        for name, value in (settings or {}).items():
            tried.set_command_setting(tried.command, name, value)
        self._keep(None)
        self._page.session.settings.restore(tried.saved())
        self.show_settings()

    def show_settings(self) -> None:
        """Sets every control to what the session holds, and simulates; on the screen's thread."""
        settings = self._page.session.settings
        with self._page.server.atomic():
            self._command.value = COMMANDS[settings.command].title
            self._show_group()
            self._load.show()
            for entry, read in self._reads:
                entry.value = _written(read()) if isinstance(entry.value, str) else read()
        self._plant.show_settings()
        self.show_monitor(settings.monitor)
        self.set_faults(settings.k)

    def show_monitor(self, monitor: str) -> None:
        """Sets the dropdown to what the session has chosen."""
        self.monitor.value = next(name for name in MONITORS if name == monitor)

    def _fault(self, index: int) -> Any:
        fault, value = FAULTS[index], float(self._page.session.settings.k[index])
        slider = self._page.server.gui.add_slider(
            self._label(index), 0.0, 1.0, 0.005, value, hint=f"{fault.name}: {fault.title}, 0 … 1"
        )
        slider.on_update(lambda event: event.client and self._slide(index))
        return slider

    def _label(self, index: int) -> str:
        settings = self._page.session.settings
        return f"{FAULTS[index].name} {sentences(settings.k, self._page.session.actuator)[index]}"

    def _slide(self, index: int) -> None:
        slider = self._sliders[index]
        settings = self._page.session.settings
        self._touched = index
        if self._change(lambda: settings.set_fault(index, slider.value), slider):
            label = self._label(index)
            if slider.label != label:
                slider.label = label

    def _command_settings(self, name: str) -> list[Any]:
        inputs = []
        for f in fields(COMMANDS[name]):
            default: Any = self._command_setting(name, f.name, f.default)
            label = labelled(self._page.session.actuator.axes.name(f.name, USER))
            if isinstance(default, tuple):
                entry = self._page.server.gui.add_text(label, "+".join(f"{value:g}" for value in default))
            else:
                entry = self._page.server.gui.add_number(label, float(default), step=_step(float(default)))
                entry.precision = _DECIMALS  # the step's own would show 0.448 Hz as 0
            setter = partial(self._page.session.settings.set_command_setting, name, f.name)
            self._listen(entry, setter, partial(self._command_setting, name, f.name, f.default))
            inputs.append(entry)
        return inputs

    def _command_setting(self, name: str, setting: str, usual: Any) -> Any:
        return self._page.session.settings.command_settings[name].get(setting, usual)

    def _listen(self, entry: Any, setter: Callable[[Any], None], read: Callable[[], Any]) -> None:
        """A control's new value goes through its setter, then both models run; read() is what the session holds."""
        self._reads.append((entry, read))

        def changed(event: Any) -> None:
            if event.client is not None:
                self._change(lambda: setter(entry.value), entry)

        entry.on_update(changed)

    def _choose_command(self) -> None:
        name = next((n for n, cls in COMMANDS.items() if cls.title == self._command.value), None)
        if self._change(lambda: self._page.session.settings.set("command", name), self._command):
            self._show_group()

    def _show_group(self) -> None:
        chosen = self._page.session.settings.command
        for name, inputs in self._groups.items():
            for entry in inputs:
                entry.visible = name == chosen

    def _change(self, change: Callable[[], Any], control: Any = None) -> bool:
        self._keep(control)
        good = self._page.checked(change, control)
        if good:
            self._page.session.refresh()
        return good


def _written(value: Any) -> str:
    """As it is typed: the numbers of a list are joined by plus signs."""
    return "+".join(f"{one:g}" for one in value) if isinstance(value, (list, tuple)) else str(value)


def _step(default: float) -> float:
    return 0.1 if default == 0.0 else 10.0 ** int(f"{abs(default):e}".split("e")[1]) / 10.0
