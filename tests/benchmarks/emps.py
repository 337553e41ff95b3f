"""EMPS without the project's models: what a simulation in open loop leaves of both records, and what an offset does.

    python tests/benchmarks/emps.py DATA     # DATA/emps as `emaviz data emps` makes it

Janot's published parameters, and least squares as in his scripts (Script_IDIM_LS.m, Script_IDIM_LS_Asym_Fric.m:
central differences of a position through a Butterworth filter of 100 Hz, both ways), simulated by steps of 0.25 ms from
the first sample at rest.  rms of the position's error, mm; and the same with the constant force that suits the record
best, which whoever is tested must not know.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.signal import butter, filtfilt

Array = NDArray[np.float64]
FORCE_N_V = 35.15065188248547
STEP_S, SUBSTEPS = 1e-3, 4
# M, then viscous and Coulomb friction forward and backward: Simulation_EMPS_Validation.m, with its offset of −3.1648 N.
JANOT = np.array([95.1089, 203.5034, 20.3935 - 3.1648, 203.5034, 20.3935 + 3.1648])


def recorded(path: Path) -> tuple[Array, Array]:
    """Position, m, and force, N, (samples,)."""
    names = path.open(encoding="utf-8").readline().strip().split(",")
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    return table[:, names.index("motor_position_m")], FORCE_N_V * table[:, names.index("current_A")]


@numba.njit
def simulated(force: Array, parameters: Array, start: float) -> Array:
    """Position, m: M v̇ = F − sgn v (F_c + F_v |v|), each its own by direction."""
    mass, forward, up, backward, down = parameters
    shown = np.empty(force.size)
    position, speed, dt = start, 0.0, STEP_S / SUBSTEPS
    for i in range(force.size):
        shown[i] = position
        for _ in range(SUBSTEPS):
            halting = mass / dt * speed + force[i]
            friction = up + forward * abs(speed) if halting > 0.0 else down + backward * abs(speed)
            speed += (force[i] - np.sign(halting) * min(abs(halting), friction)) / mass * dt
            position += speed * dt
    return shown


def error_mm(parameters: Array, record: tuple[Array, Array], offset: float = 0.0) -> float:
    """rms."""
    position, force = record
    return 1e3 * float(np.sqrt(np.mean((simulated(force + offset, parameters, position[0]) - position) ** 2)))


def least_squares(record: tuple[Array, Array], by_direction: bool) -> Array:
    """M, and friction forward and backward."""
    position, force = record
    low_pass = butter(4, 0.2)
    speed = np.gradient(filtfilt(*low_pass, position), STEP_S)
    forward, backward = (speed > 0.0).astype(float), (speed <= 0.0).astype(float)
    columns = [np.gradient(speed, STEP_S), speed * forward, forward, speed * backward, -backward]
    if not by_direction:
        columns = [columns[0], speed, forward - backward, np.ones_like(speed)]
    inside = slice(50, -50)
    matrix = np.column_stack([filtfilt(*low_pass, one)[inside] for one in columns])
    found = np.linalg.lstsq(matrix, filtfilt(*low_pass, force)[inside], rcond=None)[0]
    if by_direction:
        return found
    mass, viscous, dry, constant = found
    return np.array([mass, viscous, dry + constant, viscous, dry - constant])


def main(folder: Path) -> None:
    """A line a model."""
    train, test = (recorded(folder / "emps" / f"{name}.csv") for name in ("train", "test"))
    models = {
        "Janot's parameters": JANOT,
        "least squares, offset": least_squares(train, False),
        "least squares, by direction": least_squares(train, True),
    }
    for name, parameters in models.items():
        best = minimize_scalar(lambda o: error_mm(parameters, test, o), bounds=(-3.0, 3.0), method="bounded")  # noqa: B023
        print(
            f"{name:28} train {error_mm(parameters, train):5.2f}, test {error_mm(parameters, test):5.2f} mm; "
            f"with {best.x:+.3f} N, test {best.fun:5.2f} mm   {np.round(parameters, 2)}"
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
