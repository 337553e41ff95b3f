"""How late the position follows its command: measured, and as the file's own model has it.

A loop that is closed stiffly follows by what its controller is, whatever it drives: in a steady motion it trails by the
time 1/(G τ) of its position gain, or by less where the command's speed is fed forward.  So where a fit ends at its
bounds with a large error, this tells whether it is the controller that is another one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.comparison.thresholds import AT_BOUNDS, LAG_APART, LAG_SAMPLES, MISSED
from ema_model.estimation import Calibration
from ema_model.estimation.noise import POSITIONS
from ema_model.models import Model, Window
from ema_model.quantities import number

Array = NDArray[np.float64]

BLAMED = "The controller is not what the file says."
_LATEST_SHARE = 0.25  # of a window, that a position is looked for behind its command
_LEAST_FOLLOWED = 0.5  # of the position's variance, that its command must explain for its delay to have a meaning


@dataclass(frozen=True)
class LoopLag:
    """By how much the position comes after the command, s."""

    measured_s: float
    of_file_s: float  # that of the model with the file's values
    sample_s: float

    @property
    def differs(self) -> bool:
        """Whether they are apart by more than how it was logged, and by much."""
        away = abs(self.measured_s - self.of_file_s)
        return away > max(LAG_SAMPLES * self.sample_s, LAG_APART * max(abs(self.measured_s), abs(self.of_file_s)))

    @property
    def sentence(self) -> str:
        """'The position follows its command after 0.1 ms, and with the file's controller would after 5.0 ms.'"""
        measured, file = (number(1e3 * one, 2) for one in (self.measured_s, self.of_file_s))
        own = f"The position follows its command after {measured} ms"
        return f"{own}, and with the file's controller would after {file} ms."

    def blamed(self, calibration: Calibration | None, over_floor: float) -> str:
        """The same with what else speaks against the controller."""
        at_bounds = f"{_at_bounds(calibration)} parameters end at the edge of their tolerance"
        return f"{BLAMED} {self.sentence} {at_bounds}, and {number(over_floor)} floors are left."


def _at_bounds(calibration: Calibration | None) -> int:
    return 0 if calibration is None else sum(one.at_bound for one in calibration.parameters.values())


def other_controller(
    model: Model, calibration: Calibration | None, before: Sequence[Mapping[str, Array]], over_floor: float
) -> LoopLag | None:
    """The delays, where several parameters ended at their bounds, much is left, and the loop follows another way.

    before: the signals of the model with the file's values, by window.  None of a loop that is not a cascade: how late
    a servo without a speed loop is depends on what it drives.
    """
    if _at_bounds(calibration) < AT_BOUNDS or over_floor < MISSED or model.actuator.controller.kind != "cascade":
        return None
    lag = loop_lag(model, before)
    return lag if lag is not None and lag.differs else None


def loop_lag(model: Model, before: Sequence[Mapping[str, Array]]) -> LoopLag | None:
    """The median over the windows whose position follows a command that moves; None where there is none."""
    found = []
    for window, shown in zip(model.windows, before):
        name = next((one for one in POSITIONS if one in window.measured and one in shown), None)
        if window.command is None or name is None:
            continue
        command = _at_blocks(window, name, model.actuator)
        delays = [_behind(command, values, window.block_s) for values in (window.measured[name], shown[name])]
        if None not in delays:
            found.append(delays)
    if not found:
        return None
    measured, of_file = np.median(np.array(found, dtype=float), axis=0)
    return LoopLag(float(measured), float(of_file), max(one.sample_period_s for one in model.measurements))


def _at_blocks(window: Window, name: str, actuator: Actuator) -> Array:
    """The command as a mean of each block, at the motor where that was measured, (blocks,)."""
    assert window.command is not None
    steps = len(window.command) // window.blocks
    means = window.command[: steps * window.blocks].reshape(window.blocks, steps).mean(axis=1)
    return means / (actuator.transmission.gear_ratio if name == "motor_position_rad" else 1.0)


def _behind(command: Array, position: Array, block_s: float) -> float | None:
    """The delay, s, with which the command's changes suit the position's best; None where they do not.

    By least squares over whole blocks, and the parabola through the best three.
    """
    most = max(2, int(_LATEST_SHARE * len(command)))
    moved, told = np.diff(position), np.diff(command)
    used = slice(most, len(moved) - most)
    size = float(np.var(moved[used])) if len(moved) > 3 * most else 0.0
    if size == 0.0 or not np.ptp(told):
        return None
    delays = np.arange(-2, most)
    suits = np.array([_explained(told[used.start - d : used.stop - d], moved[used]) for d in delays])
    best = int(np.argmax(suits))
    if suits[best] < _LEAST_FOLLOWED or best in (0, len(delays) - 1):
        return None
    low, at, high = suits[best - 1 : best + 2]
    bend = low - 2.0 * at + high
    return float(delays[best] + (0.5 * (low - high) / bend if bend else 0.0)) * block_s


def _explained(told: Array, moved: Array) -> float:
    """R² of one by the other."""
    both = float(np.cov(told, moved)[0, 1])
    size = float(np.var(told, ddof=1) * np.var(moved, ddof=1))
    return both * abs(both) / size if size else 0.0
