"""A run as poses: what the signals say, enlarged where nobody could see it, and by how much."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.faults import physical
from ema_model.quantities.sides import USER
from ema_model.recordings import Measurement
from emaviz.scene.actuator import ARM, Machine, said
from emaviz.scene.labels import Callout, callouts

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
