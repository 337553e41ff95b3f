"""The actuator in 3D: motor, drive, train, load."""

from __future__ import annotations

import threading
from collections.abc import Sequence, Set
from typing import Any

import numpy as np
import viser
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.quantities import amount
from emaviz.scene.labels import Callout, Label, Labels
from emaviz.scene.solids import (
    AT_REST,
    DARK,
    FAULT,
    FIELD_RAD,
    GLASS,
    IRON,
    LIGHT,
    PHASES,
    RESIDUAL,
    SATIN,
    STEEL,
    TURN,
    WHITE,
    Colour,
    Frame,
    Solid,
    about_x,
    about_y,
    add_mesh,
    ball,
    between,
    block,
    extruded,
    frame,
    gear_wheel,
    joined,
    revolved,
    thread,
    tube,
)

# --- the load on the control surface as an arrow: its length follows the torque, its side the direction ---------------

_LONGEST = 0.26
_HEAD, _SHAFT_RADIUS, _HEAD_RADIUS = 0.09, 0.013, 0.036
_AT = (0.34, 0.0, 0.012)  # on the surface, from its hinge
_LEAST = 1e-3  # share of the longest, below which there is no load to show


class LoadArrow:
    """Rides on the surface, so that it is sent anew only where the load changes."""

    def __init__(self, scene: viser.SceneApi, root: str) -> None:
        head = revolved([(0.0, 0.0), (_HEAD, 0.0), (_HEAD, _HEAD_RADIUS)], segments=16)
        shaft = revolved([(0.0, 0.0), (1.0, 0.0), (1.0, _SHAFT_RADIUS), (0.0, _SHAFT_RADIUS)], segments=12)
        self._frame = scene.add_frame(f"{root}/load", show_axes=False, position=_AT, visible=False)
        add_mesh(scene, f"{root}/load/head", head, DARK)
        self._shaft = add_mesh(scene, f"{root}/load/shaft", shaft, DARK, position=(_HEAD, 0.0, 0.0))
        self._share = 0.0

    def show(self, share: float) -> None:
        """A load of that share −1 … 1 of the longest arrow; a positive one presses the surface down."""
        share = round(min(max(share, -1.0), 1.0), 2) if abs(share) >= _LEAST else 0.0
        if share == self._share:
            return
        self._share = share
        self._frame.visible = share != 0.0
        if share != 0.0:
            up = share > 0.0  # the arrow's own axis, from its tip to its tail, along z or against it
            half = 0.5**0.5
            self._frame.wxyz = (half, 0.0, -half if up else half, 0.0)
            self._frame.position = (_AT[0], _AT[1], _AT[2] if up else -_AT[2])
            self._shaft.scale = (max(abs(share) * _LONGEST, 0.01), 1.0, 1.0)


# --- controller and inverter in 3D: a box beside the machine, its cable to the motor, and what is set in it -----------

_MIDDLE = (0.65, 0.48, -0.165)
_SIZE = (0.40, 0.20, 0.40)
_CABLE = (
    (0.445, 0.48, -0.27),
    (0.36, 0.48, -0.335),
    (0.24, 0.44, -0.352),
    (0.16, 0.40, -0.335),
    (0.14, 0.30, -0.2),
)
_CABLE_RADIUS = 0.014
NAMED_AT = (0.65, 0.48, 0.04)  # the middle of its top


class DriveBox:
    """Static, but for the front, which is in the fault colour where the gain (k8) is not healthy."""

    def __init__(self, scene: viser.SceneApi, root: str) -> None:
        add_mesh(scene, f"{root}/case", _case(), IRON, flat=True)
        add_mesh(scene, f"{root}/cable", _tube(_CABLE, _CABLE_RADIUS), DARK, flat=True)
        add_mesh(scene, f"{root}/sockets", _sockets(), SATIN, flat=True)
        self._front = add_mesh(scene, f"{root}/front", _front(), LIGHT, flat=True)

    def mark(self, faults: Set[str]) -> None:
        """Shows the place of the gain (k8) in the fault colour."""
        self._front.color = FAULT if "k8" in faults else LIGHT


