"""The transmission by itself: the user's position beside what the file makes of the motor's, and two masses behind it.

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
from ema_model.recordings.signals import sample_noise

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


# --- two masses joined by a spring, seen in the motor alone -----------------------------------------------------------
# A motor J₁ that carries a load J₂ on a shaft of stiffness K (viscous losses D₁ of both masses, as one, and D of the
# shaft) answers a torque T with α/T = (s² + 2ζ_a ω_a s + ω_a²) / (s² + 2ζ_r ω_r s + ω_r²) / J₁, ω_a² = K/J₂, ω_r² = K
# (1/J₁ + 1/J₂): at the antiresonance the load swings alone and holds the motor, at the resonance both swing against
# each other (Ellis, Control System Design Guide, 2012, ch. 16). A model of one mass has 1/J at all frequencies. No
# model is needed to see it: the frequency response is estimated by Welch's method, H = S_Tα/S_TT, and counts by its
# coherence γ², which says how much of the motion follows the torque: of n pieces, |H| is known to √((1 − γ²)/(2 n γ²))
# of itself (Bendat and Piersol, Random Data, 2010, ch. 9).

Complex = NDArray[np.complex128]

_PIECE_S = (2.0, 1.0, 0.5, 0.25)  # lengths of Welch's pieces
_LEAST_PIECES = 4
_COHERENT = 0.5  # γ², from which on a frequency counts
_BETWEEN = 0.1  # the same between the two, where the motor hardly moves
_LEAST_LINES = 12  # frequencies that count
_DEEP = 2.0  # times, by which α/T at the antiresonance is below and at the resonance above what is around
_BETTER = 0.3  # of the squared error of one mass, that two must come down to
_MOST_RATIO = 5.0  # resonance over antiresonance: a load of 24 times the motor's inertia
_LEAST_ERROR = 0.03  # of |H|: what Welch's pieces leave of a sharp peak
_MOST_DAMPING = 0.5
_MOST_TRIALS = 200  # of a fit


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Acceleration of the motor over its torque, all arrays (lines,)."""

    frequency_Hz: Array
    response: Complex  # rad/s² per N·m; of a linear motor m/s² per N
    coherence: Array  # γ²
    pieces: float  # independent ones that were averaged

    @property
    def error(self) -> Array:
        """Standard error of |H|, relative."""
        own = np.sqrt((1.0 - self.coherence) / (2.0 * self.pieces * np.maximum(self.coherence, 1e-6)))
        return np.hypot(own, _LEAST_ERROR)


@dataclass(frozen=True)
class TwoMasses:
    """Two masses joined by a spring, seen in the motor alone, from torque to speed."""

    antiresonance_Hz: Annotated[float, Meta(description="at which the load swings alone and holds the motor")]
    resonance_Hz: Annotated[float, Meta(description="at which motor and load swing against each other")]
    inertia_ratio: Annotated[float, Meta(description="the load's inertia over the motor's")]
    stiffness: Annotated[  # of the torque as the file scales it
        float, Meta(description="of what joins them, at the motor: N·m/rad, of a linear motor N/m")
    ]
    coherence: Annotated[float, Meta(description="of the motion with the torque, mean over the frequencies that count")]

    @property
    def short(self) -> str:
        """What a headline says of it."""
        low, high = number(self.antiresonance_Hz), number(self.resonance_Hz)
        return f"an antiresonance at {low} Hz and a resonance at {high} Hz: two masses joined by a spring"

    def sentence(self, actuator: Actuator) -> str:
        """What is seen, and what it would be."""
        unit = "N/m" if actuator.axes.motor == "linear" else "N·m/rad"
        mass = "mass" if actuator.axes.motor == "linear" else "inertia"
        return (
            f"From torque to speed the motor shows {self.short}; the load would have {number(self.inertia_ratio, 2)} "
            f"times the motor's {mass}, on a stiffness of {number(self.stiffness, 2)} {unit} at the motor (torsional "
            "compliance). A model without a controller holds one mass: a closed or open loop could hold both."
        )


def two_masses_seen(measurements: Sequence[Measurement], actuator: Actuator) -> TwoMasses | None:
    """What recordings of the motor's torque or current, and its motion, show of a second mass; None where they do not.

    All recordings together, in the longest of several pieces that show it: they tell frequencies apart, short ones are
    many.
    """
    found = (_of(frequency_response(measurements, actuator, piece_s)) for piece_s in _PIECE_S)
    return next((one for one in found if one is not None), None)


