"""Labels and callouts of the scene."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import viser
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.actuator import sentences
from ema_model.faults import FAULTS
from emaviz.scene.solids import BOXES, FAULT, SATIN, Frame, frame

# --- what differs from healthy, said in physical units at its place on the machine ------------------------------------

_LEAST = 0.005  # of a k beyond healthy: a step of its slider
Place = tuple[float, float, float]
PLACES: dict[str, Place] = {
    "k1": (-0.335, -0.05, 0.055),
    "k2": (0.80, -0.02, -0.07),
    "k3": (-0.1, 0.06, 0.235),
    "k4": (-0.25, 0.235, -0.06),
    "k5": (-0.1, -0.235, -0.08),
    "k6": (-0.25, 0.0, 0.125),
    "k7": (-0.25, -0.12, 0.0),
    "k8": (0.44, 0.40, -0.10),
}


@dataclass(frozen=True)
class Callout:
    """One fault, what is to be read of it, and where it sits."""

    fault: str  # k1 … k8
    text: str
    place: Place


def callouts(k: ArrayLike, actuator: Actuator, play_enlarged: float, gap_enlarged: float) -> tuple[Callout, ...]:
    """Of every component of k (8,) that is not healthy; the factors are those by which play and gap are drawn larger.

    The direction of an eccentricity (k7) that is not there is said to do nothing.
    """
    values = np.asarray(k, dtype=float)
    off = {
        fault.name: said
        for fault, value, said in zip(FAULTS, values, sentences(values, actuator))
        if abs(value - fault.healthy) >= _LEAST
    }
    more = {
        "k2": f"shown × {play_enlarged:g}",
        "k6": f"shown × {gap_enlarged:g}",
        "k7": "" if "k6" in off else "(no effect: ζ = 0)",
    }
    return tuple(
        Callout(name, "\n".join(filter(None, (said, more.get(name)))), PLACES[name]) for name, said in off.items()
    )


# --- names and callouts in the picture, laid out so that none covers another where the camera stands at first ---------
# They hang in a scene, which windows may share: they are laid out for the picture that was framed last.

_EM_PX = 12.0  # of viser's labels, at scale 1
_WIDE_EM, _LINE_EM, _PADDING_EM = 0.58, 1.3, 0.5  # of a letter on average, a line, and around the text
_CALLOUT_SCALE = 1.15
_EDGE_PX, _APART_PX = 6.0, 3.0  # from the picture's edge, and between labels
_AROUND = np.radians(np.arange(0.0, 360.0, 22.5))
_AWAY_PX = (10.0, 26.0, 44.0, 64.0, 90.0, 120.0, 160.0, 210.0, 270.0)
_COVERED_PX, _CROSSED_PX = 300.0, 90.0  # what covering the machine, and crossing another label, counts as way
_MOST_COVERED_PX = 200.0  # and from where on a mere name is left out for that
_OWN_PX = 60.0  # and covering a part that is named as a whole
_SCREW = ((0.42, 1.2), (-0.06, 0.06), (-0.24, -0.06))
# what labels had better leave to be seen, and what that counts for those which have their place there
_SOLID = ((BOXES[0], _COVERED_PX), (BOXES[3], _OWN_PX), (BOXES[4], _OWN_PX), (_SCREW, _COVERED_PX))
_LEADER_PX = 9.0  # from where on a line leads to the place
_FIRST_PICTURE = (604, 832)  # px, until a browser tells
_LEAST_NAMED_PX = 400  # high: a smaller picture has room for what is told, but not for the parts' names
_LEAST_TOLD_PX = 220  # high: a smaller one has room for faults alone
_TOP_PX = 20.0  # where windows have their handles


@dataclass(frozen=True)
class Label:
    """A text at a place of the machine; a callout comes first and is in the fault colour's lines."""

    name: str
    text: str
    place: tuple[float, float, float]
    callout: bool = False
    names: str = ""  # of the part that a callout names as well, so that its own label gives way

    def size_px(self) -> NDArray[np.float64]:
        """Width and height (2,), rather too large."""
        lines = self.text.split("\n")
        em = _EM_PX * (_CALLOUT_SCALE if self.callout else 1.0)
        return em * np.array(
            [_WIDE_EM * max(len(line) for line in lines) + _PADDING_EM, _LINE_EM * len(lines) + _PADDING_EM]
        )


