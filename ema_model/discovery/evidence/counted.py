"""How much a fall of the error says, told by what is left after it.

χ² counts in units of the sensors' noise, as if values were independent.  Where physics is missing that the model
cannot have, what is left is neither: it is large, and it comes in few shapes that last.  A fall of χ² is then worth as
much less as the residual's power at its own frequencies stands above white noise; at the floor it is worth itself.

The spectrum is the residual's own, over whole windows and over pieces of them, since errors may last and may come in
bursts: the higher of the two counts.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ema_model.estimation.model_fit import Data, Fit
from ema_model.models import Model

Array = NDArray[np.float64]

_PIECE = 256  # values, an eighth of a second


def colour(data: Data, plant: Model, residual: Array) -> Array:
    """How many times above white noise of the floor's size a residual is where its power lies: (values,), at least 1.

    χ² over it is the number of independent values that a signal of such a spectrum has.
    """
    parts: dict[str, list[slice]] = {}
    for name, rows in signals_of(data, plant):
        parts.setdefault(name, []).append(rows)
    found = np.ones(len(residual))
    for its in parts.values():
        whole = [residual[rows] for rows in its]
        if np.mean(np.concatenate(whole) ** 2) <= 1.0:
            continue  # within what sensors and the model's own limits leave: the floor tells how that is correlated
        pieces = [piece for one in whole for piece in np.array_split(one, max(1, round(len(one) / _PIECE)))]
        density = max(1.0, _density(whole), _density(pieces))
        for rows in its:
            found[rows] = density
    return found


def signals_of(data: Data, plant: Model) -> Iterator[tuple[str, slice]]:
    """The fitted signals of each window with their rows in a residual, in its order."""
    row = 0
    for window in plant.windows:
        for name in data.signals:
            if name in window.measured:
                yield name, slice(row, row + window.blocks)
                row += window.blocks


@lru_cache(maxsize=32)  # a trial is judged, ranked and told by it
def colour_of(data: Data, found: Fit) -> Array:
    """`colour` of what a fit leaves."""
    return colour(data, found.plant, found.residual)


def evidence(data: Data, before: Fit, after: Fit) -> float:
    """What a model tells more than another, in χ² relative to what it leaves itself."""
    squares = before.residual**2 - after.residual**2
    prior = before.calibration.x @ before.calibration.x - after.calibration.x @ after.calibration.x
    return float(np.sum(squares / colour_of(data, after)) + prior)


def effective_values(data: Data, found: Fit) -> float:
    """Number of independent values that a fit leaves: all of them at the floor, its shapes far above it."""
    squares = np.maximum(found.residual**2, colour_of(data, found) == 1.0)
    return max(2.0, float(np.sum(squares / colour_of(data, found))))


def predicted_evidence(data: Data, current: Fit, change: Array) -> float:
    """The same of a change of the residual, before any refit."""
    left = current.residual + change
    return float(np.sum((current.residual**2 - left**2) / colour(data, current.plant, left)))


def _density(parts: list[Array]) -> float:
    """Mean of a spectrum, weighted by itself; 1 for white noise of variance 1, whose periodogram scatters so."""
    fourth = second = 0.0
    for values in parts:
        power = np.abs(np.fft.rfft(values)) ** 2 / len(values)
        fourth += float(power @ power)
        second += float(power.sum())
    return 0.5 * fourth / second if second > 0.0 else 0.0
