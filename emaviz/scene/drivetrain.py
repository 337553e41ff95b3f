"""From the rotor to the user in 3D: a gear pair, the ball screw and its nut, the rod, the horn and the surface."""

from __future__ import annotations

from collections.abc import Set
from typing import Any

import numpy as np
import viser

from emaviz.scene.mesh import add_mesh
from emaviz.scene.palette import DARK, FAULT, IRON, LIGHT, RESIDUAL, SATIN, STEEL, Colour, between
from emaviz.scene.solids import Solid, about_x, about_y, ball, block, extruded, gear_wheel, joined, thread, tube

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
