"""The 3D actuator with a recording that was fitted: as measured, or as the model has it before and after."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ema_model.discovery.tracks import Track
from ema_model.errors import InputError
from ema_model.recordings import Measurement
from emaviz.page.page import Page

_PLANT = "Explore's plant"
_SHOWN = (_PLANT, "as measured", "model without the added effects", "model with them")


class ActuatorSwitch:
    """A dropdown; track() is the recording that is looked at; play(None) goes back to Explore's run."""

    def __init__(
        self, page: Page, track: Callable[[], Track | None], play: Callable[[Measurement | None], None]
    ) -> None:
        self._page, self._track, self._play = page, track, play
        self._choice = page.server.gui.add_dropdown("3D actuator", _SHOWN, hint="What it plays")
        self._choice.on_update(lambda event: event.client and page.screen.post("3D actuator", self.refresh))

    def refresh(self) -> None:
        """Plays what is chosen of the present recording; on the screen's thread."""
        track, chosen = self._track(), str(self._choice.value)
        if chosen == _PLANT or track is None:
            self._play(None)
        elif not self._page.checked(lambda: self._play(run_of(track, chosen))):
            self._choice.value = _PLANT

    @property
    def active(self) -> bool:
        """Whether it plays a recording."""
        return str(self._choice.value) != _PLANT


def run_of(track: Track, shown: str) -> Measurement:
    """A recording's blocks as a run; what was not measured is the last model's.  InputError without a position."""
    of = {_SHOWN[1]: track.measured, _SHOWN[2]: track.models[0], _SHOWN[3]: track.models[-1]}[shown]
    signals = {**track.models[-1], **track.measured, **of}
    missing = {"current_A", "motor_position_rad", "user_position_rad"} - signals.keys()
    if missing:
        raise InputError(f"{track.name}: {min(missing)} was not fitted, so that the actuator cannot be shown with it")
    time_s, motor = track.time_s, signals["motor_position_rad"]
    return Measurement({"time_s": time_s, "motor_speed_rad_s": np.gradient(motor, time_s), **signals}, track.name)
