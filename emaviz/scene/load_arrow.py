"""The load on the control surface as an arrow: its length follows the torque, its side the direction."""

from __future__ import annotations

import viser

from emaviz.scene.mesh import add_mesh
from emaviz.scene.palette import DARK
from emaviz.scene.solids import revolved

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
