"""A DC gearmotor on a bench: duty in, speed out; by hand, of none of the product's code.

R i = d V − k ω (or L di/dt with an inductance), J dω/dt = k i − B ω − T_0 − C sgn ω, which holds the motor at rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Bench:
    """SI units throughout."""

    bus_V: float = 12.0
    resistance_Ohm: float = 5.0
    inductance_H: float = 0.0
    torque_constant_Nm_A: float = 0.0105
    inertia_kgm2: float = 1.6e-6
    viscous_Nms_rad: float = 1.5e-6
    dry_Nm: float = 1.1e-3
    load_Nm: float = 0.0
    late_s: float = 0.0  # by which a duty takes effect

    def run(self, time_s: Array, duty: Array, speed_rad_s: float = 0.0, substeps: int = 20) -> tuple[Array, Array]:
        """Speed at each time, and the current's mean since the one before, under a duty held from its sample on."""
        dt = (time_s[1] - time_s[0]) / substeps
        omega, current, total = speed_rad_s, 0.0, 0.0
        speeds, currents = np.empty(len(time_s)), np.empty(len(time_s))
        for n, at in enumerate(time_s):
            speeds[n], currents[n], total = omega, total / substeps, 0.0
            for m in range(substeps):
                then = at + m * dt - self.late_s
                held = duty[max(0, int(np.searchsorted(time_s, then + 1e-9, side="right")) - 1)]
                volts = held * self.bus_V
                if self.inductance_H:
                    rise = volts - self.resistance_Ohm * current - self.torque_constant_Nm_A * omega
                    current += dt / self.inductance_H * rise
                else:
                    current = (volts - self.torque_constant_Nm_A * omega) / self.resistance_Ohm
                pull = self.torque_constant_Nm_A * current - self.viscous_Nms_rad * omega - self.load_Nm
                if omega == 0.0:
                    pull = np.sign(pull) * max(0.0, abs(pull) - self.dry_Nm)
                else:
                    pull -= self.dry_Nm * np.sign(omega)
                after = omega + dt * pull / self.inertia_kgm2
                omega = 0.0 if after * omega < 0.0 else after
                total += current
        return speeds, currents

    @property
    def time_constant_s(self) -> float:
        """R J/(k² + R B), of the speed."""
        k, r = self.torque_constant_Nm_A, self.resistance_Ohm
        return r * self.inertia_kgm2 / (k * k + r * self.viscous_Nms_rad)


def staircase(time_s: Array, seed: int, dwell_s: float = 0.15, *, turns: bool = True) -> Array:
    """A duty of random steps, between −1 and 1 or above 0 alone."""
    generator = np.random.default_rng(seed)
    levels = generator.uniform(-1.0 if turns else 0.2, 1.0, int(time_s[-1] / dwell_s) + 2)
    return levels[(time_s / dwell_s).astype(int)]


def logged(
    bench: Bench, seed: int, noise_rad_s: float = 2.0, rate_Hz: float = 1000.0, duration_s: float = 1.5, **how: bool
):
    """time_s, duty and motor_speed_rad_s of a run that begins in motion, as a bench logs them."""
    time_s = np.arange(int(duration_s * rate_Hz)) / rate_Hz
    duty = staircase(time_s, seed, **how)
    speed, _ = bench.run(time_s, duty, 150.0)
    noise = noise_rad_s * np.random.default_rng(seed + 1000).standard_normal(len(time_s))
    return {"time_s": time_s, "duty": duty, "motor_speed_rad_s": speed + noise}
