"""What is left between recordings and the model, beside the variables that may explain it; and its size in floors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.effects import find
from ema_model.estimation import Calibration, Floor
from ema_model.estimation.noise import POSITIONS, SPEED, band, least, spread
from ema_model.models import Model, Window
from ema_model.quantities import (
    MODULATORS,
    VARIABLES,
    Axes,
    Quantity,
    in_sentence,
    is_turn,
    number,
    of_residual,
    of_variable,
)
from ema_model.recordings import SIGNALS
from ema_model.simulation.pack import reduced_circuit
from ema_model.text import Severity

# --- what is left between recordings and the model, beside the variables that may explain it --------------------------
# Everything stands on short blocks, the ones that the model was fitted on.  Their means take the inverter's
# ripple away (MODEL §2) and make the noise of a 10 kHz recording √5 times smaller.

Array = NDArray[np.float64]

_STILL = 1e-3  # of the largest speed, below which the motor counts as standing


@dataclass(frozen=True, eq=False)
class Adjustable:
    """How the model's parameters could still move a signal, to first order, in σ of their tolerances.

    An explanation must tell more than they can: what a parameter within its tolerance does equally well is no
    missing physics.
    """

    columns: Array  # (blocks, unknowns), ∂signal/∂x
    x: Array  # (unknowns,), where they stand; the prior pulls them to 0
    room: tuple[Array, Array]  # (unknowns,) each, how far they may still go down and up


@dataclass(frozen=True, eq=False)
class Residuals:
    """Measurement minus model, by signal, per block, of one recording or of several joined; arrays are (blocks,).

    `variables` has those of `quantities.VARIABLES` that are known, in their units: the motor's angle not wrapped, the
    acceleration the motor's, the load at the user, the time since the recording's start.  A value that a recording
    does not have is NaN; so is a residual that a recording lacks.
    """

    time_s: Array
    values: dict[str, Array]
    sigma: dict[str, Array]  # standard deviation that a perfect model would leave: noise and model floor
    noise: dict[str, Array]  # the sensor noise's part of it
    white: dict[str, Array]  # and of that, what lasts no longer than a sample
    variables: dict[str, Array]
    recording: NDArray[np.intp]  # which of the joined recordings, from 0
    run: NDArray[np.intp]  # which run; time is continuous within one, and no run crosses recordings
    saturated: NDArray[np.bool_]  # the drive stands at its current or voltage limit: not to be counted
    block_s: float  # the blocks' length, s (the longest of the recordings')
    torque_constant: float | None = None  # N·m/A (N/A) of the motor, where current can be read as torque
    known: dict[str, Array] = field(default_factory=dict)  # the model's error that its three-phase twin shows
    adjustable: dict[str, Adjustable] = field(default_factory=dict)  # by signal, where it was fitted
    counts: Array | None = None  # how much each block counts in a mean over time; all alike without it
    alike: Array | None = None  # over how many blocks the white noise stays alike; over one without it
    is_map: bool = False  # a static map: blocks are independent and have no time

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return len(self.time_s)

    @property
    def direction(self) -> Array:
        """Sign of the motor's speed, (blocks,); 0 where it stands or is not known."""
        speed = self.variables.get("motor_speed")
        if speed is None:
            return np.zeros(self.blocks)
        speed = np.nan_to_num(speed)
        return np.where(np.abs(speed) <= _STILL * np.max(np.abs(speed), initial=0.0), 0.0, np.sign(speed))

    @property
    def turns(self) -> float:
        """Turns of the motor between its lowest and highest angle; 0 where it is not known."""
        angle = self.variables.get("motor_angle")
        known = np.zeros(0) if angle is None else angle[np.isfinite(angle)]
        return float(np.ptp(known)) / (2.0 * np.pi) if known.size else 0.0


