"""What Explore's controls were set to before: a step back for each movement of a slider, not each of its values.

The model that plays the plant is one of them: another one sets the sliders to its own faults.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from emaviz.session.settings import Settings

_KEPT = (
    "k", "command", "command_settings", "duration_s", "load_torque_Nm", "load_shape", "load_time_s",
    "load_frequency_Hz", "current_noise_A", "encoder_bits", "start_offset_rad", "start_speed_rad_s", "start_side",
)  # fmt: skip
_PLANT = "plant"  # of a step
_ONE_MOVEMENT_S = 0.8  # changes of one control that follow each other so soon
_MOST = 100


class Undo:
    """Steps back of some settings, and of the plant's model: plant() is its name, choose(name) goes back to it."""

    def __init__(
        self,
        settings: Settings,
        plant: Callable[[], str] = lambda: "",
        choose: Callable[[str], object] = lambda name: None,
    ) -> None:
        self._settings, self._plant, self._choose = settings, plant, choose
        self._steps: list[dict[str, Any]] = []
        self._last: tuple[Any, float] = (None, 0.0)

    def __bool__(self) -> bool:
        return bool(self._steps)

    def keep(self, control: Any) -> None:
        """To be called before a change by this control."""
        now, (before, at) = time.monotonic(), self._last
        self._last = control, now
        if control is before and now - at < _ONE_MOVEMENT_S:
            return
        self._steps = [*self._steps[1 - _MOST :], self._now()]

    def back(self) -> bool:
        """Takes the settings back to where they differed last; False where nothing is left."""
        self._last = None, 0.0
        while self._steps:
            step = self._steps.pop()
            if step != self._now():
                if (plant := step.pop(_PLANT)) != self._plant():
                    self._choose(plant)  # before the sliders, which it moves
                self._settings.restore({**self._settings.saved(), **step})
                return True
        return False

    def _now(self) -> dict[str, Any]:
        saved = self._settings.saved()
        return {name: saved[name] for name in _KEPT} | {_PLANT: self._plant()}
