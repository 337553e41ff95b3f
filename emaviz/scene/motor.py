"""The motor in 3D: a housing cut open, coils of three phases, the rotor with its magnets, bearings.

The coils of phase i lie about the azimuth −2πi/3 from phase A's, and the rotor's axis is off towards θ_m − φ:
so the drawn gap under a phase is thin when the model's factor 1 + ζ cos(θ_m − φ + 2πi/3) is large.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from typing import Any

import numpy as np
import viser

from emaviz.scene.mesh import add_mesh
from emaviz.scene.palette import AT_REST, FAULT, GLASS, IRON, LIGHT, PHASES, SATIN, STEEL, WHITE, Colour, between
from emaviz.scene.solids import TURN, Solid, about_x, ball, block, joined, revolved, tube

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
