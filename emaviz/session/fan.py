"""A fan: the monitor model's response to one command under five severities of one fault, the other sliders as set."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.readings import sentences
from ema_model.faults import FAULTS, NAMES
from ema_model.recordings import Measurement
from ema_model.simulation.run import simulate_monitors
from emaviz.session.settings import Settings

SEVERITIES = (0.0, 0.25, 0.5, 0.75, 1.0)
_ECCENTRICITY, _DIRECTION = NAMES.index("k6"), NAMES.index("k7")
_SEEN = 0.5  # of an eccentricity whose direction is looked at, where the slider has none


@dataclass(frozen=True, eq=False)
class Fan:
    """Five runs, from the mildest to the worst."""

    fault: int  # 0 … 7
    k: NDArray[np.float64]  # (5, 8)
    labels: tuple[str, ...]  # (5,), in physical units
    runs: tuple[Measurement, ...]  # (5,)
    note: str = ""  # what was set besides


def fan_of(settings: Settings, actuator: Actuator, fault: int) -> Fan:
    """Simulated in one run of the population.  Raises InputError and FloatingPointError as `simulate_monitors`."""
    k = np.tile(np.asarray(settings.k, dtype=float), (len(SEVERITIES), 1))
    k[:, fault] = SEVERITIES
    note = ""
    if fault == _DIRECTION and not settings.k[_ECCENTRICITY] > 0.0:
        k[:, _ECCENTRICITY] = _SEEN
        note = f"with {FAULTS[_ECCENTRICITY].label} at {_SEEN:g}, without which a direction means nothing"
    runs = simulate_monitors(settings.run(), actuator, k, start_rad=settings.start_rad())
    return Fan(fault, k, tuple(sentences(one, actuator)[fault] for one in k), runs, note)
