"""The machine's shape: where the camera stands so that all of it fills the picture, and its meshes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
import viser
from numpy.typing import ArrayLike, NDArray

from emaviz import colours

# --- where the camera stands: the whole machine, as large as the picture lets it be, whatever the picture's shape -----

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


# --- a solid in the scene: the one place that says how the actuator's parts are drawn ---------------------------------


def add_mesh(
    scene: viser.SceneApi,
    name: str,
    solid: Solid,
    colour: Colour,
    *,
    flat: bool = False,
    opacity: float | None = None,
    position: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> viser.MeshHandle:
    """Without shadows, which cost software GL most; flat: its edges are seen."""
    return scene.add_mesh_simple(
        name,
        solid.vertices,
        solid.faces,
        color=colour,
        flat_shading=flat,
        opacity=opacity,
        position=position,
        cast_shadow=False,
        receive_shadow=False,
    )


# --- colours of the actuator ------------------------------------------------------------------------------------------
# Colours of the actuator: greys, phases in subdued tones, one colour for what is broken, another for an error.

Colour = tuple[int, int, int]


def between(one: Colour, other: Colour, share: float) -> Colour:
    """From one colour at share 0 to the other at 1."""
    red, green, blue = (round(a + (b - a) * share) for a, b in zip(one, other))
    return red, green, blue


GLASS: Colour = (150, 160, 176)  # the housing
LIGHT: Colour = (212, 216, 222)
STEEL: Colour = (172, 177, 186)
SATIN: Colour = (140, 146, 156)
IRON: Colour = (104, 109, 119)
DARK: Colour = (76, 81, 91)
WHITE: Colour = (255, 255, 255)
FAULT = colours.rgb(colours.FAULT)
RESIDUAL = colours.rgb(colours.DIFFERENCE)
PHASES = tuple(colours.rgb(one) for one in colours.PHASES)
AT_REST = tuple(between(between(one, IRON, 0.5), DARK, 0.35) for one in PHASES)  # a phase without current


# --- solids of few triangles, as arrays of vertices (n, 3) and faces (m, 3) -------------------------------------------
# The actuator's axis is x; an azimuth is counted about it from +y towards +z, as a positive turn goes. Each face of a
# solid has vertices of its own, so that edges stay sharp and round sides look round; and every triangle winds so that
# it is seen from outside, which spares the browser the drawing of insides.

TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class Solid:
    """Vertices and the faces between them."""

    vertices: NDArray[np.float32]  # (n, 3)
    faces: NDArray[np.uint32]  # (m, 3)

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Solid:
        """Shifted."""
        return Solid(self.vertices + np.array([x, y, z], np.float32), self.faces)

    def turned(self, azimuth_rad: float) -> Solid:
        """Turned about x."""
        c, s = np.cos(azimuth_rad), np.sin(azimuth_rad)
        turn = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]], np.float32)
        return Solid(self.vertices @ turn.T, self.faces)

    def across(self) -> Solid:
        """With its axis along y instead of x."""
        return Solid(self.vertices[:, [1, 0, 2]] * np.array([-1.0, 1.0, 1.0], np.float32), self.faces)


def joined(*parts: Solid) -> Solid:
    """Several solids as one."""
    offsets = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    faces = [part.faces + np.uint32(offset) for part, offset in zip(parts, offsets)]
    return Solid(np.concatenate([part.vertices for part in parts]), np.concatenate(faces))


def block(length_x: float, length_y: float, length_z: float) -> Solid:
    """A box about the origin."""
    cube = _cube()
    return Solid((cube.vertices * np.array([length_x, length_y, length_z])).astype(np.float32), cube.faces)


@cache
def _cube() -> Solid:
    """Of edges of 1: a scene has hundreds of boxes."""
    sides = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            corners = np.zeros((4, 3))
            corners[:, axis] = sign
            corners[:, (axis + 1) % 3] = np.array([-1.0, 1.0, 1.0, -1.0])
            corners[:, (axis + 2) % 3] = np.array([-1.0, -1.0, 1.0, 1.0]) * sign
            sides.append(_facing(_solid(0.5 * corners, [[0, 1, 2], [0, 2, 3]]), sign * np.eye(3)[axis]))
    return joined(*sides)


def revolved(profile: ArrayLike, start_rad: float = 0.0, stop_rad: float = TURN, segments: int = 32) -> Solid:
    """A convex profile of points (x, r), in order around it, turned about x; cut faces where it does not close."""
    points = np.asarray(profile, dtype=float)
    whole = abs(stop_rad - start_rad - TURN) < 1e-9
    x, r = points.T
    around = np.sign(np.sum(x * np.roll(r, -1) - np.roll(x, -1) * r))  # 1 if it runs counter-clockwise
    count = max(2, round(segments * (stop_rad - start_rad) / TURN))
    azimuth = np.linspace(start_rad, stop_rad, count + 1)
    parts = []
    for (x0, r0), (x1, r1) in zip(points, np.roll(points, -1, axis=0)):
        if max(r0, r1) > 1e-9:
            rings = [np.stack([np.full_like(azimuth, x), r * np.cos(azimuth), r * np.sin(azimuth)], 1)
                     for x, r in ((x0, r0), (x1, r1))]  # fmt: skip
            i = np.arange(count)
            faces = np.concatenate([np.stack([i, i + 1, i + count + 1], 1),
                                    np.stack([i + 1, i + count + 2, i + count + 1], 1)])  # fmt: skip
            outward = around * np.array([r1 - r0, x0 - x1])
            middle = 0.5 * (azimuth[0] + azimuth[1])
            direction = np.array([outward[0], outward[1] * np.cos(middle), outward[1] * np.sin(middle)])
            parts.append(_facing(_solid(np.concatenate(rings), faces), direction))
    if not whole:
        for sign, angle in ((-1.0, start_rad), (1.0, stop_rad)):
            x, r = points.T
            cut = _fan(np.stack([x, r * np.cos(angle), r * np.sin(angle)], 1))
            parts.append(_facing(cut, sign * np.array([0.0, -np.sin(angle), np.cos(angle)])))
    return joined(*parts)


def tube(x0: float, x1: float, inner: float, outer: float, start_rad: float = 0.0, stop_rad: float = TURN) -> Solid:
    """A pipe along x, or with inner 0 a disc."""
    return revolved([(x0, inner), (x1, inner), (x1, outer), (x0, outer)], start_rad, stop_rad)


def extruded(outline_yz: ArrayLike, x0: float, x1: float) -> Solid:
    """A flat outline (n, 2), star-shaped about the mean of its points, drawn out along x."""
    outline = np.asarray(outline_yz, dtype=float)
    y, z = outline.T
    turning = np.sign(np.sum(y * np.roll(z, -1) - np.roll(y, -1) * z))
    ends = [np.column_stack([np.full(len(outline), x), outline]) for x in (x0, x1)]
    sides = []
    for i in range(len(outline)):
        j = (i + 1) % len(outline)
        side = _solid(np.array([ends[0][i], ends[0][j], ends[1][j], ends[1][i]]), [[0, 1, 2], [0, 2, 3]])
        along = outline[j] - outline[i]
        sides.append(_facing(side, turning * np.array([0.0, along[1], -along[0]])))
    low, high = (_fan(end) for end in ends)
    return joined(*sides, _facing(low, np.array([x0 - x1, 0.0, 0.0])), _facing(high, np.array([x1 - x0, 0.0, 0.0])))


def gear_wheel(teeth: int, radius: float, x0: float, x1: float) -> Solid:
    """A toothed wheel, its pitch circle at `radius`."""
    height = 0.9 * radius * TURN / teeth / 2.0
    outline = []
    for tooth in range(teeth):
        for share, above in ((0.0, -0.5), (0.25, -0.5), (0.38, 0.5), (0.62, 0.5), (0.75, -0.5)):
            angle = TURN * (tooth + share) / teeth
            r = radius + above * height
            outline.append((r * np.cos(angle), r * np.sin(angle)))
    return extruded(outline, x0, x1)


def thread(x0: float, x1: float, radius: float, pitch: float, wire: float) -> Solid:
    """A helical ridge on a screw."""
    turns = (x1 - x0) / pitch
    count = int(12 * turns)
    angle = np.linspace(0.0, TURN * turns, count + 1)
    centre = np.linspace(x0, x1, count + 1)
    rails = [
        np.stack([centre + dx, (radius + dr) * np.cos(angle), (radius + dr) * np.sin(angle)], 1)
        for dx, dr in ((-0.5 * wire, 0.0), (0.0, wire), (0.5 * wire, 0.0))
    ]
    i = np.arange(count)
    parts = []
    for one, other in (rails[:2], rails[1:]):
        faces = np.concatenate([np.stack([i, i + 1, i + count + 1], 1),
                                np.stack([i + 1, i + count + 2, i + count + 1], 1)])  # fmt: skip
        first = 0.5 * (angle[0] + angle[1])
        parts.append(_facing(_solid(np.concatenate([one, other]), faces), np.array([0, np.cos(first), np.sin(first)])))
    return joined(*parts)


def ball(radius: float) -> Solid:
    """A sphere about the origin."""
    angle = np.linspace(0.0, np.pi, 5)
    return revolved(np.column_stack([-radius * np.cos(angle), radius * np.sin(angle)]), segments=8)


def about_x(angle_rad: float) -> tuple[float, float, float, float]:
    """The quaternion (w, x, y, z) of a turn about x."""
    return float(np.cos(0.5 * angle_rad)), float(np.sin(0.5 * angle_rad)), 0.0, 0.0


def about_y(angle_rad: float) -> tuple[float, float, float, float]:
    """The quaternion (w, x, y, z) of a turn about y."""
    return float(np.cos(0.5 * angle_rad)), 0.0, float(np.sin(0.5 * angle_rad)), 0.0


def _fan(points: NDArray[np.float64]) -> Solid:
    """A flat face between points in order."""
    n = len(points)
    i = np.arange(n)
    centre = points.mean(axis=0, keepdims=True)
    return _solid(np.concatenate([points, centre]), np.stack([i, (i + 1) % n, np.full(n, n)], 1))


def _facing(face: Solid, outward: NDArray[np.float64]) -> Solid:
    """A face whose triangles all wind alike, turned so that its first one looks outward."""
    a, b, c = (face.vertices[face.faces[0, i]].astype(float) for i in range(3))
    if np.cross(b - a, c - a) @ outward >= 0.0:
        return face
    return Solid(face.vertices, face.faces[:, ::-1].copy())


def _solid(vertices: ArrayLike, faces: Sequence[Sequence[int]] | NDArray[np.intp]) -> Solid:
    """Without the empty triangles that arise at a pole."""
    points, corners = np.asarray(vertices, dtype=float), np.asarray(faces)
    a, b, c = (points[corners[:, i]] for i in range(3))
    full = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-12
    return Solid(points.astype(np.float32), corners[full].astype(np.uint32))
