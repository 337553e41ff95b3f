"""Runs as poses of the 3D actuator, and their playback."""

from __future__ import annotations

import contextlib
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.faults import physical
from ema_model.quantities import USER
from ema_model.recordings import Measurement
from emaviz.scene.actuator import ARM, ActuatorScene, Machine, said
from emaviz.scene.labels import Callout, callouts
from emaviz.session.explore import Simulation

# --- a run as poses: what the signals say, enlarged where nobody could see it, and by how much ------------------------

_LARGEST_TURN_RAD = 0.6  # to which the surface's motion is enlarged
_PLAY_MORE = 4.0  # play is enlarged more than motion
_WIDEST = 0.08  # of the pin's room between the jaws, as drawn
# what a run must have to be shown
PLAYED = ("current_A", "motor_position_rad", "motor_speed_rad_s", "user_position_rad")
_PHASE_CURRENTS = ("phase_a_current_A", "phase_b_current_A", "phase_c_current_A")
_GAP_ENLARGED = 20.0  # the drawn gap is 1/5 of the rotor's radius, a usual one 1/100


def enlargement(largest_rad: float) -> float:
    """By how much motion up to that angle is enlarged: a round number, 1 or more."""
    if not largest_rad > 0.0:
        return 1.0
    factor = max(1.0, _LARGEST_TURN_RAD / largest_rad * (1.0 + 1e-9))
    decade = 10.0 ** np.floor(np.log10(factor))
    return float(np.floor(factor / decade) * decade)


@dataclass(frozen=True, eq=False)
class Motion:
    """The reference model's run, sampled evenly from time 0; `pose` shows a moment of it."""

    time_s: NDArray[np.float64]
    motor_rad: NDArray[np.float64]
    surface_rad: NDArray[np.float64]  # as drawn
    play: NDArray[np.float64]  # as drawn, the nut before the pin, a length
    glow: NDArray[np.float64]  # (n, 3), shares of the brightest
    heat: NDArray[np.float64]  # of the screw, which glows where a model fails
    enlarged: float
    play_enlarged: float
    full_A: float
    turns: tuple[float, float, float]
    eccentricity: float
    phase_rad: float
    room: float  # of the pin between the jaws, as drawn
    start_s: float = 0.0  # of the recording's own time, which time 0 here is
    callouts: tuple[Callout, ...] = ()
    load: NDArray[np.float64] | None = None  # shares of the longest arrow
    load_says: str = ""
    drive_says: str = ""
    says: str = ""  # what its glow means, beyond `sentence`

    def without_faults(self) -> Motion:
        """The same motion of a healthy machine under no load."""
        return replace(
            self,
            play=np.zeros_like(self.play),
            turns=(1.0, 1.0, 1.0),
            eccentricity=0.0,
            room=0.0,
            callouts=(),
            load=None,
            load_says="",
        )

    @property
    def duration_s(self) -> float:
        """Length of the run."""
        return float(self.time_s[-1])

    def damage(self, scene: Machine) -> None:
        """Shows what its faults change for good."""
        scene.damage(self.turns, self.eccentricity, self.phase_rad, self.room)
        scene.tell(self.callouts, self.drive_says, self.load_says)

    def pose(self, scene: Machine, time_s: float) -> None:
        """Shows a moment, s from the run's start."""
        at = min(int(np.searchsorted(self.time_s, time_s)), len(self.time_s) - 1)
        scene.pose(
            float(self.motor_rad[at]),
            float(self.surface_rad[at]),
            float(self.play[at]),
            tuple(float(share) for share in self.glow[at]),
            float(self.heat[at]),
            0.0 if self.load is None else float(self.load[at]),
        )

    def sentence(self) -> str:
        """What is not to scale."""
        return (
            f"Not to scale: surface motion × {self.enlarged:g}, play × {self.play_enlarged:g}, "
            f"air gap and rotor offset × {_GAP_ENLARGED:g}. Coils brightest at {self.full_A:g} A. {self.says}"
        ).rstrip()


