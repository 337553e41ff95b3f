"""The actuator in 3D: motor and drivetrain, lights, labels, the first view.  Built once; poses only move it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from emaviz.scene.drivetrain import Drivetrain
from emaviz.scene.framing import FIELD_RAD, Frame, frame
from emaviz.scene.motor import Motor

_ROOT = "/actuator"
_FIRST_ASPECT = 0.7  # of the picture that a browser is taken to have until it tells
_GROUND_MIDDLE, _GROUND_Z, _GROUND_RADIUS, _GROUND_CELL = (0.66, 0.12), -0.37, 1.55, 0.27
_GRID = (156, 162, 174)  # seen on light and dark
_LABELS = (
    ("housing", (0.12, -0.05, 0.31)),
    ("phase A", (-0.25, 0.0, 0.235)),
    ("phase B", (-0.25, 0.21, -0.02)),
    ("phase C", (-0.25, -0.21, -0.10)),
    ("rotor", (-0.43, 0.0, 0.02)),
    ("bearing", (0.33, 0.0, 0.15)),
    ("gear", (0.46, -0.05, -0.34)),
    ("ball screw", (0.66, 0.0, -0.29)),
    ("nut, with play", (0.80, 0.0, 0.0)),
    ("horn", (1.34, 0.0, -0.05)),
    ("control surface (user)", (1.62, 0.0, 0.2)),
)
_MOST_PLACED = 20  # places of a camera that are remembered


class ActuatorScene:
    """Angles, lengths and colours as they are drawn; what they enlarge is `emaviz.scene.motion`'s matter."""

    def __init__(self, server: viser.ViserServer, pole_pairs: int = 2) -> None:
        self._server = server
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
        self._motor = Motor(scene, f"{_ROOT}/motor", pole_pairs)
        self._rotor = self._motor.rotor
        self._drivetrain = Drivetrain(scene, f"{_ROOT}/drive")
        self._labels: list[Any] = [
            scene.add_label(f"/labels/{i}", text, position=place, visible=False, anchor="bottom-center")
            for i, (text, place) in enumerate(_LABELS)
        ]
        _put(server.initial_camera, frame(_FIRST_ASPECT))

        @server.on_client_connect
        def _(client: viser.ClientHandle) -> None:
            self._keep_framed(client)

    def reset_view(self, client: viser.ClientHandle) -> None:
        """The whole actuator in a browser's picture, whatever its shape."""
        camera = client.camera
        if camera.image_height > 0:
            _put(camera, frame(camera.image_width / camera.image_height))

    def _keep_framed(self, client: viser.ClientHandle) -> None:
        """Frames the actuator anew when the picture changes its shape, until the user moves the camera."""
        camera = client.camera
        aspects = [0.0]
        # where it was put: the browser may tell of an earlier place when a later one is on its way
        placed: list[tuple[float, float, float]] = []

        @camera.on_update
        def _(_: Any) -> None:
            if camera.image_height <= 0:
                return
            aspect = camera.image_width / camera.image_height
            untouched = not placed or any(np.allclose(camera.position, one, atol=0.02) for one in placed)
            if untouched and abs(aspect - aspects[-1]) > 0.01:
                shown = frame(aspect)
                _put(camera, shown)
                aspects[:] = [aspect]
                placed.append(shown.position)
                del placed[:-_MOST_PLACED]

    def set_opacity(self, opacity: float) -> None:
        """Of the housing, 0 … 1."""
        self._motor.set_opacity(opacity)

    def show_labels(self, shown: bool) -> None:
        """Names of the parts."""
        for label in self._labels:
            label.visible = shown

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
    ) -> None:
        """Rotor and surface, the nut before the pin (a length), brightness of the phases, heat of the screw 0 … 1."""
        with self._server.atomic():
            self._motor.turn(motor_rad)
            self._motor.glow(glow)
            self._drivetrain.move(motor_rad, surface_rad, play)
            self._drivetrain.heat(heat)


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
