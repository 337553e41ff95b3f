"""The transmission by itself: whether the user's position is what the file makes of the motor's.

Inverse dynamics has the motor's motion and its current, and no word on what comes behind the gear.  Where both
positions were recorded, they need no model but θ_user = τ θ_motor: what is left of that, beyond a zero and a delay of
each recording and play that the file states, is the transmission's or an encoder's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.comparison.explain import Order, orders, pitches
from ema_model.models.measured_motion import motion_of
from ema_model.quantities import amount, number, of_signal
from ema_model.recordings import Measurement
from ema_model.recordings.noise import sample_noise

Array = NDArray[np.float64]

_BEYOND = 3.0  # times the two sensors' noise
_MOST_OF_IT = 0.5  # of the squared error, that a cause must explain to be told
_SLIDES = 0.02  # of the highest speed, below which a direction is not known
_ROUNDS = 3  # in which a delay between the two is found
_LEAST_SAMPLES, _MOST_SAMPLES = 100, 5000
_SHORT = {
    "acceleration": "the user's position leaves the motor's as by the twist of a shaft",
    "bandwidth": "the user's position leaves the motor's as by sensors that differ in bandwidth",
    "direction": "the user's position leaves the motor's as by play",
    "position": "the user's position leaves the motor's, repeating with its position",
    "": "the user's position leaves the motor's, cause unknown",
}
_CAUSES = {
    "bandwidth": "It follows the acceleration, ahead of it, as two sensors that differ in bandwidth do.",
    "direction": "It turns over with the direction, as play does.",
}


@dataclass(frozen=True)
class TransmissionSeen:
    """By how much the user's position leaves gear ratio × motor's position."""

    error: Annotated[float, Meta(description="rms at the user, rad (m on a linear axis)")]
    noise: Annotated[float, Meta(description="rms that the two sensors' noise makes, likewise")]
    cause: Annotated[  # of _SHORT; "" where none explains most of it
        str, Meta(description="acceleration, bandwidth, direction, position; empty: not known")
    ]
    period: Annotated[float | None, Meta(description="at the motor, rad or m, where it repeats with the position")] = (
        None
    )
    amplitude: Annotated[float | None, Meta(description="of what repeats, at the user, rad or m")] = None
    frequency_Hz: Annotated[float | None, Meta(description="Hz, of the user on a shaft that gives, the motor held")] = (
        None
    )

    @property
    def short(self) -> str:
        """What a headline says of it."""
        return _SHORT[self.cause]

    def sentence(self, actuator: Actuator) -> str:
        """What is seen, in the axes' units."""
        axes = actuator.axes
        user, motor = (of_signal(name, axes).unit for name in ("user_position_rad", "motor_position_rad"))
        error, times = amount(self.error, user), number(self.error / self.noise, 2)
        said = (
            f"The user's position leaves the motor's by {error} rms, {times} times the noise of the two; "
            "the model without a controller stops at the motor."
        )
        if self.frequency_Hz is not None:
            return (
                f"{said} It follows the acceleration, as the twist of a shaft does on which the user would swing at "
                f"{number(self.frequency_Hz, 2)} Hz with the motor held (torsional compliance)."
            )
        if self.period is None or self.amplitude is None:
            return f"{said} {_CAUSES.get(self.cause, '')}".rstrip()
        period, amplitude = amount(self.period, motor), amount(self.amplitude, user)
        repeats = f"It repeats every {period} of the motor with an amplitude of {amplitude}, as an error of a "
        return f"{said} {repeats}{'screw' if axes.user == 'linear' else 'gear'} or of an encoder does."