def join(parts: Sequence[Residuals]) -> Residuals:
    """Stretches of one actuator's recordings, one after another."""
    if len(parts) == 1:
        return parts[0]

    def together(name: str, missing: float = np.nan) -> dict[str, Array]:
        keys = dict.fromkeys(key for part in parts for key in getattr(part, name))
        return {
            key: np.concatenate([getattr(part, name).get(key, np.full(part.blocks, missing)) for part in parts])
            for key in keys
        }

    first_run = np.cumsum([0, *(int(part.run.max(initial=-1)) + 1 for part in parts[:-1])])
    return Residuals(
        time_s=np.concatenate([part.time_s for part in parts]),
        values=together("values"),
        sigma=together("sigma"),
        noise=together("noise"),
        white=together("white"),
        variables=together("variables"),
        recording=np.concatenate([part.recording for part in parts]),
        run=np.concatenate([part.run + first for part, first in zip(parts, first_run)]),
        saturated=np.concatenate([part.saturated for part in parts]),
        block_s=max(part.block_s for part in parts),
        torque_constant=parts[0].torque_constant,
        known=together("known", 0.0),
        counts=np.concatenate([np.ones(part.blocks) if part.counts is None else part.counts for part in parts]),
        alike=np.concatenate([np.ones(part.blocks) if part.alike is None else part.alike for part in parts]),
        is_map=all(part.is_map for part in parts),
    )


# --- residuals beside the variables that may explain them, from a plant and what its model says -----------------------

_NEAR_LIMIT = 0.98  # of the current's limit, from which on the drive counts as saturated
_NEAR_VOLTAGE = 0.95
_SLOPE_S = 2e-3  # over which the model's speed is differentiated


def residuals_of(
    plant: Model,
    floors: Sequence[Floor],
    model: Sequence[dict[str, Array]],
    known: Sequence[dict[str, Array]],
    actuator: Actuator,
    calibration: Calibration | None = None,
) -> Residuals:
    """The residuals of all windows, joined.

    model, known: its signals, and its known error, per window; actuator: as calibrated; calibration: where it
    was fitted to these very windows.
    """
    parts = []
    for window, one, signals, error in zip(plant.windows, floors, model, known):
        names = [name for name in window.measured if name in signals]
        variables = _variables(window, signals, actuator, float(plant.measurements[window.recording].time_s[0]))
        blocks = window.blocks
        parts.append(
            Residuals(
                time_s=window.time_s,
                values={name: window.measured[name] - signals[name] for name in names},
                sigma={name: one.sigma(name) for name in names},
                noise={name: np.full(blocks, one.noise[name]) for name in names},
                white={name: one.white_part(name) for name in names},
                variables=variables,
                recording=np.full(blocks, window.recording),
                run=np.zeros(blocks, np.intp),
                saturated=_saturated(signals, actuator),
                block_s=window.block_s,
                torque_constant=actuator.motor.torque_constant_Nm_A if actuator.torque_known else None,
                known=error,
                counts=one.counts,
                alike=np.full(blocks, one.alike),
                is_map=plant.measurements[window.recording].is_map,
            )
        )
    joined = join(parts)
    return joined if calibration is None else replace(joined, adjustable=_adjustable(joined, calibration))


def _adjustable(residuals: Residuals, calibration: Calibration) -> dict[str, Adjustable]:
    """By signal, where it was fitted in all windows.

    Only the prior holds the parameters: what is missing has moved the other signals as well, and their witness
    is as doubtful.
    """
    return {
        name: Adjustable(
            np.concatenate([part[name] for part in calibration.sensitivities]), calibration.x, calibration.room
        )
        for name in residuals.values
        if calibration.x.size and all(name in part for part in calibration.sensitivities)
    }


def _saturated(signals: dict[str, Array], actuator: Actuator) -> NDArray[np.bool_]:
    """Blocks in which the current stands at its limit, or a hysteresis loop has no voltage left to follow it."""
    current, speed = signals["current_A"], signals.get("motor_speed_rad_s")
    saturated = np.abs(current) >= _NEAR_LIMIT * actuator.current_limit_A
    if speed is not None and actuator.has_reference_model:
        circuit = reduced_circuit(actuator)
        emf = actuator.motor.torque_constant_Nm_A * speed
        saturated |= np.abs(circuit.resistance_Ohm * current + emf) >= _NEAR_VOLTAGE * circuit.voltage_V
    return saturated


