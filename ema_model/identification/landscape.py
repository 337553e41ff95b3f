"""The cost over two k around an answer, the six others held there, and the ways from where searches ended."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.errors import InputError

Array = NDArray[np.floating]
Cost = Callable[[Array], Array]  # k (n, 8) → (n,), A: of an answer its corrected error

POINTS = 41  # along each axis
_ROWS = 2  # simulated at once: about two iterations of a usual search
_WAY_POINTS = 33
_CLOSE = 0.04  # least half width of a close-up
_WIDER = 3.0  # a close-up is so many intervals wide
_RISE = 1.01  # of the error along a way, above which it leads over a ridge
_WORSE = 1.05  # than the answer, above which a search has ended elsewhere


@dataclass(frozen=True, eq=False)
class Landscape:
    """A slice; rows that are not simulated yet, and models that diverge, are NaN."""

    x: int  # number of the k across, 0 … 7
    y: int  # and upwards
    through: Array  # (8,), what the others are held at
    across: Array  # (POINTS,), values of k x
    upwards: Array  # (POINTS,)
    error_A: Array  # (upwards, across)
    rows: int  # done

    @property
    def share(self) -> float:
        """Of the rows that are done."""
        return self.rows / len(self.upwards)


@dataclass(frozen=True)
class Way:
    """From where a search ended straight to the answer."""

    error_A: float  # where it ended
    highest_A: float  # on the way
    answer_A: float  # at the answer

    @property
    def is_trap(self) -> bool:
        """A worse place, and a ridge before the answer."""
        return self.is_worse and self.highest_A > _RISE * self.error_A

    @property
    def is_worse(self) -> bool:
        """Than the answer."""
        return self.error_A > _WORSE * self.answer_A


def extent(through: Array, k: int, interval90: Array | None = None, close: bool = False) -> tuple[float, float]:
    """From and to along one k: all of 0 … 1, or close to the answer, a few of its 90 % intervals wide."""
    if not close:
        return 0.0, 1.0
    width = 0.0 if interval90 is None else float(np.ptp(interval90[k]))
    half = min(max(_CLOSE, _WIDER * width), 0.5)
    low = min(max(float(through[k]) - half, 0.0), 1.0 - 2.0 * half)
    return low, low + 2.0 * half


def slices(
    cost: Cost,
    through: Array,
    x: int,
    y: int,
    across: tuple[float, float] = (0.0, 1.0),
    upwards: tuple[float, float] = (0.0, 1.0),
    points: int = POINTS,
) -> Generator[Landscape, None, None]:
    """The slice as it grows, a few rows of one population each time; on the compute thread.

    Raises InputError unless x and y are two different k of 0 … 7.
    """
    if x == y or not {x, y} <= set(range(8)):
        raise InputError("a landscape needs two different k; choose another for one axis")
    xs, ys = np.linspace(*across, points), np.linspace(*upwards, points)
    error = np.full((points, points), np.nan)
    for first in range(0, points, _ROWS):
        some = ys[first : first + _ROWS]
        k = np.tile(np.asarray(through, dtype=float), (len(some) * points, 1))
        k[:, x], k[:, y] = np.tile(xs, len(some)), np.repeat(some, points)
        found = cost(k).reshape(len(some), points)
        error[first : first + len(some)] = np.where(np.isfinite(found), found, np.nan)
        yield Landscape(x, y, np.array(through), xs, ys, error.copy(), first + len(some))


def ways(cost: Cost, ends: Mapping[str, Array], answer: Array) -> dict[str, Way]:
    """The straight ways from the searches' ends (8,) to the answer (8,), by the searches' names; k7 is an angle."""
    share = np.linspace(0.0, 1.0, _WAY_POINTS)[:, None]
    found = {}
    for name, end in ends.items():
        step = np.asarray(answer, dtype=float) - end
        step[6] -= np.round(step[6])
        k = end + share * step
        k[:, 6] %= 1.0
        k[0], k[-1] = end, answer
        error = cost(k)
        found[name] = Way(float(error[0]), float(np.max(error)), float(error[-1]))
    return found
