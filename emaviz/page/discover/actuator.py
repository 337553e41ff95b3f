"""The 3D actuator with a recording that was fitted: as measured, or as the model has it before and after."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np

from ema_model.discovery.shown.tracks import Track
from ema_model.errors import InputError
from ema_model.faults import HEALTHY
from ema_model.recordings import Measurement
from emaviz.page.discover import WORKSPACE
from emaviz.page.page import Page
from emaviz.page.playback import PlaybackStrip
from emaviz.scene.motion import motion
from emaviz.session.discover.discovering import Discovering

_SHOWN = ("as measured", "calibrated model", "improved model")


class ActuatorSwitch:
    """A dropdown; track() is the recording that is looked at, which plays on Discover's own clock."""

    def __init__(
        self, page: Page, discovering: Discovering, track: Callable[[], Track | None], strip: PlaybackStrip
    ) -> None:
        self._page, self._discovering, self._track, self._strip = page, discovering, track, strip
        self._shown: tuple[object, ...] = ()
        self._choice = page.server.gui.add_dropdown("3D actuator", _SHOWN, hint="What it plays")
        self._choice.on_update(lambda event: event.client and page.screen.post("3D actuator", self.refresh))

    def refresh(self) -> None:
        """Plays what is chosen of the present recording; on the screen's thread."""
        track, chosen = self._track(), str(self._choice.value)
        if (track, chosen) == self._shown:
            return
        self._shown = (track, chosen)
        shown = None
        look = self._discovering.look
        if track is not None and look is not None:
            with suppress(InputError):  # without a position, the actuator cannot be shown with it
                shown = motion(run_of(track, chosen), HEALTHY, look.found.actuator)
        self._strip.put(shown, WORKSPACE.name)


def run_of(track: Track, shown: str) -> Measurement:
    """A recording's blocks as a run; what was not measured is the last model's.  InputError without a position."""
    of = {_SHOWN[0]: track.measured, _SHOWN[1]: track.models[0], _SHOWN[2]: track.models[-1]}[shown]
    signals = {**track.models[-1], **track.measured, **of}
    missing = {"current_A", "motor_position_rad", "user_position_rad"} - signals.keys()
    if missing:
        raise InputError(f"{track.name}: {min(missing)} was not fitted, so that the actuator cannot be shown with it")
    time_s, motor = track.time_s, signals["motor_position_rad"]
    return Measurement({"time_s": time_s, "motor_speed_rad_s": np.gradient(motor, time_s), **signals}, track.name)
