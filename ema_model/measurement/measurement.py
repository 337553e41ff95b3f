"""Signals of one run of an actuator, simulated or real."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Measurement:
    """Signals on a common time base, in SI units, by their canonical names (`SIGNALS`).

    Arrays are float64, all of one length, read-only, and include `time_s`.
    """

    signals: dict[str, Array]
    name: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        frozen = {}
        for name, values in self.signals.items():
            array = np.array(values, dtype=np.float64)
            array.setflags(write=False)
            frozen[name] = array
        if len({len(values) for values in frozen.values()}) != 1 or "time_s" not in frozen:
            raise ValueError("a measurement needs time_s and signals of one length")
        object.__setattr__(self, "signals", frozen)

    def __getitem__(self, name: str) -> Array:
        return self.signals[name]

    def __contains__(self, name: object) -> bool:
        return name in self.signals

    def get(self, name: str) -> Array | None:
        """The signal, or None where it was not recorded."""
        return self.signals.get(name)

    @property
    def time_s(self) -> Array:
        """Time, s, strictly increasing."""
        return self.signals["time_s"]

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.time_s)

    @property
    def duration_s(self) -> float:
        """From the first sample to the last, s."""
        return float(self.time_s[-1] - self.time_s[0])

    @property
    def sample_period_s(self) -> float:
        """Median time between samples, s."""
        return float(np.median(np.diff(self.time_s)))

    @property
    def is_uniform(self) -> bool:
        """Whether no sample is off a regular grid by more than a thousandth of the period."""
        period = self.duration_s / (self.samples - 1)
        grid = self.time_s[0] + period * np.arange(self.samples)
        return bool(np.max(np.abs(self.time_s - grid)) < 1e-3 * period)

    def require(self, *names: str) -> None:
        """InputError if one of the signals is missing."""
        missing = [name for name in names if name not in self.signals]
        if missing:
            raise InputError(
                f"{self.name or 'the recording'}: column {', '.join(missing)} is needed; "
                f"the columns are {', '.join(self.signals)}"
            )

    def with_signals(self, **signals: ArrayLike) -> Measurement:
        """A copy with signals replaced or added."""
        return replace(self, signals={**self.signals, **{n: np.asarray(v) for n, v in signals.items()}})

    def resampled(self, period_s: float) -> Measurement:
        """On a regular grid from the first sample on, linear between samples."""
        count = int(np.floor(self.duration_s / period_s + 1e-9)) + 1
        grid = self.time_s[0] + period_s * np.arange(count)
        signals = {name: np.interp(grid, self.time_s, values) for name, values in self.signals.items()}
        note = f"resampled to a regular {1.0 / period_s:g} Hz"
        return replace(self, signals={**signals, "time_s": grid}, notes=(*self.notes, note))