def said(actuator: Actuator) -> str:
    """Name, bus voltage and delay, as far as the actuator has them: 'controller and inverter\\n48 V bus'."""
    bus, delay = actuator.inverter.bus_voltage_V, actuator.effects.get("computation_delay", {}).get("delay_s", 0.0)
    parts = [f"{bus:.4g} V bus"] if bus > 0.0 else []
    parts += [f"delay {amount(delay, 's')}"] if delay > 0.0 else []
    return "\n".join(filter(None, ("controller and inverter", ", ".join(parts))))


def _case() -> Solid:
    x, y, z = _MIDDLE
    length, depth, height = _SIZE
    fins = [
        block(0.012, depth - 0.02, 0.022).moved(x + offset, y, z + 0.5 * height + 0.01)
        for offset in np.linspace(-0.46, 0.46, 9) * length
    ]
    return joined(block(length, depth, height).moved(x, y, z), *fins)


def _front() -> Solid:
    """Plates on the two sides that one sees: towards the motor's end, and towards the machine."""
    x, y, z = _MIDDLE
    length, depth, height = _SIZE
    return joined(
        block(0.008, 0.75 * depth, 0.5 * height).moved(x - 0.5 * length - 0.002, y, z + 0.16 * height),
        block(0.8 * length, 0.008, 0.5 * height).moved(x, y - 0.5 * depth - 0.002, z + 0.16 * height),
    )


def _sockets() -> Solid:
    x0, y0, z0 = _CABLE[0]
    x1, y1, z1 = _CABLE[-1]
    return joined(block(0.03, 0.05, 0.05).moved(x0, y0, z0), block(0.08, 0.07, 0.09).moved(x1, y1, z1 + 0.01))


