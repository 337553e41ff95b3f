"""Plays a simulated run on the 3D actuator, slower than life, over and over."""

from __future__ import annotations

import threading
import time

import numpy as np

from emaviz.scene.actuator import ActuatorScene
from emaviz.session import Simulation

_POSES_PER_S = 25.0
_LARGEST_TURN_RAD = 0.6  # to which the surface's motion is exaggerated


class Playback:
    """A thread that turns the scene; `run_s` seconds of the run take `run_s / speed` on the screen."""

    def __init__(self, scene: ActuatorScene, speed: float = 0.1) -> None:
        self._scene = scene
        self._speed = speed
        self._simulation: Simulation | None = None
        self._closing = threading.Event()
        self._playing = True
        self._thread = threading.Thread(target=self._run, name="emaviz-playback", daemon=True)
        self._thread.start()

    def show(self, simulation: Simulation) -> None:
        """Plays this run from now on, from the same moment."""
        self._simulation = simulation

    def play(self, playing: bool) -> None:
        """Lets the picture move or rest."""
        self._playing = playing

    def caption(self, simulation: Simulation) -> str:
        """What of the picture is not to scale."""
        enlarged = self.exaggeration(simulation)
        return f"Played {1.0 / self._speed:g} × slower; the surface's motion is enlarged {enlarged:g} ×."

    def exaggeration(self, simulation: Simulation) -> float:
        """By how much the surface's motion is enlarged: a round number."""
        user = simulation.reference["user_position_rad"]
        largest = float(np.max(np.abs(user)))
        if largest <= 0.0:
            return 1.0
        factor = max(1.0, _LARGEST_TURN_RAD / largest)
        return float(np.floor(factor / 10.0 ** np.floor(np.log10(factor))) * 10.0 ** np.floor(np.log10(factor)))

    def close(self) -> None:
        """Ends the thread."""
        self._closing.set()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        clock, last = 0.0, time.monotonic()
        while not self._closing.wait(1.0 / _POSES_PER_S):
            now = time.monotonic()
            clock, last = clock + (now - last) * self._speed, now
            simulation = self._simulation
            if simulation is None or not self._playing:
                continue
            reference = simulation.reference
            clock %= reference.duration_s
            at = int(clock / reference.sample_period_s)
            self._scene.pose(
                float(reference["motor_position_rad"][at]),
                self.exaggeration(simulation) * float(reference["user_position_rad"][at]),
            )
