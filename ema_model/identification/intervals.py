"""How sure an identification is: intervals, a joint test of health, and what the data cannot separate.

Everything is linearised at the answer.  The covariance has three parts:
- the residual's, by the sandwich (J'J)⁻¹ J'ΩJ (J'J)⁻¹ with Ω from the residual itself, correlated over up to
  25 ms (Newey & West, Econometrica 55, 1987), since what a low-fidelity model misses is not white;
- the tolerances of the actuator's own parameters, carried to k through their sensitivities;
- the model's floor: what the Monitor Model would misread a Reference Model of this very k for, run under
  the recordings' own commands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from ema_model import faults
from ema_model.commands import Recorded
from ema_model.identification.objective import Objective
from ema_model.simulation import Run, simulate_reference

Array = NDArray[np.floating]

_STEP = 0.01
_CORRELATED_S = 0.025
_PRIOR_SIGMA = 0.29  # of a k that may be anything in [0, 1]
_Z90 = 1.645
_INSEPARABLE = 0.95
_WIDE = 0.05


@dataclass(frozen=True)
class Uncertainty:
    """What the recordings leave open about k."""

    interval90: Array  # (8, 2)
    healthy: bool  # joint test at 1 %
    alarms: tuple[str, ...]  # the k whose interval excludes its healthy value
    ambiguous: tuple[tuple[str, ...], ...]  # groups that these recordings cannot separate


def uncertainty(objective: Objective, k: Array, *, parameters_known: bool = False) -> Uncertainty:
    """Intervals and tests at an answer k (8,); with parameters_known the tolerances do not count."""
    jacobian, residual = _jacobian(objective, k)
    variance = max(float(residual @ residual) / max(len(residual) - 8, 1), 1e-12)
    information = jacobian.T @ jacobian + variance * np.eye(8) / _PRIOR_SIGMA**2
    inverse = np.linalg.inv(information)
    white = variance * inverse
    covariance = inverse @ _meat(jacobian, residual, objective.windows[0].block_s) @ inverse
    covariance = np.maximum(1.0, np.diag(white) / np.maximum(np.diag(covariance), 1e-30)) ** 0.5 * covariance
    covariance = 0.5 * (covariance + covariance.T)
    if not parameters_known:
        shift = inverse @ jacobian.T @ _tolerance_shifts(objective, k)
        covariance += shift @ shift.T
    misread = inverse @ jacobian.T @ _model_floor(objective, k)
    covariance += np.diag(misread**2) + 1e-12 * np.eye(8)
    sigma = np.sqrt(np.diag(covariance))
    interval = np.clip(np.stack([k - _Z90 * sigma, k + _Z90 * sigma], axis=1), 0.0, 1.0)

    eccentric = interval[5, 0] > 0.0
    if not eccentric:
        interval[6] = 0.0, 1.0  # a centred rotor has no direction
    tested = [i for i in range(8) if i != 6]
    outside = [i for i in tested if not interval[i, 0] <= faults.HEALTHY[i] <= interval[i, 1]]
    deviation = (k - faults.HEALTHY)[tested]
    joint = float(deviation @ np.linalg.solve(covariance[np.ix_(tested, tested)], deviation))
    return Uncertainty(
        interval90=interval,
        healthy=joint < float(chdtri(len(tested), 0.01)),
        alarms=tuple(faults.NAMES[i] for i in outside),
        ambiguous=_groups(white, sigma, eccentric),
    )


def _jacobian(objective: Objective, k: Array) -> tuple[Array, Array]:
    """∂(current)/∂k (blocks, 8) by differences inside the box, and the residual (blocks,), A."""
    low, high = np.clip(k - _STEP, 0.0, 1.0), np.clip(k + _STEP, 0.0, 1.0)
    points = np.repeat(k[None, :], 17, axis=0)
    for i in range(8):
        points[2 * i, i], points[2 * i + 1, i] = low[i], high[i]
    current = objective.currents(points)
    columns = [(current[2 * i + 1] - current[2 * i]) / (high[i] - low[i]) for i in range(8)]
    return np.stack(columns, axis=1), objective.target - current[16]


def _meat(jacobian: Array, residual: Array, block_s: float) -> Array:
    """J'ΩJ with the residual's own correlation, Bartlett's weights."""
    score = jacobian * residual[:, None]
    total = score.T @ score
    lags = min(int(_CORRELATED_S / block_s), len(residual) // 4)
    # sums of neighbours rather than of every lag's product: the same Bartlett kernel, in one pass
    if lags > 1:
        padded = np.concatenate([np.zeros((lags, 8)), score, np.zeros((lags, 8))])
        running = np.cumsum(padded, axis=0)
        windows = running[lags:] - running[:-lags]
        total = windows.T @ windows / lags
    return total


def _tolerance_shifts(objective: Objective, k: Array) -> Array:
    """Change of the current, A, for 1 σ of each parameter with a tolerance, (blocks, parameters)."""
    actuator = objective.actuator
    paths = [p for p in actuator.tolerances if not p.startswith("sensors.") and p != "motor.rotor_offset_rad"]
    if not paths:
        return np.zeros((objective.blocks, 0))
    n = len(paths) + 1
    values = {path: np.full(n, actuator.value(path)) for path in paths}
    for i, path in enumerate(paths):
        values[path][i] += actuator.tolerances[path].sigma
    varied = actuator.varied(values)
    current = objective.currents(np.repeat(k[None, :], n, axis=0), varied)
    return (current[:-1] - current[-1]).T


def _model_floor(objective: Objective, k: Array) -> Array:
    """Current of the Reference Model less that of the Monitor Model, both at k, A, (blocks,)."""
    reference = []
    for window in objective.windows:
        count = len(window.command)
        times = np.arange(count) * window.step_s
        run = Run(
            Recorded(times, window.command),
            duration_s=count * window.step_s,
            sample_rate_Hz=1.0 / window.block_s,
            load_torque_Nm=float(window.load.mean()),
        )
        twin = simulate_reference(run, objective.actuator, k, objective.effects, start_rad=window.user_rad)
        reference.append(twin["current_A"][1:])
    return np.concatenate(reference) - objective.currents(k)[0]


def _groups(white: Array, sigma: Array, eccentric: bool) -> tuple[tuple[str, ...], ...]:
    """k that trade against each other: strongly correlated and, each, poorly known."""
    scale = np.sqrt(np.diag(white))
    correlation = np.abs(white / np.outer(scale, scale))
    groups: list[set[int]] = []
    for i in range(8):
        for j in range(i):
            if correlation[i, j] > _INSEPARABLE and min(sigma[i], sigma[j]) > _WIDE and (eccentric or 6 not in (i, j)):
                touching = [g for g in groups if i in g or j in g]
                groups = [g for g in groups if g not in touching] + [set.union({i, j}, *touching)]
    return tuple(tuple(faults.NAMES[i] for i in sorted(group)) for group in groups)
