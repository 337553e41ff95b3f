"""A simple moving actuator: motor with a marked rotor, screw, and the control surface that it turns."""

from __future__ import annotations

import numpy as np
import viser

from emaviz.figures.colours import MONITOR, REFERENCE

_ROOT = "/actuator"
_STEEL = (150, 155, 165)
_DARK = (70, 75, 85)


class ActuatorScene:
    """Built once; `pose` only turns frames."""

    def __init__(self, server: viser.ViserServer) -> None:
        scene = server.scene
        scene.set_up_direction("+z")
        scene.configure_environment_map(None)
        scene.configure_default_lights(cast_shadow=False)  # shadows halve the frame rate without a GPU
        scene.add_light_ambient("/light/ambient", intensity=1.4)
        scene.add_light_hemisphere("/light/sky", intensity=1.2)
        server.initial_camera.position = (0.75, -2.9, 1.3)
        server.initial_camera.look_at = (0.5, 0.0, 0.0)
        along_x = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)
        scene.add_grid("/ground", width=4.0, height=4.0, position=(0.4, 0.0, -0.36), cell_size=0.2)

        scene.add_cylinder(
            f"{_ROOT}/housing", radius=0.26, height=0.62, color=(90, 120, 160), opacity=0.22, wxyz=along_x
        )
        for i, colour in enumerate(((214, 69, 65), (72, 160, 90), (60, 110, 200))):  # phases A, B, C
            for side in (0.0, np.pi):
                angle = 2.0 * np.pi * i / 3.0 + side
                scene.add_box(
                    f"{_ROOT}/winding_{i}_{int(side > 0)}",
                    dimensions=(0.42, 0.055, 0.1),
                    color=colour,
                    position=(0.0, 0.205 * np.cos(angle), 0.205 * np.sin(angle)),
                    wxyz=(np.cos(angle / 2.0), np.sin(angle / 2.0), 0.0, 0.0),
                )
        self._rotor = scene.add_frame(f"{_ROOT}/rotor", show_axes=False)
        scene.add_cylinder(f"{_ROOT}/rotor/core", radius=0.11, height=0.46, color=_STEEL, wxyz=along_x)
        scene.add_cylinder(
            f"{_ROOT}/rotor/shaft", radius=0.035, height=1.1, color=_DARK, wxyz=along_x, position=(0.35, 0.0, 0.0)
        )
        for i in range(4):  # two pole pairs
            angle = np.pi / 2.0 * i
            scene.add_box(
                f"{_ROOT}/rotor/magnet_{i}",
                dimensions=(0.4, 0.12, 0.035),
                color=(225, 85, 70) if i % 2 else (240, 240, 240),
                position=(0.0, 0.115 * -np.sin(angle), 0.115 * np.cos(angle)),
                wxyz=(np.cos(angle / 2.0), np.sin(angle / 2.0), 0.0, 0.0),
            )
        scene.add_cylinder(
            f"{_ROOT}/gearbox", radius=0.17, height=0.2, color=_DARK, wxyz=along_x, position=(0.55, 0.0, 0.0)
        )
        scene.add_box(
            f"{_ROOT}/rotor/mark", dimensions=(0.02, 0.03, 0.1), color=_hex(MONITOR), position=(-0.32, 0.0, 0.06)
        )
        self._surface = scene.add_frame(f"{_ROOT}/surface", show_axes=False, position=(0.95, 0.0, 0.0))
        scene.add_cylinder(
            f"{_ROOT}/surface/hinge", radius=0.05, height=0.7, color=_STEEL, wxyz=(np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)
        )
        scene.add_box(
            f"{_ROOT}/surface/flap", dimensions=(0.5, 0.66, 0.03), color=_hex(REFERENCE), position=(0.27, 0.0, 0.0)
        )
        self._server = server

    def pose(self, motor_rad: float, surface_rad: float) -> None:
        """Turns the rotor about x and the surface about y."""
        with self._server.atomic():
            half = 0.5 * motor_rad
            self._rotor.wxyz = (np.cos(half), np.sin(half), 0.0, 0.0)
            half = -0.5 * surface_rad
            self._surface.wxyz = (np.cos(half), 0.0, np.sin(half), 0.0)


def _hex(colour: str) -> tuple[int, int, int]:
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)
