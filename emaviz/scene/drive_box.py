"""Controller and inverter in 3D: a box beside the machine, its cable to the motor, and what is set in it."""

from __future__ import annotations

from collections.abc import Set

import numpy as np
import viser
from numpy.typing import ArrayLike

from ema_model.actuator import Actuator
from ema_model.quantities.numbers import amount
from emaviz.scene.mesh import add_mesh
from emaviz.scene.palette import DARK, FAULT, IRON, LIGHT, SATIN
from emaviz.scene.solids import TURN, Solid, block, joined

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