def transmission_seen(measurements: Sequence[Measurement], actuator: Actuator) -> TransmissionSeen | None:
    """What recordings of both positions leave of θ_user = τ θ_motor; None where that is noise, or was not recorded."""
    parts = [_left(one, run, actuator) for one in measurements if _has_both(one) for run in one.runs]
    known = [part for part in parts if part is not None]
    if not known:
        return None
    position, left, smooth, accelerations, directions, noises = (np.concatenate(each) for each in zip(*known))
    error, noise = (float(np.sqrt(np.mean(each**2))) for each in (left, noises))
    if error < _BEYOND * noise:
        return None
    columns = {"acceleration": accelerations, "direction": directions}
    shares = {name: float(left @ each) ** 2 / float(each @ each) for name, each in columns.items() if np.any(each)}
    strongest = _strongest(position, left, actuator)
    if strongest is not None:
        sine = strongest.amplitude * np.sin(strongest.order * position + strongest.phase)
        shares["position"] = float(left @ left) - float(np.sum((left - sine) ** 2))
    cause = max(shares, key=lambda name: shares[name], default="")
    if not cause or shares[cause] < _MOST_OF_IT * float(left @ left):
        return TransmissionSeen(error, noise, "")
    if cause == "acceleration":
        return _swinging(error, noise, float(smooth @ accelerations) / float(accelerations @ accelerations))
    if cause != "position" or strongest is None:
        return TransmissionSeen(error, noise, cause)
    return TransmissionSeen(error, noise, cause, 2.0 * np.pi / strongest.order, strongest.amplitude)


def _swinging(error: float, noise: float, slope: float) -> TransmissionSeen:
    """Of what follows the acceleration, s² (of the user's position): J_u α_user = K (τ θ_motor − θ_user) has −J_u/K."""
    if slope >= 0.0:
        return TransmissionSeen(error, noise, "bandwidth")
    return TransmissionSeen(error, noise, "acceleration", frequency_Hz=1.0 / (2.0 * math.pi * math.sqrt(-slope)))


def _strongest(position: Array, left: Array, actuator: Actuator) -> Order | None:
    """The order of the motor's position that tells most."""
    part = slice(None, None, -(-position.size // _MOST_SAMPLES))
    x, y = position[part], left[part]
    linear = actuator.axes.motor == "linear"
    found = pitches(x, y) if linear else orders(x, y, float(np.ptp(x)) / (2.0 * np.pi))
    return max(found, key=lambda one: one.amplitude, default=None)


def _has_both(one: Measurement) -> bool:
    has_both = "motor_position_rad" in one and "user_position_rad" in one
    return has_both and not one.is_map and "motor_position_rad" not in one.reading.made


def _left(one: Measurement, run: slice, actuator: Actuator) -> tuple[Array, ...] | None:
    """Of a run: motor's position, what is left at the user beside a zero and a delay, the same filtered as what follows
    is, acceleration at the user, direction, and the noise.
    """
    motor, user = one["motor_position_rad"][run], one["user_position_rad"][run]
    if motor.size < _LEAST_SAMPLES or np.ptp(motor) == 0.0:
        return None
    tau = actuator.transmission.gear_ratio
    motion = motion_of(motor, one.sample_period_s, actuator.filter_s)
    direction = np.sign(motion.speed) * (np.abs(motion.speed) > _SLIDES * np.max(np.abs(motion.speed)))
    allowed = np.column_stack([np.ones(motor.size), motion.speed])
    time, late = one.time_s[run], 0.0
    for _ in range(_ROUNDS):
        shifted = user - tau * np.interp(time - late, time, motor)
        late -= float(np.linalg.lstsq(allowed, shifted, rcond=None)[0][1]) / tau
    left, smooth, accelerations, directions = (
        each - allowed @ np.linalg.lstsq(allowed, each, rcond=None)[0]
        for each in (shifted, motion.filtered(shifted), tau * motion.acceleration, direction)
    )
    play = 0.5 * actuator.transmission.backlash_rad
    if play > 0.0 and np.any(directions):
        slope = float(np.clip(left @ directions / (directions @ directions), -play, play))
        left = left - slope * directions
    noise = np.hypot(sample_noise(user, "user_position_rad"), tau * sample_noise(motor, "motor_position_rad"))
    return motor, left, smooth, accelerations, directions, np.full(motor.size, noise)
