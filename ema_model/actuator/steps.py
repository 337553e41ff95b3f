"""How long the model's steps and the filter of a measured motion are: by the drive, its loop and the sampling."""

from __future__ import annotations

import math

from ema_model.actuator.actuator import Actuator

SHORTEST_S, LONGEST_S = 1e-7, 1.0  # that a file may say
_STEPS_A_PERIOD = 50.0  # of the loop's own oscillation
_LONGEST_STEP_S = 5e-4  # of a position loop: friction lets go and catches at a step
_COARSEST_STEP_S, _COARSEST_SHARE = 1e-4, 0.05  # or of a sample's period, whichever is longer
_SAMPLES_A_FILTER = 3.0  # to either side, over which a measured motion is differentiated at least


def reader_step(controller: str, inverter: str) -> float:
    """The step, s, of a file that says none.

    Chopping takes steps of 10 µs; of a drive that has its current at once, only the motion is simulated.
    """
    return 5e-5 if inverter == "current" and controller != "unknown" else Actuator.step_s


def usual_filter(sample_rate_Hz: float | None) -> float:
    """Half width, s, over which a measured motion is differentiated: the reader's own, and three samples at least."""
    least_s = float(f"{_SAMPLES_A_FILTER / sample_rate_Hz:.3g}") if sample_rate_Hz else 0.0
    return min(max(Actuator.filter_s, least_s), LONGEST_S)


def usual_step(actuator: Actuator, sample_rate_Hz: float | None = None) -> float:
    """The step, s, that an actuator with a simulated loop needs.

    A position loop takes fifty steps in a period of its fastest motion, and 0.5 ms at most; what the reader takes for
    the other kinds is the most for them, and a speed loop needs fifty steps, too.  1, 2 or 5 · 10ⁿ s, 10 µs at least.
    No step is longer than what recordings of that rate are simulated with.
    """
    controller, inverter = actuator.controller.kind, actuator.inverter.kind
    is_slow = controller == "position" or actuator.takes_voltage
    longest = _LONGEST_STEP_S if is_slow else reader_step(controller, inverter)
    rate = loop_rate(actuator)
    if rate > 0.0:
        longest = min(longest, math.tau / (_STEPS_A_PERIOD * rate))
    if sample_rate_Hz:
        longest = min(longest, coarsest_step(1.0 / sample_rate_Hz))
    power = 10.0 ** math.floor(math.log10(longest) + 1e-9)
    digit = max(digit for digit in (1.0, 2.0, 5.0) if digit * power <= longest * (1.0 + 1e-9))
    return max(Actuator.step_s, float(f"{digit * power:.0e}"))


def coarsest_step(period_s: float) -> float:
    """The longest step, s, that recordings with a sample every period_s are simulated with.

    Where something sticks, it does so at a step: with coarser ones the error is too rough to go downhill on (fits of a
    hobby servo, a sample every 2 ms, ended up to 300 apart in χ² with steps of 0.5 ms, within 40 with 0.1 ms).
    """
    return max(_COARSEST_STEP_S, _COARSEST_SHARE * period_s)


def loop_rate(actuator: Actuator) -> float:
    """The fastest rate of the closed loop on its inertia, 1/s; 0 where nothing is closed.

    Of a cascade that of the speed loop, K_P/J.  Of a position loop the oscillation √(g τ T/J), where the gain g asks
    for the drive's greatest torque T, or the decay (B + k_t²/R)/J with a voltage drive, whichever is faster; of a
    voltage that is put in the decay alone.
    """
    motor, controller, inverter = actuator.motor, actuator.controller, actuator.inverter
    if controller.kind == "cascade":
        return controller.speed_gain_Nms_rad / motor.inertia_kgm2
    if controller.kind != "position" and not actuator.takes_voltage:
        return 0.0
    most = float(inverter.current_limit_A) * motor.torque_constant_Nm_A
    decay = motor.viscous_friction_Nms_rad
    if inverter.kind == "voltage":
        most = inverter.bus_voltage_V / motor.resistance_Ohm * motor.torque_constant_Nm_A
        decay += motor.torque_constant_Nm_A**2 / motor.resistance_Ohm
    stiffness = controller.gain_1_rad * actuator.transmission.gear_ratio * most * controller.output_limit
    return max(math.sqrt(stiffness / motor.inertia_kgm2), decay / motor.inertia_kgm2)
