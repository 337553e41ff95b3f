"""Residuals beside the variables that may explain them, from a plant and what its model says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.comparison.residuals import Adjustable, Residuals, join
from ema_model.effects import find
from ema_model.estimation import Calibration, Floor
from ema_model.models import Model, Window
from ema_model.simulation.pack import reduced_circuit

Array = NDArray[np.float64]

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
        moves = bool(np.any(speed))
        variables = {} if actuator.axes.motor == "linear" else {"motor_angle": angle}
        if actuator.axes.motor == "linear" or tau != 1.0:
            variables["user_position"] = tau * angle
        if moves:
            variables |= {"motor_speed": speed, "acceleration": acceleration, "time": window.time_s - start_s}
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
