"""What a rig repeats: where a command was recorded twice, how far the two recordings are apart.

No model can be nearer to both than they are to each other.  Where that is far more than the floor, which is counted
from the sensors' noise, the floor is not to be believed: the rig has a noise of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Annotated

import numpy as np
from msgspec import Meta

from ema_model.actuator import Actuator
from ema_model.estimation import Floor
from ema_model.estimation.model_fit import Data
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
