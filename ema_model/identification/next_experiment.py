"""The run that would tell apart what a recording cannot: each of some commands, judged by what it would add."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.commands import command
from ema_model.errors import InputError
from ema_model.estimation.floor import Floor, repeats_of
from ema_model.estimation.problem import Problem
from ema_model.estimation.unknowns import K_SIGMA
from ema_model.identification.fit import FAULTS, Fitted
from ema_model.models import ClosedLoop
from ema_model.simulation.run import Run, simulate_monitor

Array = NDArray[np.floating]

_COMMANDS: tuple[tuple[str, dict[str, float], float], ...] = (
    ("chirp", {"amplitude_rad": 0.005}, 0.5),
    ("chirp", {"amplitude_rad": 0.02}, 0.5),
    ("sine", {"amplitude_rad": 0.005, "frequency_Hz": 6.0}, 0.5),
    ("sine", {"amplitude_rad": 0.05, "frequency_Hz": 2.0}, 0.5),
    ("step", {"final_rad": 0.005}, 0.5),
    ("staircase", {"step_rad": 0.002}, 0.5),
)
_STEP_S = 5e-5  # of the model, as exact as an estimate of what a run would tell need be
_CURRENT_A = 0.2  # noise of a block, where the recording does not tell


@dataclass(frozen=True)
class Suggestion:
    """A run, and how much less k would be spread after it."""

    command: str
    settings: dict[str, float]  # of the command; the others are its usual ones
    duration_s: float
    gain: float  # of the σ of the k in question, before over after

    @property
    def options(self) -> str:
        """The run as `emaviz simulate` takes it."""
        chosen = "".join(f" --set {name}={value:g}" for name, value in self.settings.items())
        return f"--command {self.command}{chosen} --duration {self.duration_s:g}"


def separating(found: Fitted, covariance: Array, names: Sequence[str]) -> Suggestion | None:
    """The command after which the k of these names (k1…k8) would be known best; None if none helps."""
    columns = sorted({c for name in names for c in _columns(name)})
    best: Suggestion | None = None
    before = np.sqrt(np.diag(covariance)[columns])
    known = np.linalg.inv(np.linalg.cholesky(covariance))  # rows: kᵀ rowsᵀ rows k is what the recordings tell
    for name, settings, duration in _COMMANDS:
        told = _information(found, Run(command(name, settings), duration))
        if told is None:
            continue
        root = np.linalg.inv(np.linalg.qr(np.concatenate([known, told]), mode="r"))
        after = np.linalg.norm(root, axis=1)[columns]
        gain = float(np.max(before / after))
        if gain > 1.3 and (best is None or gain > best.gain):
            best = Suggestion(name, settings, duration, gain)
    return best


def _columns(name: str) -> tuple[int, ...]:
    return {"k6": (5, 6), "k7": (5, 6), "k8": (7,)}.get(name, (int(name[1]) - 1,))


def _information(found: Fitted, run: Run) -> Array | None:
    """What such a recording would tell of k, its rig's unknowns integrated out: (8, 8), a root of the information."""
    problem = found.problem
    plant = problem.model
    try:
        recording = simulate_monitor(run, plant.actuator, found.k, plant.effects, plant.stack.circuit)
        own = ClosedLoop([recording], plant.actuator, effects=plant.effects, circuit=plant.stack.circuit)
        own = own.at_longer_steps(_STEP_S)
    except (InputError, FloatingPointError):
        return None
    window = own.windows[0]
    typical = problem.floors[0]
    known = typical.model
    noise = {name: typical.noise.get(name, _CURRENT_A) for name in window.measured}
    model = {
        name: np.full(window.blocks, np.sqrt(np.mean(known[name] ** 2)) if name in known else 0.0)
        for name in window.measured
    }
    kept = [one for one in problem.unknowns if one.kind in ("fault", "parameter") or one.place == 0]
    own_floor = Floor(noise, model, repeats_of(window, noise), window.block_s, typical.white)
    own_problem = Problem(own, [own_floor], kept)
    _, slopes = own_problem.jacobians(own_problem.at(found.k)[None, :])
    # The faults last: what is left of them beside the rig's unknowns; normal equations would round it away.
    ordered = np.concatenate([slopes[0][:, FAULTS:], slopes[0][:, :FAULTS] / K_SIGMA], axis=1)
    return np.asarray(np.linalg.qr(ordered, mode="r"))[-FAULTS:, -FAULTS:]
