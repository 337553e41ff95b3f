"""The load on the user shaft: its torque, and how it goes over time."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from ema_model.quantities.shown import of_signal
from ema_model.simulation.load_profile import SHAPES
from emaviz.page.page import Page
from emaviz.session.described import limits
from emaviz.session.settings import Settings

_SEEN_NM = 20.0  # that a profile begins with where there was no load
_WITH_TIME, _WITH_FREQUENCY = ("step", "chirp"), ("sine", "chirp")
Listen = Callable[[Any, Callable[[Any], Any], Callable[[], Any]], None]


class LoadControls:
    """Controls in the folder that is open."""

    def __init__(self, page: Page, listen: Listen) -> None:
        """listen(control, setter, read): has a control's new value simulated."""
        gui, settings = page.server.gui, page.session.settings
        self._settings = settings
        of = partial(limits, Settings)
        self._shape: Any = gui.add_dropdown("Profile", SHAPES, hint="How the load goes over time")
        self._torque: Any = gui.add_number(
            of_signal("load_torque_Nm", page.session.actuator.axes).label, 0.0, **of("load_torque_Nm"), step=1.0
        )
        self._time: Any = gui.add_number(
            "Step at [s]", settings.load_time_s, **of("load_time_s"), step=0.01, visible=False
        )
        self._frequency: Any = gui.add_number(
            "Frequency [Hz]", settings.load_frequency_Hz, **of("load_frequency_Hz"), step=0.5, visible=False
        )
        listen(self._shape, self._choose, lambda: settings.load_shape)
        listen(self._torque, partial(settings.set, "load_torque_Nm"), lambda: settings.load_torque_Nm)
        listen(self._time, partial(settings.set, "load_time_s"), lambda: settings.load_time_s)
        listen(self._frequency, partial(settings.set, "load_frequency_Hz"), lambda: settings.load_frequency_Hz)

    def _choose(self, shape: Any) -> None:
        self._settings.set("load_shape", shape)
        if shape != SHAPES[0] and not self._settings.load_torque_Nm:
            self._settings.set("load_torque_Nm", _SEEN_NM)
            self._torque.value = _SEEN_NM
        self.show()

    def show(self) -> None:
        """The fields that the profile has."""
        shape = self._settings.load_shape
        self._time.visible, self._frequency.visible = shape in _WITH_TIME, shape in _WITH_FREQUENCY
        self._time.label = "Step at [s]" if shape == "step" else "Sweep time [s]"
        self._frequency.label = "End frequency [Hz]" if shape == "chirp" else "Frequency [Hz]"
