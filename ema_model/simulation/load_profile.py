"""How the load on the user shaft goes over time: constant, a step, a sine or a chirp (the thesis's load block)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.quantities.numbers import check_number

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LoadProfile:
    """Shares of the run's load torque over time.

    time_s: when a step comes, and how long a chirp's frequency rises; frequency_Hz: of a sine, and where a chirp ends.
    Raises InputError for a shape that does not exist, for what is no number and for numbers that make no sense.
    """

    shape: str = "constant"
    time_s: float = 0.1
    frequency_Hz: float = 5.0

    def __post_init__(self) -> None:
        if self.shape not in SHAPES:
            like = did_you_mean(self.shape, SHAPES)
            raise InputError(
                f"the load's shape must be one of {', '.join(SHAPES)}, not {quoted(self.shape, 40)!r}{like}"
            )
        for name in ("time_s", "frequency_Hz"):
            value = getattr(self, name)
            check_number(value, f"the load's {name}")
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"the load's {name} must be above 0, not {value:g}")

    def at(self, time_s: NDArray[np.floating]) -> Array:
        """Shares of the torque at these times, −1 … 1, (n,)."""
        return _SHAPES[self.shape](np.asarray(time_s, dtype=float), self)


@dataclass(frozen=True, eq=False)
class RecordedLoad:
    """Shares of the run's load torque as they were recorded, (n,) each; the last one stays."""

    time_s: Array
    shares: Array

    def at(self, time_s: NDArray[np.floating]) -> Array:
        """As `LoadProfile.at`."""
        return np.interp(time_s, self.time_s, self.shares)


def _constant(time_s: Array, _: LoadProfile) -> Array:
    return np.ones_like(time_s)


def _step(time_s: Array, profile: LoadProfile) -> Array:
    return np.where(time_s < profile.time_s - 1e-12, 0.0, 1.0)


def _sine(time_s: Array, profile: LoadProfile) -> Array:
    return np.sin(2.0 * np.pi * profile.frequency_Hz * time_s)


def _chirp(time_s: Array, profile: LoadProfile) -> Array:
    swept = np.minimum(time_s, profile.time_s)
    cycles = profile.frequency_Hz * (0.5 * swept**2 / profile.time_s + time_s - swept)
    return np.sin(2.0 * np.pi * cycles)


SHAPES = ("constant", "step", "sine", "chirp")
_SHAPES: dict[str, Callable[[Array, LoadProfile], Array]] = dict(zip(SHAPES, (_constant, _step, _sine, _chirp)))
