"""How well a floor is known: between which multiples of it the error of a true model lies."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from ema_model.estimation.floor import CORRELATED_S, Floor
from ema_model.quantities.interval import HALF_90
from ema_model.recordings.noise import SCATTER

Array = NDArray[np.float64]

_ROUNDING = 1e-9
_KNOWN_TO = 0.02  # of a floor: a few in a hundred of the noise and of what a fit takes up remain a guess


def spread(floors: Sequence[Floor], signals: Sequence[Collection[str]]) -> float:
    """Standard deviation of a true model's error in floors, pooled over windows and over each window's signals.

    The squared error is a mean: of noise, block by block (or as often as a filter leaves it alike), whose size is
    itself estimated, unless it is a grid's; and of the model's own error, which is one value in 25 ms, or a standstill,
    for all signals.
    A square of a normal value scatters by √2 of its mean.
    """
    variance = total = 0.0
    for one, names in zip(floors, signals):
        size = max(1, round(CORRELATED_S / one.block_s))
        lasting = np.zeros(len(one.counts))
        for name in names:
            of_noise = one.counts * (one.white_part(name) / one.sigma(name)) ** 2
            lasting += one.counts - of_noise
            estimated = 0.0 if name in one.exact else 4.0 * SCATTER / len(of_noise)
            variance += 2.0 * one.alike * float(of_noise @ of_noise) + estimated * float(of_noise.sum()) ** 2
            total += float(one.counts.sum())
        value = np.ceil(np.cumsum(one.counts) / size - _ROUNDING).astype(int)  # a standstill counts 25 ms, in all
        together = np.bincount(value, lasting)
        variance += 2.0 * float(together @ together)
    return float(np.hypot(0.5 * np.sqrt(variance) / total, _KNOWN_TO)) if total else _KNOWN_TO


def least(floors: Sequence[Floor], signals: Sequence[Collection[str]]) -> float:
    """The error in floors of a true model of which nothing is there that the floors only allow for, pooled likewise."""
    left = total = 0.0
    for one, names in zip(floors, signals):
        for name in names:
            allowed = (one.allowed[name] / one.sigma(name)) ** 2 if name in one.allowed else np.zeros(len(one.counts))
            left += float(one.counts @ (1.0 - allowed))
            total += float(one.counts.sum())
    return float(np.sqrt(left / total)) if total else 1.0


def band(spread: float, least: float = 1.0) -> tuple[float, float]:
    """Between which multiples of the floor nine of ten true models' errors lie; `least`: what a floor is made of."""
    half = HALF_90 * spread
    return max(0.0, 1.0 - half) * least, 1.0 + half