def _variables(window: Window, signals: dict[str, Array], actuator: Actuator, start_s: float) -> dict[str, Array]:
    """All that were recorded, positions as measured, the rest from the model, which has no noise."""
    tau = actuator.transmission.gear_ratio
    if window.command is None:
        angle, speed = window.context["motor_position_rad"], window.context["motor_speed_rad_s"]
        acceleration = window.context["acceleration_rad_s2"]
        variables: dict[str, Array] = {}
        is_in_time = bool(np.any(acceleration))  # and no static map
        if is_in_time or np.any(angle):
            variables = {} if actuator.axes.motor == "linear" else {"motor_angle": angle}
            if actuator.axes.motor == "linear" or tau != 1.0:
                variables["user_position"] = tau * angle
        if np.any(speed):
            variables["motor_speed"] = speed
        if is_in_time:
            variables |= {"acceleration": acceleration, "time": window.time_s - start_s}
        if np.any(speed) or "load_torque_Nm" in window.context:
            variables["current"] = signals["current_A"]
        user = tau * angle
    else:
        speed = signals["motor_speed_rad_s"]
        half = max(1, round(_SLOPE_S / window.block_s))
        user = window.measured.get("user_position_rad", signals["user_position_rad"])
        variables = {
            "user_position": user,
            "motor_speed": speed,
            "acceleration": _slope(speed, half, window.block_s),
            "time": window.time_s - start_s,
        }
        if "current_A" in window.measured:
            variables["current"] = signals["current_A"]
        if "motor_position_rad" in window.measured and actuator.axes.motor == "rotary":
            variables["motor_angle"] = window.measured["motor_position_rad"]
    loads = [window.context.get("load_torque_Nm"), _modelled_load(actuator, user)]
    known = [load for load in loads if load is not None]
    if known:
        variables["load"] = np.sum(known, axis=0)
    if "temperature_C" in window.context:
        variables["temperature"] = window.context["temperature_C"]
    return variables


def _modelled_load(actuator: Actuator, user: Array) -> Array | None:
    """Load at the user, N·m, from the actuator's own load effects."""
    tau = actuator.transmission.gear_ratio
    total = None
    for name, settings in actuator.effects.items():
        effect = find(name)
        if not effect.is_load:
            continue
        for place in effect.places:
            if place.__name__ == "shaft_torque":
                pulls = [place(0.0, u / tau, 0.0, 0.0, u, tau, 0.0, 0.0, *settings.values()) for u in user]
                total = (0.0 if total is None else total) - np.array(pulls) / tau
    return total