@dataclass(frozen=True, eq=False)
class Placed:
    """A label's middle in the picture, px from its upper left, with the place that it belongs to."""

    label: Label
    middle: NDArray[np.float64]  # (2,)
    target: NDArray[np.float64]  # (2,)
    depth: float

    def box(self) -> NDArray[np.float64]:
        """Left, top, right, bottom, px (4,)."""
        half = 0.5 * self.label.size_px()
        return np.concatenate([self.middle - half, self.middle + half])


def lay_out(labels: Sequence[Label], shown: Frame, picture: tuple[int, int]) -> list[Placed]:
    """Each label near its place, callouts first, the large before the small.

    One that finds no room is left out, and a mere name that would hide the machine, too.
    picture: width and height in px.
    """
    if not labels:
        return []
    size = np.array(picture, dtype=float)
    seen = shown.seen([label.place for label in labels])
    targets = (seen[:, :2] * (1.0, -1.0) + 1.0) * 0.5 * size
    machine = _machine(shown, size)
    placed: list[Placed] = []
    directions = np.column_stack([np.cos(_AROUND), np.sin(_AROUND)])
    for i in sorted(range(len(labels)), key=lambda i: (not labels[i].callout, -labels[i].size_px().prod())):
        half = 0.5 * labels[i].size_px()
        middles = np.concatenate([targets[i] + directions * (half + away) for away in _AWAY_PX])
        cost = np.repeat(_AWAY_PX, len(directions))
        low, high = middles - half, middles + half
        free = (low >= (_EDGE_PX, _TOP_PX)).all(axis=1) & (high <= size - _EDGE_PX).all(axis=1)
        for one in placed:
            box = one.box()
            free &= ((high < box[:2] - _APART_PX) | (low > box[2:] + _APART_PX)).any(axis=1)
            cost = cost + _CROSSED_PX * _crosses(targets[i], middles, box)
            cost = cost + _CROSSED_PX * _crossed(one, low, high)
        others = np.delete(targets, i, axis=0)[:, None]
        hides = ((others > low - _APART_PX) & (others < high + _APART_PX)).all(axis=2).sum(axis=0)
        covered = _covered(labels[i], low, high, machine)
        if not labels[i].callout:
            free &= covered < _MOST_COVERED_PX
        if free.any():
            best = int(np.argmin(np.where(free, cost + 30.0 * hides + covered, np.inf)))
            placed.append(Placed(labels[i], middles[best], targets[i], float(seen[i, 2])))
    return placed


