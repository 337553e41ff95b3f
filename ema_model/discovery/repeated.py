"""What a rig repeats: where a command was recorded twice, how far the two recordings are apart.

No model can be nearer to both than they are to each other.  Where that is far more than the floor, which is counted
from the sensors' noise, the floor is not to be believed: the rig has a noise of its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ema_model.discovery.model_fit import Data
from ema_model.discovery.result import Discovery
from ema_model.estimation import Floor
from ema_model.models.model import Window
from ema_model.recordings import Measurement

_MOST = 2.0  # floors that two recordings of one command may be apart, for the floor to be believed
_SAME = 1e-3  # of a command's range, within which two are the same
_LENGTH = 0.02  # of their lengths, that they may differ by


@dataclass(frozen=True)
class Repeated:
    """Two recordings of one command."""

    recordings: tuple[str, str]
    apart: float  # rms of their difference over √2, in floors
    signals: dict[str, float]  # the same of each signal, in its unit

    @property
    def floor_believable(self) -> bool:
        """Whether they are as near to each other as the floor says."""
        return self.apart < _MOST


def repeated(found: Discovery) -> Repeated | None:
    """The two recordings of one command, fitted or held out, that are furthest apart; None where none was repeated."""
    parts = [part for data in (found.data, found.held) if data is not None for part in _parts(data, found)]
    pairs = [
        pair
        for one, other in combinations(parts, 2)
        if one[0] is not other[0] and (pair := _apart(one, other, list(found.data.signals))) is not None
    ]
    return max(pairs, key=lambda pair: pair.apart, default=None)


_Part = tuple[Measurement, Window, Floor]


def _parts(data: Data, found: Discovery) -> Iterator[_Part]:
    for window, floor in zip(data.plant(found.actuator).windows, data.floors):
        yield data.measurements[window.recording], window, floor


def _apart(one: _Part, other: _Part, names: list[str]) -> Repeated | None:
    (first, its, floor), (second, theirs, _) = one, other
    if its.first != theirs.first or not _is_same(first, second):
        return None
    blocks = min(its.blocks, theirs.blocks)
    known = [name for name in names if name in its.measured and name in theirs.measured]
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
