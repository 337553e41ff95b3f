"""A position servo with an arm, simulated without the project's models: to check what they say of real logs."""

from __future__ import annotations

import numpy as np

from ema_model.actuator import Actuator
from ema_model.recordings import Measurement

_STEP_S = 5e-4


def error_by_hand(actuator: Actuator, measurement: Measurement, mesh: float = 0.0) -> float:
    """rms of what the servo's own goal makes of its position, rad, against the log.

    V = V_bus clip(K (goal − q)); T = k (V − k ω)/R; J dω/dt = T − C ω − m sin(q − φ) − L sgn ω, where
    L = T_d + μ |T − C ω − L sgn ω|, found by substitution, holds at rest what pulls less.
    """
    value = actuator.value
    signals = measurement.signals
    logged = signals["time_s"] - signals["time_s"][0]
    time = np.arange(0.0, logged[-1], _STEP_S)
    goals, volts = (np.interp(time, logged, signals[name]) for name in ("command_rad", "bus_voltage_V"))
    gain = actuator.for_recording(measurement.name).controller.gain_1_rad
    constant, resistance = value("motor.torque_constant_Nm_A"), value("motor.resistance_Ohm")
    inertia, viscous = value("motor.inertia_kgm2"), value("motor.viscous_friction_Nms_rad")
    dry = value("motor.dynamic_friction_Nm")
    moment, hangs = value("effects.pendulum_load.moment_Nm"), value("effects.pendulum_load.angle_rad")
    q, omega = float(signals["user_position_rad"][0]), 0.0
    shown = np.empty_like(time)
    on = np.interp(time, logged, signals["drive_enabled"]) > 0.5
    for n, (goal, bus) in enumerate(zip(goals, volts)):
        shown[n] = q
        duty = min(1.0, max(-1.0, gain * (goal - q)))
        current = (duty * bus - constant * omega) / resistance if on[n] else 0.0
        carries = constant * current - viscous * omega
        pulls = carries - moment * np.sin(q - hangs)
        side = np.sign(omega if omega != 0.0 else pulls)
        level = dry
        for _ in range(20):
            level = dry + mesh * abs(carries - level * side)
        if omega == 0.0 and abs(pulls) <= level:
            continue
        faster = omega + _STEP_S * (pulls - level * side) / inertia
        omega = 0.0 if faster * omega < 0.0 else faster
        q += _STEP_S * omega
    late = logged - value("sensors.delay_s")
    return float(np.sqrt(np.mean((np.interp(late, time, shown) - signals["user_position_rad"]) ** 2)))