def _machine(shown: Frame, size: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Boxes in the picture that the machine's parts fill, px (4,)."""
    boxes = []
    for box, _ in _SOLID:
        corners = (shown.seen(list(product(*box)))[:, :2] * (1.0, -1.0) + 1.0) * 0.5 * size
        boxes.append(np.concatenate([corners.min(axis=0), corners.max(axis=0)]))
    return boxes


def _covered(
    label: Label, low: NDArray[np.float64], high: NDArray[np.float64], boxes: list[NDArray[np.float64]]
) -> NDArray[np.float64]:
    """What each rectangle covers of the machine, as way."""
    area = np.prod(high - low, axis=1)
    ways = [
        (own if _within(label.place, solid) else _COVERED_PX)
        * np.prod(np.clip(np.minimum(high, box[2:]) - np.maximum(low, box[:2]), 0.0, None), axis=1)
        / area
        for box, (solid, own) in zip(boxes, _SOLID)
    ]
    return np.max(ways, axis=0)


def _within(place: tuple[float, float, float], box: tuple[tuple[float, float], ...]) -> bool:
    return all(low <= one <= high for one, (low, high) in zip(place, box))


_ALONG = np.linspace(0.1, 0.9, 7)[:, None]


def _crosses(start: NDArray[np.float64], ends: NDArray[np.float64], box: NDArray[np.float64]) -> Any:
    """Whether the line to each end runs through a rectangle."""
    points = start + _ALONG[:, None] * (ends - start)
    return np.any(np.all((points > box[:2]) & (points < box[2:]), axis=2), axis=0)


def _crossed(one: Placed, low: NDArray[np.float64], high: NDArray[np.float64]) -> Any:
    """Whether each rectangle would lie on the line of a label that is there."""
    points = (one.target + _ALONG * (one.middle - one.target))[:, None]
    return np.any(np.all((points > low) & (points < high), axis=2), axis=0)


class Labels:
    """The labels of the scene; what is not changed is not sent."""

    def __init__(self, scene: viser.SceneApi, root: str, names: Sequence[Label]) -> None:
        self._scene, self._root = scene, root
        self._names = list(names)
        self._told: list[Label] = []
        self._callouts: list[Label] = []
        self._handles: dict[str, Any] = {}
        self._lines: dict[str, Any] = {}
        self._sent: dict[str, tuple[object, ...]] = {}
        self._frame = frame(_FIRST_PICTURE[0] / _FIRST_PICTURE[1])
        self._picture = _FIRST_PICTURE
        self._shown = True
        self._laid_out: tuple[object, list[Placed]] = ((), [])
        self._arranging = threading.Lock()
        self._arrange()

    def show(self, shown: bool) -> None:
        """All of them, or none."""
        self._shown = shown
        self._arrange()

    def tell(self, callouts: Sequence[Label], told: Sequence[Label]) -> None:
        """What is said besides the names of the parts."""
        callouts, told = list(callouts), list(told)
        if (callouts, told) != (self._callouts, self._told):
            self._callouts, self._told = callouts, told
            self._arrange()

    def fit(self, shown: Frame, picture: tuple[int, int]) -> None:
        """Lays them out anew for another picture."""
        self._frame, self._picture = shown, picture
        self._arrange()

    def _arrange(self) -> None:
        with self._arranging:
            height = self._picture[1]
            names = self._names if height >= _LEAST_NAMED_PX else []
            named = {one.names for one in self._callouts}
            names = [one for one in names if one.name not in named]
            told = [] if self._callouts and height < _LEAST_TOLD_PX else self._told
            labels = [*self._callouts, *told, *names] if self._shown else []
            placed = self._lay_out(labels)
            for name in self._handles.keys() - {one.label.name for one in placed}:
                self._put(name, "", (0.0, 0.0, 0.0), False, visible=False)
            for one in placed:
                right, back, up = (float(part) for part in self._at(one))
                self._put(one.label.name, one.label.text, (right, back, up), one.label.callout, visible=True)
            for callout, colour, thickness in ((True, FAULT, 2.0), (False, SATIN, 1.0)):
                self._lead([one for one in placed if one.label.callout == callout], colour, thickness)

    def _at(self, one: Placed) -> NDArray[np.float64]:
        """Where in the scene its middle is seen (3,)."""
        x, y = 2.0 * one.middle / self._picture - 1.0
        return self._frame.at(x, -y, one.depth)

    def _lay_out(self, labels: list[Label]) -> list[Placed]:
        """Only where their sizes have changed: a slider that is dragged mostly changes digits."""
        sizes = tuple((one.name, one.place, tuple(one.size_px())) for one in labels)
        asked = sizes, self._frame.position, self._picture
        if asked != self._laid_out[0]:
            self._laid_out = asked, lay_out(labels, self._frame, self._picture)
        now = {one.name: one for one in labels}
        return [replace(one, label=now[one.label.name]) for one in self._laid_out[1]]

    def _put(self, name: str, text: str, at: tuple[float, float, float], callout: bool, visible: bool) -> None:
        sent = (text, at) if visible else ()
        if self._sent.get(name) == sent:
            return
        before, self._sent[name] = self._sent.get(name, ()), sent
        handle = self._handles.get(name)
        if handle is None:
            self._handles[name] = self._scene.add_label(
                f"{self._root}/{name}",
                text,
                position=at,
                font_screen_scale=_CALLOUT_SCALE if callout else 1.0,
                anchor="center-center",
            )
            return
        if visible:
            if handle.text != text:
                handle.text = text
            handle.position = at
        if bool(before) != visible:
            handle.visible = visible

    def _lead(self, placed: list[Placed], colour: tuple[int, int, int], thickness: float) -> None:
        """Lines from labels to their places, where these are not close by.

        They end below the middle of a label: however somebody turns the actuator, its text stays at its line.
        """
        name = f"{self._root}/lines_{thickness:g}"
        points = []
        for one in placed:
            box = one.box()
            edge = np.clip(one.target, box[:2], box[2:])
            if np.hypot(*(edge - one.target)) >= _LEADER_PX or one.label.callout:
                points.append([self._at(one), one.label.place])
        lines = np.array(points, np.float32).reshape(-1, 2, 3)
        if self._sent.get(name, (b"",)) == (lines.tobytes(),):
            return
        self._sent[name] = (lines.tobytes(),)
        handle = self._lines.get(name)
        if not len(lines):
            if handle is not None:
                handle.remove()
            self._lines[name] = None
            return
        if handle is None:
            self._lines[name] = self._scene.add_line_segments(
                name, points=lines, colors=colour, thickness=thickness, thickness_units="screen"
            )
            return
        if lines.shape != handle.points.shape:  # a new line would be drawn later than its label moves
            handle.colors = np.broadcast_to(np.array(colour, np.uint8), lines.shape)
        handle.points = lines