def motion(run: Measurement, k: ArrayLike, actuator: Actuator) -> Motion:
    """The poses of a simulated run with faults k (8,)."""
    faults = physical(k)
    user = run["user_position_rad"]
    motor = run["motor_position_rad"]
    gear = actuator.transmission.gear_ratio
    enlarged = enlargement(float(np.max(np.abs(user))))
    width_rad = float(faults.backlash_factor) * actuator.transmission.backlash_rad
    drawn = ARM * enlarged * width_rad
    more = min(_PLAY_MORE, _WIDEST / drawn) if drawn > 0.0 else _PLAY_MORE
    more = more if more < 1.0 else float(np.floor(more))
    room = more * drawn
    play = np.clip(ARM * enlarged * more * (gear * motor - user), -0.5 * room, 0.5 * room)
    if all(name in run for name in _PHASE_CURRENTS):
        currents = np.stack([run[name] for name in _PHASE_CURRENTS], axis=1)
    else:
        currents = np.repeat(run["current_A"][:, None], 3, axis=1)
    full = _round_up(float(np.max(np.abs(currents))))
    load = run["load_torque_Nm"] if "load_torque_Nm" in run else None
    heaviest = 0.0 if load is None else float(load[np.argmax(np.abs(load))])
    return Motion(
        run.time_s - run.time_s[0],
        motor,
        enlarged * user,
        play,
        currents / full,
        np.zeros(len(motor)),
        enlarged,
        enlarged * more,
        full,
        (float(faults.turns[0]), float(faults.turns[1]), float(faults.turns[2])),
        float(faults.eccentricity),
        float(faults.phase_rad),
        room,
        float(run.time_s[0]),
        callouts(k, actuator, enlarged * more, _GAP_ENLARGED),
        None if load is None else load / _round_up(abs(heaviest)),
        f"load {heaviest:.4g} {actuator.axes.unit('N·m', USER)}".replace("-", "−") if heaviest else "",
        said(actuator),
    )


def _round_up(value: float) -> float:
    """The next of 1, 2, 3, 5, 8 times a power of ten."""
    if not value > 0.0:
        return 1.0
    decade = 10.0 ** np.floor(np.log10(value))
    return float(next(step * decade for step in (1.0, 2.0, 3.0, 5.0, 8.0, 10.0) if step * decade >= value * 0.999))


# --- plays runs on the 3D actuator, slower than life, over and over ---------------------------------------------------
# A reel for each workspace, each with its clock.
# Windows share one scene, which plays for the one that was used last; a window at another workspace has its own.

_POSES_PER_S = 30.0
# While a slider is dragged one watches the charts, and without a GPU one picture of the scene takes the time of all of
# them; each pose lets the browser draw pictures for a quarter of a second.  It sends a slider's value every 50 ms when
# it has the time: then there is time for poses, too.
_POSES_WHILE_CHANGING_PER_S = 15.0
_POSES_WHILE_BEHIND_PER_S = 0.2
_IN_TIME_S = 0.057  # between two runs of a browser that is not behind
_CHANGING_S = 0.6  # a run that comes so soon after another one is one of many
_CHARTS_FIRST_S = 0.25  # after any run, in which a browser draws its charts
_TOLD_PER_S = 8.0  # play-heads are redrawn at this pace
SPEEDS = {"1 : 1": 1.0, "1 : 5": 0.2, "1 : 10": 0.1, "1 : 20": 0.05, "1 : 50": 0.02, "1 : 200": 0.005}


FIRST = "explore"  # the reel that is played at first
_OF_SLIDERS = (FIRST, "identify")  # reels of the plant that the sliders make, as long as they have nothing else


@dataclass(eq=False)
class Reel:
    """A run to play, and where its clock stands."""

    motion: Motion | None = None
    clock_s: float = 0.0
    playing: bool = True


@dataclass(eq=False)
class Stage:
    """A scene, the reel that it shows, and whose faults it has."""

    scene: Machine
    on: str
    damaged: Motion | None = None

    def show(self, shown: Motion, time_s: float) -> None:
        """A moment of a run."""
        if shown is not self.damaged:
            self.damaged = shown
            shown.damage(self.scene)
        shown.pose(self.scene, time_s)