def frequency_response(
    measurements: Sequence[Measurement], actuator: Actuator, piece_s: float
) -> FrequencyResponse | None:
    """By Welch's method with half overlapping pieces of that length; None where there are too few of them."""
    from scipy.signal import csd, welch  # takes a while to import

    sums: list[Array | Complex] = []
    frequency, total = np.zeros(0), 0.0
    runs = [(one, run) for one in measurements if not one.is_map for run in one.runs]
    rates = {round(1.0 / one.sample_period_s, 6) for one, _ in runs}
    if len(rates) != 1:
        return None
    rate = rates.pop()
    size = round(piece_s * rate)
    for one, run in runs:
        torque, speed = _torque(one, run, actuator), _speed(one, run)
        if torque is None or speed is None or torque.size < 2 * size or size < 32:
            continue
        pieces = 2.0 * torque.size / size - 1.0
        frequency, cross = csd(torque, speed, rate, nperseg=size, detrend="linear")
        powers = [welch(each, rate, nperseg=size, detrend="linear")[1] for each in (torque, speed)]
        new = [pieces * each for each in (cross, *powers)]
        sums = [old + more for old, more in zip(sums, new)] if sums else new
        total += pieces
    if total < _LEAST_PIECES:
        return None
    cross, torque2, speed2 = sums
    kept = slice(1, frequency.size - 1)
    omega = 2.0 * np.pi * frequency[kept]
    coherence = np.abs(cross) ** 2 / np.maximum(np.real(torque2) * np.real(speed2), 1e-300)
    response = 1j * omega * cross[kept] / np.maximum(np.real(torque2[kept]), 1e-300)
    return FrequencyResponse(frequency[kept], response, np.real(coherence[kept]), 0.6 * total)


def _torque(one: Measurement, run: slice, actuator: Actuator) -> Array | None:
    if "motor_torque_Nm" in one:
        return one["motor_torque_Nm"][run]
    return actuator.motor.torque_constant_Nm_A * one["current_A"][run] if "current_A" in one else None


def _speed(one: Measurement, run: slice) -> Array | None:
    """As recorded, or of the motor's position."""
    if "motor_speed_rad_s" in one:
        return one["motor_speed_rad_s"][run]
    return np.gradient(one["motor_position_rad"][run], one.sample_period_s) if "motor_position_rad" in one else None


def _of(seen: FrequencyResponse | None) -> TwoMasses | None:
    """The two masses that a frequency response shows; None where one tells it as well."""
    if seen is None:
        return None
    strong = np.flatnonzero(seen.coherence > _COHERENT)
    if strong.size < _LEAST_LINES:
        return None
    band = slice(strong[0], strong[-1] + 1)
    known = seen.coherence[band] > _BETWEEN
    frequency, response = seen.frequency_Hz[band][known], seen.response[band][known]
    weight = 1.0 / seen.error[band][known]
    best = _two(frequency, response, weight)
    if best is None:
        return None
    one, two, (low, high, per_mass) = best
    size = np.abs(response)
    around = per_mass * (low / high) ** 2, per_mass  # of both masses, below; of the motor's alone, above
    deep = np.min(size[np.abs(frequency / low - 1.0) < 0.1], initial=np.inf) < around[0] / _DEEP
    high_up = np.max(size[np.abs(frequency / high - 1.0) < 0.1], initial=0.0) > _DEEP * around[1]
    if two > _BETTER * one or not (deep and high_up):
        return None
    omega, ratio = 2.0 * np.pi * low, (high / low) ** 2 - 1.0
    coherence = float(np.mean(seen.coherence[band][known]))
    return TwoMasses(low, high, ratio, ratio / per_mass * omega**2, coherence)


def _two(frequency: Array, response: Complex, weight: Array) -> tuple[float, float, tuple[float, float, float]] | None:
    """Squared errors of ln H of one mass and of two, and of these f_a, f_r in Hz and 1/J₁; None where none is within.

    One mass has viscous friction and a delay of the torque, and so have two.
    """
    from scipy.optimize import least_squares  # takes a while to import

    size, omega = np.abs(response), 2.0 * np.pi * frequency
    s = 1j * omega

    def left(model: Complex) -> Array:
        apart = np.log(response / model)
        return np.concatenate([np.real(apart) * weight, np.angle(np.exp(1j * np.imag(apart))) * weight])

    def rigid(x: Array) -> Complex:
        return np.exp(x[0]) * s / (s + np.exp(x[1])) * np.exp(-s * x[2])

    def flexible(x: Array) -> Complex:
        a, r, loss_a, loss_r = np.exp(x[3:7])
        up, down = s * s + 2.0 * loss_a * a * s + a * a, s * s + 2.0 * loss_r * r * s + r * r
        return rigid(x[:3]) * up / down

    middle = float(np.median(np.log(size)))
    start = [middle, np.log(0.1 * omega[0]), 0.0]
    plain = least_squares(lambda x: left(rigid(x)), start, loss="soft_l1", max_nfev=_MOST_TRIALS)
    found, least = None, np.inf
    order = np.argsort(size)
    for at in order[:5]:  # the deepest lines, and the highest beyond each
        beyond = np.flatnonzero((frequency > 1.02 * frequency[at]) & (frequency < _MOST_RATIO * frequency[at]))
        if not beyond.size:
            continue
        top = beyond[int(np.argmax(size[beyond]))]
        above = np.log(omega[[at, top]])
        begin = np.array([middle, start[1], 0.0, *above, np.log(0.03), np.log(0.03)])
        try:
            fit = least_squares(lambda x: left(flexible(x)), begin, loss="soft_l1", max_nfev=_MOST_TRIALS)
        except ValueError:  # it went beyond all bounds
            continue
        a, r, loss_a, loss_r = np.exp(fit.x[3:7])
        within = omega[0] < a < r < omega[-1] and r < _MOST_RATIO * a and max(loss_a, loss_r) < _MOST_DAMPING
        if within and fit.cost < least:
            least = fit.cost
            found = float(a / (2.0 * np.pi)), float(r / (2.0 * np.pi)), float(np.exp(fit.x[0]))
    return None if found is None else (float(plain.cost), float(least), found)
