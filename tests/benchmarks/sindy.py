"""PySINDy on EMPS: sparse regression told what it may choose of, simulated as the benchmark asks.

    PYTHON tests/benchmarks/sindy.py DATA     # an environment with pysindy; DATA/emps as `emaviz data emps` makes it

State: position and speed; input: the controller's voltage.  The position passes the filter of Janot's scripts
(Butterworth, 4th order, 100 Hz, both ways) before it is differentiated.  STLSQ's threshold is the one that simulates
the training record best; the test record is opened once, with nothing of it used but its first state.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pysindy as ps
from scipy.signal import butter, filtfilt

STEP_S, SUBSTEPS, RIDGE = 1e-3, 4, 1e-6
THRESHOLDS = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3)  # m/s²; columns are of the usual size of 1
COLUMNS = {
    "u": lambda v, u: u,
    "v": lambda v, u: v,
    "sgn v": lambda v, u: np.sign(v),
    "|v|": lambda v, u: np.abs(v),
    "v²": lambda v, u: v**2,
    "v|v|": lambda v, u: v * np.abs(v),
    "v³": lambda v, u: v**3,
    "sgn v exp(−|v|/0.01)": lambda v, u: np.sign(v) * np.exp(-np.abs(v) / 0.01),
    "1": lambda v, u: np.ones_like(v),
}


def recorded(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Position, m, and voltage, V, (samples,)."""
    names = path.open(encoding="utf-8").readline().strip().split(",")
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    return table[:, names.index("motor_position_m")], table[:, names.index("current_A")]


def simulated(coefficients: np.ndarray, voltage: np.ndarray, start: float) -> np.ndarray:
    """Position, m, by Euler's steps."""
    position, speed, shown, dt = start, 0.0, np.empty(voltage.size), STEP_S / SUBSTEPS
    for i, u in enumerate(voltage):
        shown[i] = position
        for _ in range(SUBSTEPS):
            row = np.array([float(one(np.float64(speed), np.float64(u))) for one in COLUMNS.values()])
            speed += dt * float(row @ coefficients)
            position += dt * speed
        if not abs(position) < 1e3:
            shown[i:] = 1e3
            break
    return shown


def rms_mm(coefficients: np.ndarray, position: np.ndarray, voltage: np.ndarray) -> float:
    """Of the simulated position's error."""
    return 1e3 * float(np.sqrt(np.mean((simulated(coefficients, voltage, position[0]) - position) ** 2)))


def main(folder: Path) -> None:
    """Prints what is chosen at each threshold, and the test record's error at the best."""
    train, test = (recorded(folder / "emps" / f"{name}.csv") for name in ("train", "test"))
    smooth = filtfilt(*butter(4, 0.2), train[0])
    speed = np.gradient(smooth, STEP_S)
    faster = np.gradient(speed, STEP_S)
    inside = slice(50, -50)
    columns = np.column_stack([one(speed, train[1]) for one in COLUMNS.values()])[inside]
    size = np.sqrt(np.mean(columns**2, axis=0))
    found = []
    for threshold in THRESHOLDS:
        fit = ps.STLSQ(threshold=threshold, alpha=RIDGE).fit(columns / size, faster[inside, None])
        coefficients = np.ravel(fit.coef_) / size
        error = rms_mm(coefficients, *train)
        told = ", ".join(f"{value:.4g} {name}" for name, value in zip(COLUMNS, coefficients) if value)
        print(f"threshold {threshold:g}: training {error:.2f} mm, v̇ = {told}", flush=True)
        found.append((error, coefficients))
    best = min(found, key=lambda one: one[0])
    print(f"test {rms_mm(best[1], *test):.2f} mm, where training has {best[0]:.2f} mm; pysindy {ps.__version__}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
