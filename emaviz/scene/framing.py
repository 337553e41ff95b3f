"""Where the camera stands: the whole machine, as large as the picture lets it be, whatever the picture's shape."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

FIELD_RAD = 0.6  # of the camera, upwards
# What is framed as boxes, x, y and z from – to: housing, shaft, base plate, surface up and down, drive and its cable.
BOXES = (
    ((-0.345, 0.345), (-0.31, 0.31), (-0.31, 0.31)),
    ((-0.42, -0.34), (-0.04, 0.04), (-0.04, 0.04)),
    ((-0.35, 1.63), (-0.17, 0.17), (-0.37, -0.34)),
    ((1.30, 1.88), (-0.34, 0.34), (-0.02, 0.44)),
    ((0.44, 0.86), (0.36, 0.60), (-0.37, 0.06)),
)
_CORNERS = np.array([corner for box in BOXES for corner in product(*box)])
_MARGIN_X, _MARGIN_Y = 0.05, 0.09  # of the picture, on either side; labels stand above and below
# The narrower the picture, the more the machine is seen along its axis and from above: so it fills an upright picture.
_ASPECTS, _AZIMUTHS_DEG, _ELEVATIONS_DEG = (0.4, 0.75, 1.5), (16.0, 28.0, 45.0), (42.0, 34.0, 25.0)


@dataclass(frozen=True, eq=False)
class Frame:
    """A camera's place and what it looks at."""

    position: tuple[float, float, float]
    look_at: tuple[float, float, float]
    aspect: float  # width over height of its picture

    def axes(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Unit vectors to the right, up and away from the camera."""
        return _axes(np.subtract(self.look_at, self.position))

    def seen(self, points: ArrayLike) -> NDArray[np.float64]:
        """Points (n, 3) in the picture, (n, 3): −1 … 1 from left to right, −1 … 1 upwards, and the depth."""
        from_camera = np.atleast_2d(np.asarray(points, dtype=float)) - self.position
        x, y, depth = (from_camera @ axis for axis in self.axes())
        up = np.tan(0.5 * FIELD_RAD)
        return np.column_stack([x / (depth * up * self.aspect), y / (depth * up), depth])

    def at(self, x: float, y: float, depth: float) -> NDArray[np.float64]:
        """The point (3,) that is seen there: the inverse of `seen`."""
        right, upwards, away = self.axes()
        up = np.tan(0.5 * FIELD_RAD) * depth
        return np.asarray(self.position) + x * up * self.aspect * right + y * up * upwards + depth * away


def frame(aspect: float) -> Frame:
    """The nearest place from which a picture of this aspect shows every corner of `BOXES` within its margins."""
    aspect = min(max(aspect, 0.2), 5.0)
    azimuth, elevation = (
        np.radians(np.interp(aspect, _ASPECTS, angles)) for angles in (_AZIMUTHS_DEG, _ELEVATIONS_DEG)
    )
    level = np.cos(elevation)
    away = -np.array([-np.cos(azimuth) * level, -np.sin(azimuth) * level, np.sin(elevation)])
    right, up, away = _axes(away)
    x, y, z = (_CORNERS @ axis for axis in (right, up, away))
    half_y = np.tan(0.5 * FIELD_RAD)
    half_x = half_y * aspect * (1.0 - 2.0 * _MARGIN_X)
    half_y *= 1.0 - 2.0 * _MARGIN_Y
    # A camera at (a, b, c) of these axes has x − a within ± half_x · (z − c): the smallest c that leaves room for an a.
    left, low = (x + half_x * z).min(), (y + half_y * z).min()
    rightmost, top = (x - half_x * z).max(), (y - half_y * z).max()
    back = min((left - rightmost) / (2.0 * half_x), (low - top) / (2.0 * half_y))
    across, over = 0.5 * (left + rightmost), 0.5 * (low + top)
    for _ in range(4):  # to the middle of what is seen, where there is room to move
        across += _middle((x - across) / (z - back)) * (z.mean() - back)
        over += _middle((y - over) / (z - back)) * (z.mean() - back)
    camera = across * right + over * up + back * away
    target = camera + (z.mean() - back) * away
    return Frame(_triple(camera), _triple(target), aspect)


def _middle(values: NDArray[np.float64]) -> float:
    return 0.5 * float(values.min() + values.max())


def _axes(away: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    ahead = np.asarray(away, dtype=float) / np.linalg.norm(away)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return right, np.cross(right, ahead), ahead


def _triple(point: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(point[0]), float(point[1]), float(point[2])
