"""What can be repeated: how far two recordings of one command are apart, and whether a loop can be simulated.

No model can be nearer to both than they are to each other.  Where that is far more than the floor, which is counted
from the sensors' noise, the floor is not to be believed: the rig has a noise of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from ema_model.actuator import Actuator
from ema_model.estimation import Floor
from ema_model.estimation.floor import CORRELATED_S
from ema_model.estimation.model_fit import Data, Fit
from ema_model.models.model import Window
from ema_model.recordings import Measurement
from ema_model.result import NAME, NULL, as_named

_MOST = 2.0  # floors that two recordings of one command may be apart, for the floor to be believed
_SAME = 1e-3  # of a command's range, within which two are the same
_LENGTH = 0.02  # of their lengths, that they may differ by


@dataclass(frozen=True)
class Repeated:
    """The two recordings of one command that are furthest apart."""

    recordings: Annotated[tuple[str, str], Meta(description="their names")]
    apart: Annotated[float, as_named("over_floor", "rms of their difference over √2, in floors", **NULL)]
    signals: Annotated[dict[str, float], Meta(description="the same by signal, in its unit", extra={**NAME, **NULL})]

    @property
    def floor_believable(self) -> bool:
        """Whether they are as near to each other as the floor says."""
        return self.apart < _MOST


def repeated(data: Data, held: Data | None, actuator: Actuator) -> Repeated | None:
    """The two recordings of one command, fitted or held out, that are furthest apart; None where none was repeated."""
    known = [(one, part) for part in (data, held) if part is not None for one in part.measurements]
    pairs = [pair for pair in combinations(known, 2) if pair[0][0] is not pair[1][0]]
    twice = [pair for pair in pairs if _is_same(pair[0][0], pair[1][0])]
    cut = {id(part): _parts(part, actuator) for pair in twice for _, part in pair}
    found = [
        pair
        for (first, of_first), (second, of_second) in twice
        for one in cut[id(of_first)]
        for other in cut[id(of_second)]
        if one[0] is first and other[0] is second and (pair := _apart(one, other, data)) is not None
    ]
    return max(found, key=lambda pair: pair.apart, default=None)


_Part = tuple[Measurement, Window, Floor]


def _parts(data: Data, actuator: Actuator) -> Sequence[_Part]:
    windows = data.plant(actuator).windows
    return [(data.measurements[window.recording], window, floor) for window, floor in zip(windows, data.floors)]


def _apart(one: _Part, other: _Part, data: Data) -> Repeated | None:
    (first, its, floor), (second, theirs, _) = one, other
    if its.first != theirs.first:
        return None
    blocks = min(its.blocks, theirs.blocks)
    known = data.fitted(its.measured.keys() & theirs.measured.keys())
    if not known:
        return None
    ours, others = its.measured, theirs.measured
    differences = {name: (ours[name][:blocks] - others[name][:blocks]) / np.sqrt(2.0) for name in known}
    over_floor = [differences[name] / floor.sigma(name)[:blocks] for name in known]
    squared = [np.average(one**2, weights=floor.counts[:blocks]) for one in over_floor]
    return Repeated(
        (first.name, second.name),
        float(np.sqrt(np.mean(squared))),
        {name: float(np.sqrt(np.mean(value**2))) for name, value in differences.items()},
    )


def _is_same(first: Measurement, second: Measurement) -> bool:
    """Whether they are of one command, sample by sample."""
    if "command_rad" not in first or "command_rad" not in second:
        return False
    if not np.isclose(first.sample_period_s, second.sample_period_s, rtol=1e-3):
        return False
    length = min(first.samples, second.samples)
    if length < (1.0 - _LENGTH) * max(first.samples, second.samples):
        return False
    one, other = first["command_rad"][:length], second["command_rad"][:length]
    moved = float(np.ptp(one))
    return moved > 0.0 and bool(np.max(np.abs(one - other)) <= _SAME * moved)


# --- Whether a closed loop can be simulated at all: two models that hardly differ must behave alike -------------------
# A limit cycle of backlash, or a motor that sticks now here, now there, makes them drift apart; a comparison in time
# means nothing then, and what the motor needed (inverse dynamics) is compared instead.

Array = NDArray[np.float64]

_APART = 5e-4  # of the inertia
_IN_PROPORTION = 2.0 * _APART  # of a signal: what any loop's may change by
_LOST = 0.5  # of the blocks, from which on a recording cannot be compared in time


def with_divergence(data: Data, found: Fit) -> tuple[Data, float]:
    """The data with what such neighbours differ by in the model's floor, and the share of blocks that are lost.

    A block is lost where the neighbours' currents (or positions) differ by more than the noise, and by more than in
    proportion: a recording without noise would show any change.
    """
    plant = found.plant
    if not plant.simulates_commands:
        return data, 0.0
    fitted = found.calibration.actuator
    inertia = fitted.value("motor.inertia_kgm2")
    neighbour = fitted.varied({"motor.inertia_kgm2": inertia * np.array([1.0, 1.0 + _APART])})
    k = np.tile(found.calibration.k, (2, 1))
    floors, lost = [], []
    for i, (window, one) in enumerate(zip(plant.windows, data.floors)):
        shown = plant.signals(i, neighbour, k, *found.calibration.start_of(i))
        width = max(3, round(CORRELATED_S / window.block_s) | 1)
        apart = {
            name: np.sqrt(np.maximum(uniform_filter1d((shown[name][1] - shown[name][0]) ** 2, width), 0.0))
            for name in one.model
        }
        floors.append(one.beside(replace(one, model=apart)))
        name = next(iter(data.fitted(apart)), None)
        if name is not None:
            size = float(np.sqrt(np.mean(window.measured[name] ** 2)))
            lost.append(apart[name] > max(one.noise[name], _IN_PROPORTION * size))
    return replace(data, floors=floors), float(np.mean(np.concatenate(lost)) if lost else 0.0)


def is_lost(share: float) -> bool:
    """Whether too little is left to compare in time."""
    return share > _LOST


def by_inverse_dynamics(measurements: Sequence[Measurement], actuator: Actuator) -> Actuator | None:
    """The actuator without its controller, where the recordings tell what the motor needed; None where they do not."""
    if all("motor_position_rad" in one and ("current_A" in one or "motor_torque_Nm" in one) for one in measurements):
        return actuator.without_controller()
    return None
