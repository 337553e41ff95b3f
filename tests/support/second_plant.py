"""The thesis's actuator written a second time, from its equations alone: nothing of `ema_model` takes part.

Other than the model's: vectors in place of rows, half the step, Heun's rule in place of Euler's, hysteresis relays that
are asked at the step's end.  T 3.x are the thesis's sections.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np

STEP_S = 5e-7
SAMPLE_S = 1e-4
CHIRP_RAD, CHIRP_HZ_S = 5e-3, 30.0  # 0 → 15 Hz in 0.5 s
_THIRDS = 2.0 * np.pi / 3.0 * np.arange(3)


@dataclass(frozen=True)
class SecondPlant:
    """One actuator with these eight faults; SI units, at the motor."""

    k: tuple[float, ...]

    def recorded(self, seconds: float, noise_A: float, seed: int) -> dict[str, np.ndarray]:
        """Columns of a log at 10 kHz: each current is the mean over its sample, positions are the sample's."""
        samples = round(seconds / SAMPLE_S)
        time, command, user, motor, speed, current = _run(np.array(self.k), samples, round(SAMPLE_S / STEP_S))
        noise = noise_A * np.random.default_rng(seed).standard_normal(samples)
        return {
            "time_s": time,
            "command_rad": command,
            "user_position_rad": user,
            "motor_position_rad": motor,
            "motor_speed_rad_s": speed,
            "current_A": current + noise,
        }


@numba.njit(error_model="numpy", cache=True)
def _slopes(currents, omega, theta, volts, turns, zeta, phi):
    """dI/dt (3,) of the floating star, and the torque of its three phases (T 3.3 to 3.5)."""
    electric = 2.0 * theta
    shape = -turns * np.sin(electric - _THIRDS) * (1.0 + zeta * np.cos(theta - phi + _THIRDS))
    emf = math.sqrt(2.0) * 0.0376 * shape * omega
    ohm, henry = 1.065 * turns, 0.36e-3 * turns**2
    free = (volts - ohm * currents - emf) / henry
    star = free.sum() / (1.0 / henry).sum()
    torque = 2.0 * 0.0376 * (shape * currents).sum()
    return free - star / henry, min(max(torque, -1.689), 1.689)


@numba.njit(error_model="numpy", cache=True)
def _run(k, samples, steps):
    turns = np.maximum(1.0 - k[2:5], 0.02)
    zeta, phi = k[5], 2.0 * math.pi * (k[6] - 0.5)
    static, dynamic = 0.10134 * (1.0 + 2.0 * k[0]), 0.05067 * (1.0 + 2.0 * k[0])
    half_play = 0.5 * 5e-3 * (1.0 + 99.0 * k[1])
    gain = 1e5 * (0.5 + k[7])
    inertia, viscous, ratio = 1.3e-5, 9.549e-6 + 4.507e-7, 1.0 / 500.0
    currents, relays = np.zeros(3), np.ones(3)
    theta = omega = output = 0.0
    found = np.zeros((6, samples))
    for n in range(samples):
        total = 0.0
        for m in range(steps):
            t = (n * steps + m) * STEP_S
            command = CHIRP_RAD * math.sin(math.pi * CHIRP_HZ_S * t * t)
            wanted = min(max(gain * (command - ratio * output), -837.758), 837.758)
            reference = min(max(0.05 * (wanted - omega) / 0.0752, -22.5), 22.5)
            if m == 0:
                found[0, n], found[1, n] = t, command
                found[2, n], found[3, n], found[4, n] = ratio * output, theta, omega
            asked = -2.0 / 3.0 * reference * np.sin(2.0 * theta - _THIRDS)
            for i in range(3):
                if currents[i] < asked[i] - 0.25:
                    relays[i] = 1.0
                elif currents[i] > asked[i] + 0.25:
                    relays[i] = -1.0
            volts = 24.0 * relays
            slope, torque = _slopes(currents, omega, theta, volts, turns, zeta, phi)
            middle = currents + 0.5 * STEP_S * slope
            slope, torque = _slopes(middle, omega, theta + 0.5 * STEP_S * omega, volts, turns, zeta, phi)
            currents = currents + STEP_S * slope
            active = torque - viscous * omega
            if omega == 0.0:
                net = active - min(max(active, -static), static)
            else:
                net = active - math.copysign(dynamic, omega)
            after = omega + STEP_S * net / inertia
            if after * omega < 0.0:
                after = 0.0  # it sticks, and is asked again
            theta += 0.5 * STEP_S * (omega + after)
            omega = after
            output = min(max(output, theta - half_play), theta + half_play)
            electric = 2.0 * theta
            total += (-currents[0] + 0.5 * (currents[1] + currents[2])) * math.sin(electric)
            total += 0.5 * math.sqrt(3.0) * (currents[1] - currents[2]) * math.cos(electric)
        found[5, n] = total / steps
    return found
