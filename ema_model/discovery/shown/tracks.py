"""The fitted recordings of a discovery as lines over time: measured, the model of each step, and the floor."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ema_model.comparison.verdict import ORDER_OF_PRIMARY
from ema_model.discovery.result import Discovery

Array = NDArray[np.float64]

PAUSE_S = 0.2  # between runs that each start anew, so that one is seen to end


@dataclass(frozen=True, eq=False)
class Track:
    """One recording; all arrays are (blocks,)."""

    name: str
    time_s: Array  # increasing: a run that starts anew follows the one before
    measured: dict[str, Array]
    models: list[dict[str, Array]]  # of each step of the ladder
    sigma: dict[str, Array]  # what a perfect model would leave

    def residual(self, signal: str, step: int) -> Array:
        """Measured − model of that step of the ladder."""
        return self.measured[signal] - self.models[step][signal]


def primary(found: Discovery) -> str:
    """The signal whose residual tells most: the current where it was fitted."""
    fitted = found.ladder[0].signals
    return next((name for name in ORDER_OF_PRIMARY if name in fitted), next(iter(fitted)))


def tracks(found: Discovery) -> list[Track]:
    """A track for each fitted recording, in their order, with the signals that were fitted."""
    floors = found.floors
    windows = found.plant.windows
    joined = []
    for recording in dict.fromkeys(window.recording for window in windows):
        parts = [i for i, window in enumerate(windows) if window.recording == recording]
        names = [name for name in found.ladder[0].signals if all(name in windows[i].measured for i in parts)]
        joined.append(
            Track(
                windows[parts[0]].name,
                _onward([windows[i].time_s for i in parts]),
                {name: np.concatenate([windows[i].measured[name] for i in parts]) for name in names},
                [
                    {name: np.concatenate([rung.signals_per_window[i][name] for i in parts]) for name in names}
                    for rung in found.ladder
                ],
                {name: np.concatenate([floors[i].sigma(name) for i in parts]) for name in names},
            )
        )
    return joined


def one_after_another(found: list[Track]) -> tuple[list[Array], list[float]]:
    """Times of the tracks on one axis, s, and what was added to each; the first keeps its own."""
    times, shifts = [], []
    for track in found:
        shift = float(times[-1][-1] + PAUSE_S - track.time_s[0]) if times else 0.0
        times.append(track.time_s + shift)
        shifts.append(shift)
    return times, shifts


def _onward(parts: list[Array]) -> Array:
    times = [parts[0]]
    for before, part in pairwise(parts):
        shift = times[-1][-1] - before[-1]
        back = part[0] + shift <= times[-1][-1]
        times.append(part + (times[-1][-1] + PAUSE_S - part[0] if back else shift))
    return np.concatenate(times)
