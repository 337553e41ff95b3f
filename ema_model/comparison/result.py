"""What a comparison finds, in the words and numbers that the screen, the report and JSON show."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ema_model.comparison.explain import Explanation
from ema_model.comparison.residuals import Residuals
from ema_model.quantities.numbers import Quantity
from ema_model.text import InWords

if TYPE_CHECKING:
    from ema_model.actuator import Actuator
    from ema_model.comparison.events import Event
    from ema_model.comparison.explain import Order
    from ema_model.comparison.free_simulation import Simulated
    from ema_model.estimation.calibrate import Calibration
    from ema_model.recordings import Measurement
    from ema_model.recordings.health import Health

Array = NDArray[np.float64]

COMPARISON_VERDICTS = ("adequate", "not_adequate", "uninformative")


@dataclass(frozen=True, eq=False)
class Region:
    """A range of a variable in which the model fails most."""

    signal: str
    variable: str
    low: float
    high: float
    rmse: float  # in the signal's unit
    mean: float  # of the residual, likewise
    excess: float  # rmse over the floor there
    sentence: str  # "The motor needs 35.2 mN·m more torque at 300 rad/s than the model."
    blocks: NDArray[np.bool_]  # (blocks,) of the joined residuals


@dataclass(frozen=True)
class SignalError:
    """How far the model is from one signal over all recordings, in the signal's unit."""

    rmse: float
    rmse_initial: float  # before calibration
    nrmse: float  # rmse over the range of the measured signal
    noise_floor: float  # noise and model floor, rms
    mean_absolute: float
    signal_rms: float = math.nan  # of what was measured; of a position about its mean
    silent: str = ""  # why the signal tells nothing of the model, as of `estimation.floor.tells_nothing`

    def quantity(self, signal: Quantity) -> Quantity:
        """The signal in the prefix that all numbers of its error are written with."""
        return signal.scaled([self.rmse, self.noise_floor])


@dataclass(frozen=True, eq=False)
class Compared:
    """One recording beside the model; all arrays are (blocks,)."""

    name: str
    measurement: Measurement  # as it was compared
    health: Health
    time_s: Array
    measured: dict[str, Array]
    initial: dict[str, Array]  # the model with the file's parameters
    model: dict[str, Array]  # the model after calibration (the same without one)
    sigma: dict[str, Array]  # standard deviation that a perfect model would leave
    errors: dict[str, SignalError]


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(InWords):
    """All of it: the recordings one by one, and what they say together."""

    actuator: Actuator  # as given
    calibration: Calibration | None
    recordings: Sequence[Compared]
    residuals: Residuals  # joined
    signals: dict[str, SignalError]
    primary: str  # the signal whose residual is explained
    explained_by: Sequence[Explanation]  # best first
    orders: Sequence[Order]  # of the primary signal, strongest first; significant ones only
    worst_regions: Sequence[Region]  # worst first
    adequate: bool
    over_floor: float  # error in floors, pooled over signals
    floor_band: tuple[float, float]  # between which nine of ten true models' lie
    sentences: Sequence[str]  # the answer in plain words, the first one first
    warnings: Sequence[str] = field(default_factory=tuple)
    events: Sequence[Event] = field(default_factory=tuple)  # what happened at one moment of a recording
    holdout: Sequence[Compared] = field(default_factory=tuple)  # not fitted, beside the calibrated model
    uninformative: bool = False  # the recordings tell nothing of the model, so that it is not adequate either
    simulation: Mapping[str, Simulated] = field(default_factory=dict)  # of the model running freely, by signal

    @property
    def verdict(self) -> str:
        """One of `COMPARISON_VERDICTS`."""
        return "uninformative" if self.uninformative else "adequate" if self.adequate else "not_adequate"
