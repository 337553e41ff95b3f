"""What a comparison is asked for: the actuator, what may be calibrated, the signals' weights, the window."""

from __future__ import annotations

from typing import Any

import viser

from ema_model.actuator.naming import on_axes
from ema_model.recordings import SIGNALS
from emaviz.page.compare.new_actuator import NewActuator
from emaviz.page.page import Page
from emaviz.server.uploads import Uploads
from emaviz.session.compare.comparing import COMPARABLE, Comparing
from emaviz.session.data_folder import ACTUATOR_SUFFIX


class AskedControls:
    """Folders of the Compare tab."""

    def __init__(self, page: Page, comparing: Comparing, uploads: Uploads) -> None:
        self._page, self._comparing = page, comparing
        gui = page.server.gui
        with gui.add_folder("Weights and window"):
            self._signals = {name: self._signal(name) for name in COMPARABLE}
            self._windowed = gui.add_checkbox("Only a window of time", False)
            self._from = gui.add_number("From [s]", 0.0, step=0.01, visible=False)
            self._to = gui.add_number("To [s]", 1.0, step=0.01, visible=False)
        with gui.add_folder("Model"):
            self._actuator = gui.add_dropdown(
                "Actuator", comparing.actuators(), initial_value=comparing.session.actuator.name
            )
            uploads.add_button("Upload an actuator file", ACTUATOR_SUFFIX, icon=viser.Icon.UPLOAD, color="gray")
            NewActuator(page, comparing, self.choose)
            self._calibrate = gui.add_checkbox("Calibrate it first", comparing.calibrate)
            self._free_folder = gui.add_folder("What the calibration may move", expand_by_default=False)
        self._free: list[Any] = []
        self._list_free()
        self._actuator.on_update(lambda event: event.client and self._chosen())
        self._calibrate.on_update(lambda _: self._set_calibrate())
        for control in (self._windowed, self._from, self._to):
            control.on_update(lambda event: event.client and self._set_window())

    def choose(self, name: str) -> None:
        """Takes an actuator, just uploaded; on the screen's thread."""
        if self._page.checked(lambda: self._comparing.choose_actuator(name), self._actuator):
            self.show_actuator()

    def show_actuator(self) -> None:
        """The controls as the session's part has it; on the screen's thread."""
        self._actuator.options = self._comparing.actuators()
        self._actuator.value = self._comparing.actuator_name
        self._list_free()

    def show_settings(self) -> None:
        """All controls as the session's part has them; on the screen's thread."""
        comparing = self._comparing
        window = comparing.window_s  # kept, since the controls' own callbacks may set it
        self._calibrate.value = comparing.calibrate
        for name, box in self._signals.items():
            box.value = comparing.weights.get(name, 0.0)
        self._windowed.value = window is not None
        self._from.visible = self._to.visible = window is not None
        if window is not None:
            self._from.value, self._to.value = window
        self.show_actuator()

    def show_signals(self) -> None:
        """Only the signals that every recording has can be chosen."""
        known = self._comparing.signals_available()
        for name, box in self._signals.items():
            box.disabled = name not in known
        if self._comparing.actuator_name != self._actuator.value:
            self.show_actuator()

    def _signal(self, name: str) -> Any:
        weight = self._comparing.weights.get(name, 0.0)
        hint = "Weight in the calibration: 1 is what its noise says, 0 leaves it out"
        box = self._page.server.gui.add_number(SIGNALS[name].title, weight, min=0.0, step=0.1, hint=hint, disabled=True)

        def changed(_: Any) -> None:
            self._page.checked(lambda: self._comparing.set_weight(name, box.value), box)

        box.on_update(changed)
        return box

    def _chosen(self) -> None:
        name = str(self._actuator.value)
        self._page.screen.post("actuator", lambda: self.choose(name))

    def _set_calibrate(self) -> None:
        self._comparing.calibrate = bool(self._calibrate.value)
        self._free_folder.visible = self._comparing.calibrate

    def _set_window(self) -> None:
        self._from.visible = self._to.visible = bool(self._windowed.value)
        if self._windowed.value:
            self._page.checked(lambda: self._comparing.set_window(self._from.value, self._to.value), self._to)
        else:
            self._comparing.window_s = None

    def _list_free(self) -> None:
        """A box for every parameter that has a tolerance; the actuator's file says which are on."""
        for box in self._free:
            box.remove()
        self._free = []
        gui, actuator = self._page.server.gui, self._comparing.actuator
        with self._free_folder:
            for path, tolerance in actuator.tolerances.items():
                one, value = on_axes(path, actuator.axes), actuator.value(path)
                hint = f"{one.path}: {value:.4g} ± {tolerance.sigma:.2g} {one.unit}".rstrip() + " (1 σ)"
                box = gui.add_checkbox(one.title, path in self._comparing.free, hint=hint)
                box.on_update(lambda _, path=path, box=box: self._set_free(path, box))
                self._free.append(box)

    def _set_free(self, path: str, box: Any) -> None:
        self._page.checked(lambda: self._comparing.set_free(path, bool(box.value)), box)