def _slope(values: Array, half: int, step_s: float) -> Array:
    """Least-squares slope over `half` blocks on either side."""
    half = max(1, min(half, (len(values) - 1) // 2))
    taps = np.arange(half, -half - 1, -1) / (step_s * 2.0 * np.sum(np.arange(1, half + 1) ** 2))
    padded = np.concatenate(
        [2.0 * values[0] - values[half:0:-1], values, 2.0 * values[-1] - values[-2 : -half - 2 : -1]]
    )
    return np.convolve(padded, taps, mode="valid")


# --- findings in plain words, with numbers and units ------------------------------------------------------------------

OPEN_LOOP = (
    "In open loop the noise of what is put in adds up in the motion, which the floor does not count: an error of some "
    "floors may be that alone, and a small effect is not told from it. Where the motor's position and current are "
    "recorded, discovery puts the motion in instead."
)


def dependence(variable: str, modulator: str) -> str:
    """'motor speed and direction'."""
    return f"{VARIABLES[variable].noun}{MODULATORS[modulator].noun}"


def explanation_sentence(signal: str, variable: str, modulator: str, r2: float) -> str:
    """One line on what explains a residual, and how much of it."""
    share = f"{100.0 * r2:.0f} % of the residual {in_sentence(SIGNALS[signal].title)} variance"
    return f"{share} is explained by {dependence(variable, modulator)} (cross-validated)."


def order_sentence(order: float, amplitude: float, of: Quantity) -> str:
    """One line on an order of the residual, with its amplitude in SI units."""
    times = "once" if order == 1 else f"{order:g} times"
    return f"What is missing repeats {times} a turn with an amplitude of {of.scaled(amplitude).text(amplitude)}."


def event_sentence(signal: str, axes: Axes, recording: str, time_s: float, change: float, by_direction: bool) -> str:
    """One line on a step of a signal at one moment of a recording; change: measured less model, after less before."""
    told = of_residual(signal, axes, None)
    size, title = told.scaled(change).text(abs(change)), in_sentence(SIGNALS[signal].title)
    when = f"From {number(time_s)} s of {recording or 'the recording'} on"
    higher = "higher" if change > 0.0 else "lower"
    if by_direction:
        return f"{when}, the {title} is {size} {higher} in the direction of motion than before: a change of friction."
    if SIGNALS[signal].kind in ("current", "torque", "force"):
        return (
            f"{when}, the {title} is {size} {higher} than before: a load that came on or off, or a sensor that jumped."
        )
    return f"{when}, the {title} is {size} {higher} than before: a position sensor that jumped."


def region_sentence(
    signal: str,
    variable: str,
    low: float,
    high: float,
    typical: float,
    mean: float,
    direction: int,
    *,
    torque_constant: float | None,
    axes: Axes,
    duration_s: float,
    slow: bool,
    details: str = "",
) -> str:
    """One line on a region: what the motor needs more or less there, or how far a position is off.

    mean: of measurement − model; direction: ±1 where all of the region moves one way, else 0; typical: the
    variable's mean there; slow: the region is that of reversals; details: what else is said
    of the place.
    """
    where = _where(variable, low, high, typical, axes, duration_s, slow) + (f" ({details})" if details else "")
    moving = ""
    if direction and (slow or variable != "motor_speed"):  # a speed has the direction in its sign
        moving = " when it moves forward" if direction > 0 else " when it moves back"
    told = of_residual(signal, axes, torque_constant)
    size = told.scaled(mean).text(abs(mean))
    if SIGNALS[signal].kind in ("current", "torque", "force"):
        what = told.title.rpartition(" ")[2]
        if direction:
            more = "more" if mean * direction > 0.0 else "less"
            return f"The motor needs {size} {more} {what} {where}{moving} than the model."
        way = "forward" if mean > 0.0 else "backward"
        return f"The motor needs {size} more {what} {way} {where} than the model."
    title = in_sentence(SIGNALS[signal].title)
    if SIGNALS[signal].kind == "position":
        behind = direction and mean * direction < 0.0
        side = ("behind" if behind else "ahead of") if direction else ("above" if mean > 0.0 else "below")
        return f"The {title} is {size} {side} the model {where}{moving}."
    return f"The {title} is {size} {'above' if mean > 0 else 'below'} the model {where}{moving}."


def range_text(variable: str, low: float, high: float, axes: Axes, digits: int = 3) -> str:
    """'from 250 to 350 rad/s'."""
    told = of_variable(variable, axes)
    told = told if is_turn(variable, axes) else told.scaled([low, high])
    ends = [number(told.factor * end, digits) for end in (low, high)]
    return f"from {ends[0]} to {ends[1]} {told.unit}".rstrip()


def _where(variable: str, low: float, high: float, typical: float, axes: Axes, duration_s: float, slow: bool) -> str:
    told = of_variable(variable, axes)
    if is_turn(variable, axes):
        return f"between {told.factor * low:.0f}° and {told.factor * high:.0f}° of the motor's turn"
    if variable == "motor_speed" and slow:
        return "at reversals and standstill"
    if variable == "time":
        part = ""
        if duration_s > 0.0:
            part = " (the start)" if high < 0.2 * duration_s else " (the end)" if low > 0.8 * duration_s else ""
        told = told.scaled(high)
        return f"from {number(told.factor * low)} to {told.text(high)}{part}"
    return f"{VARIABLES[variable].place}{told.scaled(typical).text(float(f'{typical:.3g}'))}"


# --- an error in floors beside what a true model's is: the one place of its number, its words, and its colour ---------

_FAR = 2.0  # floors, from which on an error stands out, where a true model's is not as large


@dataclass(frozen=True)
class OverFloor:
    """rms of measurement − model over the floor of the same moment: 1 is the floor.

    Whether it is above its band is decided by the digits that are shown, so that words, colours and numbers agree.
    """

    error: float = math.nan
    band: tuple[float, float] = (math.nan, math.nan)  # between which nine of ten true models' errors lie

    @property
    def text(self) -> str:
        """'1.08'."""
        return number(self.error)

    @property
    def band_text(self) -> str:
        """'0.96 to 1.04'."""
        low, high = self.band
        return f"{low:.2f} to {high:.2f}"

    @property
    def is_above(self) -> bool:
        """Whether more is left than nine of ten true models leave."""
        return round(self.error, 2) > round(self.band[1], 2)

    @property
    def is_below(self) -> bool:
        """Whether less is left than they leave, so that the floor is estimated too high."""
        return round(self.error, 2) < round(self.band[0], 2)

    @property
    def severity(self) -> Severity:
        """Good up to the end of its band."""
        if math.isnan(self.error):
            return "note"
        return "good" if not self.is_above else "warning" if self.error < _FAR else "bad"

    @property
    def more(self) -> str:
        """'8 % more is left than noise explains' of a true model's error; "" where no more is."""
        if not self.is_above:
            return ""
        much = f"{100.0 * (self.error - 1.0):.0f} % more" if self.error < _FAR else "more"
        return f"{much} is left than noise explains"

    @property
    def beside_band(self) -> str:
        """'1.08 times the floor; a true model's is 0.96 to 1.04 (90 % interval): 8 % more is left than …'"""
        told = f"{self.text} times the floor; a true model's is {self.band_text} (90 % interval)"
        if self.is_below:
            return f"{told}: the floor is estimated too high"
        return f"{told}: {self.more}" if self.more else told


UNKNOWN = OverFloor()


def is_counted(signal: str, among: Sequence[str]) -> bool:
    """Whether a signal's error is pooled: a speed is mostly a position's difference, and counts where there is none."""
    return signal != SPEED or not set(POSITIONS) & set(among)


def squares(residuals: Residuals, signal: str, among: NDArray[np.bool_] | None = None) -> tuple[float, float]:
    """Sum of the squared error over the floor, and of what its blocks count; none at the drive's limits.

    among: (blocks,), those to take; all without it.
    """
    used = np.isfinite(residuals.values[signal]) & ~residuals.saturated
    used = used if among is None else used & among
    weights = (np.ones(residuals.blocks) if residuals.counts is None else residuals.counts)[used]
    ratio = residuals.values[signal][used] / residuals.sigma[signal][used]
    return float(weights @ ratio**2), float(weights.sum())


def ratio(residuals: Residuals, signals: Sequence[str], among: NDArray[np.bool_] | None = None) -> float:
    """rms of the error over its floor, pooled over signals; 0 where nothing is counted."""
    squared, counted = np.sum([squares(residuals, name, among) for name in signals], axis=0)
    return float(np.sqrt(squared / counted)) if counted else 0.0


def by_signal(
    residuals: Residuals, windows: Sequence[Window], floors: Sequence[Floor], recording: int | None = None
) -> dict[str, OverFloor]:
    """The error of each signal alone, with its own band; recording: the one, from 0, that counts; all without it."""
    parts = [(one, part) for one, part in zip(windows, floors) if recording in (None, one.recording)]
    among = None if recording is None else residuals.recording == recording
    found = {}
    for name in residuals.values:
        its = [part for window, part in parts if name in window.measured]
        if its and squares(residuals, name, among)[1]:
            names = [[name]] * len(its)
            found[name] = OverFloor(ratio(residuals, [name], among), band(spread(its, names), least(its, names)))
    return found