def _tube(line: ArrayLike, radius: float, around: int = 6) -> Solid:
    """A round cable along points (n, 3)."""
    points = np.asarray(line, dtype=float)
    along = np.gradient(points, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(along, [1.0, 0.3, 0.2])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(along, side)
    angle = TURN * np.arange(around) / around
    rings = points[:, None] + radius * (
        np.cos(angle)[:, None] * side[:, None] + np.sin(angle)[:, None] * other[:, None]
    )
    ring, step = np.meshgrid(np.arange(len(points) - 1), np.arange(around), indexing="ij")
    a, b = ring * around + step, ring * around + (step + 1) % around
    faces = np.concatenate([np.stack([a, b, a + around], -1), np.stack([b, b + around, a + around], -1)]).reshape(-1, 3)
    return Solid(rings.reshape(-1, 3).astype(np.float32), faces.astype(np.uint32))


# --- from the rotor to the user in 3D ---------------------------------------------------------------------------------
# From the rotor to the user in 3D: a gear pair, the ball screw and its nut, the rod, the horn and the surface.

ARM = 0.2  # of the horn: what the nut's travel is to the surface's turn
_SCREW_Z = -0.165
_NUT_X = 0.80
_PIN_Z = 0.075  # the rod's pin above the screw's axis
_HINGE = np.array([1.34, 0.0, 0.11])
_PINION, _WHEEL = 14, 28


class Drivetrain:
    """Built once; afterwards only frames move and the screw's colour changes."""

    def __init__(self, scene: viser.SceneApi, root: str) -> None:
        def add(name: str, solid: Solid, colour: Colour, flat: bool = False) -> Any:
            return add_mesh(scene, f"{root}/{name}", solid, colour, flat=flat)

        def frame(name: str, position: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Any:
            return scene.add_frame(f"{root}/{name}", show_axes=False, position=position)

        self._pinion = frame("pinion")
        add("pinion/wheel", gear_wheel(_PINION, 0.055, 0.42, 0.50), SATIN, flat=True)
        self._screw = frame("screw", (0.0, 0.0, _SCREW_Z))
        add("screw/wheel", gear_wheel(_WHEEL, 0.110, 0.42, 0.50), IRON, flat=True)
        self._rod_of_screw = add(
            "screw/thread", joined(tube(0.40, 1.16, 0.0, 0.026), thread(0.54, 1.12, 0.026, 0.029, 0.012)), STEEL
        )
        add("rails", _rails(), DARK)
        self._nut = frame("nut", (_NUT_X, 0.0, _SCREW_Z))
        add("nut/body", joined(tube(-0.055, 0.055, 0.03, 0.055), tube(-0.02, 0.02, 0.055, 0.068)), SATIN)
        self._jaws = [frame(f"nut/jaw_{side}") for side in ("low", "high")]
        self._blocks: list[Any] = []
        for side, jaw in zip(("low", "high"), self._jaws):
            sign = -1.0 if side == "low" else 1.0
            one = block(0.02, 0.07, 0.06).moved(x=sign * 0.03, z=_PIN_Z)
            self._blocks.append(add(f"nut/jaw_{side}/block", one, SATIN, flat=True))
            jaw.position = (0.0, 0.0, 0.0)
        self._rod = frame("rod")
        self._length = 0.0
        _, rod = _rod_of(0.0)
        self._length = float(np.hypot(*rod))
        shaft = joined(
            tube(0.0, self._length, 0.0, 0.013),
            tube(-0.03, 0.03, 0.0, 0.019).across(),
            tube(-0.03, 0.03, 0.0, 0.019).across().moved(x=self._length),
        )
        add("rod/shaft", shaft, STEEL)
        add("bracket", _bracket(), DARK)
        self._surface = frame("surface", (float(_HINGE[0]), 0.0, float(_HINGE[2])))
        add("surface/horn", _horn(), STEEL, flat=True)
        add("surface/flap", _flap(), LIGHT, flat=True)
        self._heat = -1.0

    def move(self, motor_rad: float, surface_rad: float, play: float) -> None:
        """motor_rad: of the pinion; surface_rad: of the user, as drawn; play: of the nut before the pin, a length."""
        self._pinion.wxyz = about_x(motor_rad)
        # Half a tooth apart, so that the two wheels mesh.
        self._screw.wxyz = about_x(-motor_rad * _PINION / _WHEEL + np.pi / _WHEEL)
        pin, rod = _rod_of(surface_rad)
        self._rod.position = (float(pin[0]), 0.0, float(pin[1]))
        self._rod.wxyz = about_y(-float(np.arctan2(rod[1], rod[0])))
        self._nut.position = (float(pin[0]) + play, 0.0, _SCREW_Z)
        self._surface.wxyz = about_y(-surface_rad)

    def set_play(self, width: float) -> None:
        """The pin's room between the nut's jaws, a length."""
        for sign, jaw in zip((-1.0, 1.0), self._jaws):
            jaw.position = (0.5 * sign * width, 0.0, 0.0)

    def mark(self, faults: Set[str]) -> None:
        """Shows the place of backlash (k2), where the nut meets the pin, in the fault colour."""
        for one in self._blocks:
            one.color = FAULT if "k2" in faults else SATIN

    def heat(self, share: float) -> None:
        """Colour of the screw, from cold 0 to glowing 1, the residual's."""
        share = round(min(max(share, 0.0), 1.0), 2)
        if share != self._heat:
            self._heat = share
            self._rod_of_screw.color = between(STEEL, RESIDUAL, share)


def _rod_of(surface_rad: float) -> tuple[np.ndarray, np.ndarray]:
    """The pin's place and the rod from it to the horn's tip, both (x, z): the pin slides at a fixed height."""
    tip = _HINGE[[0, 2]] + ARM * np.array([np.sin(surface_rad), -np.cos(surface_rad)])
    height = _SCREW_Z + _PIN_Z
    length = float(np.hypot(_HINGE[0] - _NUT_X, _HINGE[2] - ARM - height))
    reach = float(np.sqrt(length**2 - (tip[1] - height) ** 2))
    pin = np.array([tip[0] - reach, height])
    return pin, tip - pin


def _rails() -> Solid:
    """The plate that carries everything, and the bearing blocks of the screw."""
    base = _SCREW_Z - 0.185
    return joined(
        block(1.98, 0.34, 0.025).moved(x=0.64, z=base),
        block(0.035, 0.12, 0.2).moved(x=0.57, z=base + 0.1),
        block(0.035, 0.12, 0.2).moved(x=1.15, z=base + 0.1),
        *(block(0.05, 0.3, 0.09).moved(x=x, z=base + 0.04) for x in (-0.24, 0.24)),
    )


def _bracket() -> Solid:
    base = _SCREW_Z - 0.185
    height = float(_HINGE[2]) - base
    return joined(*(block(0.06, 0.02, height).moved(x=1.34, y=y, z=base + 0.5 * height) for y in (-0.1, 0.1)))


def _horn() -> Solid:
    outline = [(-0.045, 0.02), (0.045, 0.02), (0.022, -ARM), (0.0, -ARM - 0.022), (-0.022, -ARM)]
    plate = extruded(outline, -0.012, 0.012).across()
    return joined(plate, tube(-0.34, 0.34, 0.0, 0.024).across(), ball(0.03))


def _flap() -> Solid:
    """A wing's trailing edge: thick at the hinge, thin behind."""
    outline = [(0.0, 0.036), (0.08, 0.042), (0.5, 0.006), (0.5, -0.006), (0.08, -0.042), (0.0, -0.036), (-0.022, 0.0)]
    halves = []
    for y0, y1 in ((-0.33, -0.03), (0.03, 0.33)):  # with room for the horn
        halves.append(extruded([(-x - 0.03, z) for x, z in outline], y0, y1).across())
    return joined(*halves, block(0.40, 0.06, 0.02).moved(x=0.31))


# --- the motor in 3D: a housing cut open, coils of three phases, the rotor with its magnets, bearings -----------------
# The coils of phase i lie about the azimuth −2πi/3 from phase A's, and the rotor's axis is off towards θ_m − φ: so
# the drawn gap under a phase is thin when the model's factor 1 + ζ cos(θ_m − φ + 2πi/3) is large.

AIR_GAP = 0.025  # as drawn, where the rotor's radius is 0.125
_BORE = 0.15
_FIRST_AZIMUTH = 0.5 * np.pi  # of phase A: on top
_LAYERS = 8  # turns drawn of each coil
_OPEN_FROM, _OPEN_TO = np.radians(75.0), np.radians(215.0)  # the sector cut out of the housing
_DIRECTION_RAD, _THINNEST_RAD = np.radians((4.0, 26.0))  # half widths of the marks in the air gap


class Motor:
    """Built once; afterwards only frames move and colours change."""

    def __init__(self, scene: viser.SceneApi, root: str, pole_pairs: int) -> None:
        self._housing = add_mesh(scene, f"{root}/housing", _housing(), GLASS, opacity=0.35)
        add_mesh(scene, f"{root}/stator", _stator(), IRON)
        self._scene, self._root = scene, root
        self._coils: list[Any] = [None] * 3
        self._burnt: Any = None
        self._layers: list[int] = [0] * 3
        self._axis = scene.add_frame(f"{root}/axis", show_axes=False)
        self.rotor = scene.add_frame(f"{root}/axis/rotor", show_axes=False)
        add_mesh(scene, f"{root}/axis/rotor/core", _rotor_core(), STEEL)
        magnets = 2 * min(max(pole_pairs, 1), 6)
        for pole, colour in enumerate((SATIN, LIGHT)):
            add_mesh(scene, f"{root}/axis/rotor/magnets_{pole}", _magnets(magnets, pole), colour)
        self._cage = scene.add_frame(f"{root}/cage", show_axes=False)
        # on the rotor, so that they turn with it: where the gap is thinnest, or without eccentricity would be
        self._thinnest, self._direction = (
            add_mesh(scene, f"{root}/axis/rotor/{name}", _gap(half), FAULT)
            for name, half in (("thinnest_gap", _THINNEST_RAD), ("direction", _DIRECTION_RAD))
        )
        self._bearings = add_mesh(scene, f"{root}/bearings", joined(*(_bearing(x) for x in (-0.31, 0.31))), STEEL)
        balls = [(x, 0.062, TURN * i / 8) for x in (-0.31, 0.31) for i in range(8)]
        sphere = ball(0.0125)
        scene.add_batched_meshes_simple(
            f"{root}/cage/balls",
            sphere.vertices,
            sphere.faces,
            batched_wxyzs=np.array([about_x(0.0)] * len(balls)),
            batched_positions=np.array([(x, r * np.cos(a), r * np.sin(a)) for x, r, a in balls]),
            batched_colors=(235, 238, 242),
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )
        self._eccentricity, self._phase_rad = 0.0, 0.0
        self._wind([_LAYERS] * 3)
        self.mark(frozenset())

    def mark(self, faults: Set[str]) -> None:
        """Shows the places of friction (k1) and eccentricity (k6; k7 alone is a direction) in the fault colour."""
        self._bearings.color = FAULT if "k1" in faults else STEEL
        self._thinnest.visible = "k6" in faults
        self._direction.visible = "k7" in faults and "k6" not in faults

    def set_opacity(self, opacity: float) -> None:
        """Of the housing, 0 … 1."""
        self._housing.visible = opacity > 0.0
        self._housing.opacity = opacity

    def damage(self, turns: Sequence[float], eccentricity: float, phase_rad: float) -> None:
        """Healthy shares of the three phases' turns; how far the rotor is off, and towards where on it."""
        healthy = np.round(_LAYERS * np.asarray(turns, dtype=float))
        # A short, however small, shows as one turn.
        healthy = np.where((healthy == _LAYERS) & (np.asarray(turns) < 0.995), _LAYERS - 1, healthy)
        self._wind([int(layers) for layers in healthy])
        self._eccentricity, self._phase_rad = eccentricity, phase_rad
        self._thinnest.wxyz = self._direction.wxyz = about_x(_FIRST_AZIMUTH - phase_rad)

    def turn(self, motor_rad: float) -> None:
        """Turns the rotor on its axis, which itself runs around where it is off centre."""
        self.rotor.wxyz = about_x(motor_rad)
        self._cage.wxyz = about_x(0.4 * motor_rad)  # balls roll at about this share of the shaft's speed
        towards = _FIRST_AZIMUTH + motor_rad - self._phase_rad
        off = 0.92 * AIR_GAP * self._eccentricity
        self._axis.position = (0.0, off * np.cos(towards), off * np.sin(towards))

    def glow(self, currents: Sequence[float]) -> None:
        """Brightness of the phases by their currents, each as a share −1 … 1 of the brightest."""
        for phase, (coil, current) in enumerate(zip(self._coils, currents)):
            colour = _lit(phase, abs(current))
            if coil is not None and coil.color != colour:
                coil.color = colour

    def _wind(self, layers: list[int]) -> None:
        """So many healthy layers of each phase's coils, the others burnt; a mesh for each, cheap to recolour."""
        if layers == self._layers:
            return
        for phase, healthy in enumerate(layers):
            if healthy != self._layers[phase]:
                loops = _loops(phase, range(healthy))
                self._coils[phase] = self._mesh(self._coils[phase], f"coil_{'abc'[phase]}", loops, AT_REST[phase])
        burnt = [loop for phase, healthy in enumerate(layers) for loop in _loops(phase, range(healthy, _LAYERS))]
        self._burnt = self._mesh(self._burnt, "burnt", burnt, FAULT)
        self._layers = layers

    def _mesh(self, old: Any, name: str, loops: list[Solid], colour: Colour) -> Any:
        """Of these loops instead of the old ones; None without any."""
        if old is not None:
            old.remove()
        return add_mesh(self._scene, f"{self._root}/{name}", joined(*loops), colour) if loops else None


def _lit(phase: int, share: float) -> Colour:
    """From subdued at rest, over the phase's own colour, towards white at the most."""
    share = min(max(share, 0.0), 1.0)
    if share < 0.6:
        return between(AT_REST[phase], PHASES[phase], share / 0.6)
    return between(PHASES[phase], WHITE, 0.75 * (share - 0.6) / 0.4)


def _housing() -> Solid:
    start, stop = _OPEN_TO - TURN, _OPEN_FROM
    return joined(
        tube(-0.34, 0.34, 0.275, 0.295, start, stop),
        tube(-0.345, -0.30, 0.08, 0.295, start, stop),
        tube(0.30, 0.345, 0.08, 0.295, start, stop),
        *(tube(x, x + 0.012, 0.295, 0.308, start, stop) for x in np.linspace(-0.26, 0.25, 6)),  # cooling fins
    )


def _stator() -> Solid:
    teeth = [block(0.4, 0.09, 0.05).moved(y=0.195).turned(_azimuth(slot)) for slot in range(6)]
    half = np.radians(17.0)
    shoes = [tube(-0.2, 0.2, _BORE, _BORE + 0.012, _azimuth(slot) - half, _azimuth(slot) + half) for slot in range(6)]
    return joined(tube(-0.2, 0.2, 0.236, 0.275, _OPEN_TO - TURN, _OPEN_FROM), *teeth, *shoes)


def _azimuth(slot: int) -> float:
    """Of a coil: two side by side for each phase."""
    phase, second = divmod(slot, 2)
    return _FIRST_AZIMUTH - TURN * phase / 3.0 + np.radians(30.0 if second else -30.0)


def _loops(phase: int, layers: range) -> list[Solid]:
    """Turns of these layers of a phase's two coils; the innermost, which the eye meets first, burn first."""
    loops = []
    for layer in layers:
        radius = 0.169 + 0.0088 * (_LAYERS - 1 - layer)
        loops += [_loop(radius / 0.169).moved(y=radius).turned(_azimuth(slot)) for slot in (2 * phase, 2 * phase + 1)]
    return loops


def _loop(width: float) -> Solid:
    """One turn about a tooth, at azimuth 0: long along x, narrow along z, thin along y."""
    thick, wire, half_length, half_width = 0.0066, 0.034, 0.225, 0.044 * width
    legs = [block(2.0 * half_length, thick, wire * width).moved(z=side * half_width) for side in (-1.0, 1.0)]
    ends = [
        block(wire, thick, 2.0 * half_width + wire * width).moved(x=side * (half_length + 0.5 * wire))
        for side in (-1.0, 1.0)
    ]
    return joined(*legs, *ends)


def _rotor_core() -> Solid:
    return joined(
        tube(-0.22, 0.22, 0.0, 0.095),
        revolved([(-0.42, 0.0), (-0.42, 0.030), (-0.41, 0.036), (0.52, 0.036), (0.52, 0.0)]),
        block(0.05, 0.02, 0.012).moved(x=-0.40, z=0.036),  # the key shows the shaft's angle
    )


def _magnets(count: int, pole: int) -> Solid:
    half = 0.43 * TURN / count
    return joined(
        *(
            tube(-0.21, 0.21, 0.095, _BORE - AIR_GAP, TURN * i / count - half, TURN * i / count + half)
            for i in range(pole, count, 2)
        )
    )


def _gap(half_rad: float) -> Solid:
    """A strip along the air gap about azimuth 0, and its end before the rotor, where it is seen from outside."""
    return joined(
        tube(-0.225, 0.225, _BORE - AIR_GAP + 0.001, _BORE - 0.012, -half_rad, half_rad),
        tube(-0.262, -0.225, 0.098, _BORE - 0.002, -half_rad, half_rad),
    )


def _bearing(x: float) -> Solid:
    return joined(tube(x - 0.018, x + 0.018, 0.036, 0.05), tube(x - 0.018, x + 0.018, 0.074, 0.09))


# --- the actuator in 3D: motor and drivetrain, lights, labels, the first view. Built once; poses only move it ---------

_ROOT, _LABELS = "/actuator", "/labels"
_OWN = "/own"  # root of what one window has for itself
_FIRST_ASPECT = 0.7  # of the picture that a browser is taken to have until it tells
_GROUND_MIDDLE, _GROUND_Z, _GROUND_RADIUS, _GROUND_CELL = (0.66, 0.12), -0.37, 1.55, 0.27
_GRID = (156, 162, 174)  # seen on light and dark
_NAMES = (
    Label("housing", "housing", (-0.28, 0.2, 0.225)),
    Label("phase_a", "phase A", (-0.24, 0.09, 0.215)),
    Label("phase_b", "phase B", (-0.25, 0.21, -0.06)),
    Label("phase_c", "phase C", (-0.24, -0.21, -0.14)),
    Label("rotor", "rotor", (0.0, -0.08, 0.09)),
    Label("bearing", "bearing", (-0.335, -0.03, 0.07)),
    Label("gear", "gear", (0.46, -0.05, -0.06)),
    Label("ball_screw", "ball screw", (0.66, 0.0, -0.14)),
    Label("nut", "nut", (0.80, -0.02, -0.12)),
    Label("horn", "horn", (1.34, 0.0, -0.02)),
    Label("surface", "control surface", (1.70, -0.22, 0.13)),
)
_PART_OF = {"k1": "bearing", "k2": "nut", "k3": "phase_a", "k4": "phase_b", "k5": "phase_c", "k6": "rotor"}
_DRIVE_AT, _LOAD_AT = NAMED_AT, (1.68, 0.0, 0.13)
_MOST_PLACED = 20  # places of a camera that are remembered


class Machine:
    """Motor, drivetrain and labels as they are drawn; what they enlarge is `emaviz.scene.playback`'s matter."""

    def __init__(self, owner: viser.ViserServer | viser.ClientHandle, pole_pairs: int, root: str = "") -> None:
        """owner: the server, whose windows share it, or the window that has it alone."""
        scene, self._owner = owner.scene, owner
        self._motor = Motor(scene, f"{root}{_ROOT}/motor", pole_pairs)
        self._rotor = self._motor.rotor
        self._drivetrain = Drivetrain(scene, f"{root}{_ROOT}/drive")
        self._faults: frozenset[str] = frozenset()
        self._drive = DriveBox(scene, f"{root}{_ROOT}/controller")
        self._load = LoadArrow(scene, f"{root}{_ROOT}/drive/surface")
        self._labels = Labels(scene, f"{root}{_LABELS}", _NAMES)

    def fit(self, shown: Frame, picture: tuple[int, int]) -> None:
        """Lays the labels out for a picture, px; they and their lines move together."""
        with self._owner.atomic():
            self._labels.fit(shown, picture)

    def set_opacity(self, opacity: float) -> None:
        """Of the housing, 0 … 1."""
        self._motor.set_opacity(opacity)

    def show_labels(self, shown: bool) -> None:
        """Names of the parts, and what is said of them."""
        with self._owner.atomic():
            self._labels.show(shown)

    def tell(self, callouts: Sequence[Callout], drive: str = "", load: str = "") -> None:
        """Marks the places of faults, and says what they are; what is set in the drive; the load."""
        faults = frozenset(one.fault for one in callouts)
        told = [Label("drive", drive or "controller and inverter", _DRIVE_AT)]
        told += [Label("load", load, _LOAD_AT)] if load else []
        with self._owner.atomic():
            if faults != self._faults:
                self._faults = faults
                for part in (self._motor, self._drivetrain, self._drive):
                    part.mark(faults)
            marks = [Label(one.fault, one.text, one.place, True, _PART_OF.get(one.fault, "")) for one in callouts]
            self._labels.tell(marks, told)

    def damage(self, turns: Sequence[float], eccentricity: float, phase_rad: float, play: float) -> None:
        """What a fault changes for good: live shares of the turns, the rotor's offset, the pin's room in the nut."""
        self._motor.damage(turns, eccentricity, phase_rad)
        self._drivetrain.set_play(play)

    def pose(
        self,
        motor_rad: float,
        surface_rad: float,
        play: float = 0.0,
        glow: Sequence[float] = (0.0, 0.0, 0.0),
        heat: float = 0.0,
        load: float = 0.0,
    ) -> None:
        """Rotor and surface, the nut before the pin (a length), brightness of the phases, heat of the screw, the load.

        Heat is a share 0 … 1, the load a share −1 … 1 of the longest arrow, positive where it opposes a positive turn.
        """
        with self._owner.atomic():
            self._motor.turn(motor_rad)
            self._motor.glow(glow)
            self._drivetrain.move(motor_rad, surface_rad, play)
            self._drivetrain.heat(heat)
            self._load.show(load)


class ActuatorScene(Machine):
    """The machine that windows share, its light and the first view; a window that plays another run has its own.

    A window's own machine hides the shared one there, by nodes of the same names.
    """

    def __init__(self, server: viser.ViserServer, pole_pairs: int = 2) -> None:
        self._server, self._pole_pairs = server, pole_pairs
        self._own: dict[int, Machine] = {}  # by window
        self._opacity: float | None = None
        self._labelled = True
        scene = server.scene
        scene.set_up_direction("+z")
        scene.configure_environment_map(None)
        scene.configure_default_lights(enabled=False)
        # One soft light, bright from the front left and above: without a GPU each further light costs as much again.
        scene.add_light_hemisphere(
            "/light/soft",
            sky_color=(255, 255, 255),
            ground_color=(70, 76, 95),
            intensity=3.4,
            position=(-1.5, -2.0, 3.0),
        )
        scene.add_line_segments("/ground", points=_ground(), colors=_GRID, thickness=1.0, thickness_units="screen")
        super().__init__(server, pole_pairs)
        _put(server.initial_camera, frame(_FIRST_ASPECT))

        @server.on_client_connect
        def _(client: viser.ClientHandle) -> None:
            self._keep_framed(client)

    def own(self, client: viser.ClientHandle) -> Machine:
        """The machine of this window alone, which is built where it has none yet."""
        if client.client_id not in self._own:
            with client.atomic():
                for name in (_ROOT, _LABELS):
                    client.scene.add_frame(name, show_axes=False, visible=False)
                made = Machine(client, self._pole_pairs, _OWN)
                if self._opacity is not None:
                    made.set_opacity(self._opacity)
                made.show_labels(self._labelled)
            self._own[client.client_id] = made
            if client.camera.image_height > 0:
                picture = client.camera.image_width, client.camera.image_height
                made.fit(frame(picture[0] / picture[1]), picture)
        return self._own[client.client_id]

    def forget(self, client: int) -> None:
        """A window is closed."""
        self._own.pop(client, None)

    def set_opacity(self, opacity: float) -> None:
        """In every window."""
        self._opacity = opacity
        super().set_opacity(opacity)
        for one in list(self._own.values()):
            one.set_opacity(opacity)

    def show_labels(self, shown: bool) -> None:
        """In every window."""
        self._labelled = shown
        super().show_labels(shown)
        for one in list(self._own.values()):
            one.show_labels(shown)

    def reset_view(self, client: viser.ClientHandle) -> None:
        """The whole actuator in a browser's picture, whatever its shape."""
        if client.camera.image_height > 0:
            self._frame(client)

    def _frame(self, client: viser.ClientHandle) -> Frame:
        camera = client.camera
        picture = camera.image_width, camera.image_height
        shown = frame(picture[0] / picture[1])
        _put(camera, shown)
        self._own.get(client.client_id, self).fit(shown, picture)
        return shown

    def _keep_framed(self, client: viser.ClientHandle) -> None:
        """Frames the actuator anew when the picture changes its shape, until the user moves the camera."""
        camera = client.camera
        aspects = [0.0]
        # where it was put: the browser may tell of an earlier place when a later one is on its way
        placed = [frame(_FIRST_ASPECT).position]
        framing = threading.Lock()

        @camera.on_update
        def _(_: Any) -> None:
            with framing:
                if camera.image_height <= 0:
                    return
                aspect, at = camera.image_width / camera.image_height, camera.position
                untouched = any(np.allclose(at, one, atol=0.02) for one in placed)
                there = np.allclose(at, placed[-1], atol=0.02) and abs(aspect - aspects[-1]) <= 0.01
                if untouched and not there:
                    aspects[:] = [aspect]
                    placed.append(self._frame(client).position)
                    del placed[:-_MOST_PLACED]


def _put(camera: Any, shown: Frame) -> None:
    camera.fov = FIELD_RAD
    camera.position = shown.position
    camera.look_at = shown.look_at


def _ground() -> NDArray[np.float32]:
    """A round grid below the actuator as lines (n, 2, 3): far cheaper to draw than viser's grid, which is a shader."""
    across = np.arange(-_GROUND_RADIUS + 0.1, _GROUND_RADIUS, _GROUND_CELL)
    half = np.sqrt(_GROUND_RADIUS**2 - across**2)
    one_way = np.stack([np.column_stack([across, end * half]) for end in (-1.0, 1.0)], axis=1)
    lines = np.concatenate([one_way, one_way[:, :, ::-1]])
    middle = np.broadcast_to(_GROUND_MIDDLE, lines.shape)
    return np.concatenate([lines + middle, np.full((*lines.shape[:2], 1), _GROUND_Z)], axis=2).astype(np.float32)
