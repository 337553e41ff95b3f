"""What every command is, and those of a formula: the thesis's four (T 3.5 … 3.8), the multisine and the staircase."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ema_model.errors import InputError
from ema_model.quantities import check_number

# --- what every command is: settings with units in their names, and the user's position demand over time --------------

Array = NDArray[np.floating]


@dataclass(frozen=True)
class Command(ABC):
    """A position command at the user, rad.  The dataclass's fields are its settings."""

    name: ClassVar[str]
    place: ClassVar[int] = 9  # in lists; those of one place stand by their names
    title: ClassVar[str]

    @abstractmethod
    def at(self, time_s: Array) -> Array:
        """Command, rad, at these times, s; both (n,)."""

    def settings(self) -> dict[str, Any]:
        """The settings by name."""
        return asdict(self)

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            if isinstance(f.default, int | float):
                check_number(value, f"{self.name}: {f.name}")
                if not math.isfinite(value):
                    raise InputError(f"{self.name}: {f.name} must be a finite number, not {value}")
                never_negative = f.name.endswith(("_Hz", "time_s"))
                if never_negative and value < 0.0:
                    raise InputError(f"{self.name}: {f.name} must not be negative, not {value:g}")


# --- commands of a formula --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Step(Command):
    """From one position to another at a time; the thesis's 1 rad cannot be reached within 0.5 s."""

    name = "step"
    place = 1  # the thesis's four come first
    title = "Step"
    initial_rad: float = 0.0
    final_rad: float = 1.0
    time_s: float = 0.01

    def at(self, time_s: Array) -> Array:
        return np.where(time_s < self.time_s - 1e-12, self.initial_rad, self.final_rad)


@dataclass(frozen=True)
class Ramp(Command):
    """A constant speed from a start time on."""

    name = "ramp"
    place = 2  # the thesis's four come first
    title = "Ramp"
    slope_rad_s: float = 1e-3
    initial_rad: float = 0.0
    time_s: float = 0.0

    def at(self, time_s: Array) -> Array:
        return self.initial_rad + self.slope_rad_s * np.maximum(time_s - self.time_s, 0.0)


@dataclass(frozen=True)
class Sine(Command):
    """A sine about a bias."""

    name = "sine"
    place = 3  # the thesis's four come first
    title = "Sine"
    amplitude_rad: float = 5e-3
    frequency_Hz: float = 15.0
    bias_rad: float = 0.0

    def at(self, time_s: Array) -> Array:
        return self.bias_rad + self.amplitude_rad * np.sin(2.0 * np.pi * self.frequency_Hz * time_s)


@dataclass(frozen=True)
class Chirp(Command):
    """A sine whose frequency rises linearly until the end time and stays there: 2π(f₀t + ½(f₁ − f₀)t²/T)."""

    name = "chirp"
    place = 4  # the thesis's four come first
    title = "Chirp"
    amplitude_rad: float = 5e-3
    start_Hz: float = 0.0
    end_Hz: float = 15.0
    end_time_s: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.end_time_s <= 0.0:
            raise InputError(f"chirp: end_time_s must be above 0, not {self.end_time_s:g}")

    def at(self, time_s: Array) -> Array:
        swept = np.minimum(time_s, self.end_time_s)
        rise = (self.end_Hz - self.start_Hz) / self.end_time_s
        cycles = self.start_Hz * swept + 0.5 * rise * swept**2 + self.end_Hz * (time_s - swept)
        return self.amplitude_rad * np.sin(2.0 * np.pi * cycles)


@dataclass(frozen=True)
class Multisine(Command):
    """The mean of sines with Schroeder's phases (IEEE Trans. Inf. Theory 16, 1970), which keep the peak low."""

    name = "multisine"
    title = "Multisine"
    amplitude_rad: float = 5e-3
    frequencies_Hz: tuple[float, ...] = (2.0, 6.0, 14.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.frequencies_Hz:
            raise InputError("multisine: frequencies_Hz must name one frequency or more (1+3+7)")
        if not all(0.0 < f < 1e4 for f in self.frequencies_Hz):
            raise InputError("multisine: frequencies_Hz must lie between 0 and 10000 Hz")

    def at(self, time_s: Array) -> Array:
        n = len(self.frequencies_Hz)
        phases = [-np.pi * i * (i + 1) / n for i in range(n)]
        waves = [np.sin(2.0 * np.pi * f * time_s + p) - np.sin(p) for f, p in zip(self.frequencies_Hz, phases)]
        return self.amplitude_rad * np.mean(waves, axis=0)


@dataclass(frozen=True)
class Staircase(Command):
    """Rises by one step after every dwell."""

    name = "staircase"
    title = "Staircase"
    step_rad: float = 2e-3
    dwell_s: float = 0.05

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.dwell_s <= 0.0:
            raise InputError(f"staircase: dwell_s must be above 0, not {self.dwell_s:g}")

    def at(self, time_s: Array) -> Array:
        return self.step_rad * np.floor(time_s / self.dwell_s + 1e-9)