class Playback:
    """A thread that poses the scenes: a second on the screen is `speed` seconds of the run.

    moved(on, time_s, duration_s) is called on that thread with the name of each reel that is shown, a few times a
    second, and after `seek`; times from the run's start.
    """

    def __init__(self, scene: ActuatorScene, actuator: Actuator, moved: Callable[[str, float, float], None]) -> None:
        self.scene, self._actuator, self._moved = scene, actuator, moved
        self.speed = 0.1
        self.reels: dict[str, Reel] = {FIRST: Reel()}
        self._reel = self.reels[FIRST]
        self.on = FIRST  # the name of the reel that is played
        self._whole: Motion | None = None  # Explore's run on a healthy actuator, where there is nothing else to play
        self._stale = False  # what the scene shows is not the run at the clock
        self._shared = Stage(scene, FIRST)
        self._own: dict[int, Stage] = {}  # by window
        self._came_s: deque[float] = deque([-1e9] * 6, maxlen=6)  # when the last runs came
        self._posing = threading.Lock()
        self._wake = threading.Event()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="emaviz-playback", daemon=True)
        self._thread.start()

    @property
    def playing(self) -> bool:
        """Whether the picture moves."""
        return self._reel.playing

    @property
    def motion(self) -> Motion | None:
        """The run that is shown."""
        return self._motion_on(self.on)

    def _motion_on(self, on: str) -> Motion | None:
        """A reel's own run, or what is shown where it has none."""
        own = self.reels[on].motion
        return own or (self.reels[FIRST].motion if on in _OF_SLIDERS else self._whole)

    def enter(self, on: str) -> None:
        """Goes on with another reel, from where its clock stood."""
        with self._posing:
            self._reel, self.on = self.reels.setdefault(on, Reel(playing=False)), on
            self._shared.on = on
            self._stale = True
        self._wake.set()

    def show_in(self, window: int, scene: Machine, on: str) -> None:
        """A window's own scene shows a reel from now on."""
        with self._posing:
            self.reels.setdefault(on, Reel(playing=False))
            self._own.setdefault(window, Stage(scene, on)).on = on
            self._stale = True
        self._wake.set()

    def forget(self, window: int) -> None:
        """A window is closed."""
        with self._posing:
            self._own.pop(window, None)

    def show(self, simulation: Simulation) -> None:
        """Puts Explore's run on its reel, which keeps its moment."""
        self.put(motion(simulation.reference, simulation.k, self._actuator), FIRST)

    def put(self, shown: Motion | None, on: str) -> None:
        """Puts a run on a reel, or takes it off."""
        with self._posing:
            reel = self.reels.setdefault(on, Reel(playing=False))
            reel.motion = shown
            if on == FIRST:
                self._whole = None if shown is None else shown.without_faults()
            if reel is self._reel or self._reel.motion is None or any(one.on == on for one in self._own.values()):
                self._stale = True
                self._came_s.append(time.monotonic())
        self._wake.set()

    def play(self, playing: bool) -> None:
        """Lets the picture move or rest."""
        self._reel.playing = playing
        self._wake.set()

    def seek(self, time_s: float, on: str | None = None) -> None:
        """Goes to a moment of the run, or of another reel's, s from its start."""
        reel = self._reel if on is None else self.reels.setdefault(on, Reel(playing=False))
        if np.isfinite(time_s):
            reel.clock_s = max(time_s, 0.0)
            self._stale = True
            self._wake.set()

    @property
    def time_s(self) -> float:
        """The moment that is shown."""
        return self._reel.clock_s

    @contextlib.contextmanager
    def still(self) -> Iterator[Motion | None]:
        """Nothing is posed meanwhile; gives the run that is shown."""
        with self._posing:
            yield self.motion
            self._stale = True
        self._wake.set()

    def close(self) -> None:
        """Ends the thread."""
        self._closing = True
        self._wake.set()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        last, told, posed = time.monotonic(), 0.0, 0.0
        while not self._closing:
            while not self._closing and (left := 1.0 / self._pace - (time.monotonic() - posed)) > 0.0:
                time.sleep(min(left, 1.0 / _POSES_PER_S))  # the pace may change meanwhile
            now = posed = time.monotonic()
            passed, last = now - last, now
            with self._posing:
                stages = [self._shared, *self._own.values()]
                moved = self._move(stages, passed)
                stale, self._stale = self._stale, False
            if moved and (stale or now - told >= 1.0 / _TOLD_PER_S):
                told = now
                for on, shown in moved.items():
                    self._moved(on, self.reels[on].clock_s, shown.duration_s)
            if not (any(self.reels[one.on].playing for one in stages) or self._stale):
                self._wake.wait()
                last = time.monotonic()
            self._wake.clear()

    def _move(self, stages: Sequence[Stage], passed_s: float) -> dict[str, Motion]:
        """Each reel that is shown goes on once, and its stages with it; those that have moved."""
        moved: dict[str, Motion] = {}
        for on in dict.fromkeys(stage.on for stage in stages):
            shown, reel = self._motion_on(on), self.reels[on]
            if shown is None:
                continue
            if reel.playing:
                reel.clock_s += passed_s * self.speed
            if reel.clock_s > shown.duration_s:
                reel.clock_s = reel.clock_s % shown.duration_s if reel.playing else shown.duration_s
            if reel.playing or self._stale:
                moved[on] = shown
        for stage in stages:
            if stage.on in moved:
                stage.show(moved[stage.on], self.reels[stage.on].clock_s)
        return moved

    @property
    def _pace(self) -> float:
        """Poses per second: fewer while one run follows the other, as while a slider is dragged.

        None is due until the first one's charts are drawn: else a slow browser's runs would never follow so closely.
        """
        came = tuple(self._came_s)
        gaps = tuple(takewhile(lambda gap: gap < _CHANGING_S, np.diff(came)[::-1]))
        since = time.monotonic() - came[-1]
        if since >= (_CHANGING_S if gaps else _CHARTS_FIRST_S):
            return _POSES_PER_S
        if not gaps:
            return _POSES_WHILE_BEHIND_PER_S
        in_time = np.median(gaps) <= _IN_TIME_S  # of this change alone: a quick one before says nothing of it
        return _POSES_WHILE_CHANGING_PER_S if in_time else _POSES_WHILE_BEHIND_PER_S
