"""The actuator in 3D: motor and drivetrain, lights, labels, the first view.  Built once; poses only move it."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from emaviz.scene.callouts import Callout
from emaviz.scene.drive_box import NAMED_AT, DriveBox
from emaviz.scene.drivetrain import Drivetrain
from emaviz.scene.framing import FIELD_RAD, Frame, frame
from emaviz.scene.labels import Label, Labels
from emaviz.scene.load_arrow import LoadArrow
from emaviz.scene.motor import Motor

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
    """Motor, drivetrain and labels as they are drawn; what they enlarge is `emaviz.scene.motion`'s matter."""

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
        """Lays the labels out for a picture, px."""
        self._labels.fit(shown, picture)

    def set_opacity(self, opacity: float) -> None:
        """Of the housing, 0 … 1."""
        self._motor.set_opacity(opacity)

    def show_labels(self, shown: bool) -> None:
        """Names of the parts, and what is said of them."""
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
