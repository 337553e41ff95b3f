"""Peers of discovery: two regressions of the inverse dynamics, told what they may choose of, on the rigs' recordings.

    python tests/benchmarks/rig_regression.py FOLDER     # with GROUP/CASE/chirp.csv, as a study of rigs leaves it

The motor's torque k_t I is held against columns of the measured motion (both through one zero-phase filter, decimated,
as is usual: Gautier, Janot): inertia, viscous and dry friction always, and those of every effect that is a torque.  One
method begins with all and drops the effect that is missed least, as long as BIC falls and what is left grows by less
than a share of it (backward elimination); the other solves by least squares, with a ridge, again and again for what is
left after small coefficients are struck out (STLSQ; Brunton, Proctor, Kutz 2016).  Both are told each rig's periods,
which discovery has to find, and are counted at the strictness that does best on these very recordings.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

sys.path.insert(0, str(Path(__file__).parents[1]))
from support.foreign_rigs import FITTED, actuator_of, truth_of
from support.foreign_score import COLUMNS, tally

Array = NDArray[np.float64]
Columns = dict[str, Array]  # by effect or base parameter: (samples, columns)

# Five times the fastest motion; of the hobby servo's coarse sensor less.
CUTOFF_HZ = {"gearservo": 60.0, "ballscrew": 60.0, "hobby": 12.0}
TURN = {"gearservo": 2.0 * np.pi, "ballscrew": 0.010, "hobby": 2.0 * np.pi}  # of the motor, or the lead
ORDERS = (1, 2, 4, 6, 8, 12, 24)  # a turn of the motor, or a lead
USER_CYCLES = 2.0 * np.pi / np.array([0.1, 0.2, 0.4])  # over the user's travel
SPEEDS = (0.01, 0.03, 0.1, 0.3)  # of the top speed, over which friction may fall
SHARES = (0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0)  # ln of the error that an effect must take away
THRESHOLDS = (0.01, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0)  # of the largest column of the base model
RIDGE = 0.05  # on columns of unit length
BEYOND_TOLERANCES = 3.0
ALIKE = {"constant_load": "current_sensor_bias+asymmetric_friction"}  # one column
BASE = {"inertia_error": "inertia_kgm2", "viscous_friction": "viscous_friction_Nms_rad", "dry": "dynamic_friction_Nm"}


@dataclass(frozen=True)
class Problem:
    """torque (samples,) = Σ columns · coefficients"""

    torque: Array
    base: Columns
    offered: Columns


def problem(folder: Path, rig: str) -> Problem:
    """Both recordings of a case, one after the other."""
    torques, bases, offers = zip(*(_recording(folder / f"{name}.csv", rig) for name in FITTED))
    return Problem(np.concatenate(torques), _joined(bases), _joined(offers))


def _joined(parts: Sequence[Columns]) -> Columns:
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _recording(file: Path, rig: str) -> tuple[Array, Columns, Columns]:
    """Torque, what is always there, what is offered."""
    table = pd.read_csv(file).dropna()
    period = float(np.median(np.diff(table["time_s"])))
    time = np.arange(table["time_s"].iloc[0], table["time_s"].iloc[-1], period)
    logged = {name: np.interp(time, table["time_s"], table[name]) for name in table.columns}
    motion = next(name for name in logged if name.startswith(("motor_position", "user_position")[rig == "hobby"]))
    x = next(logged[name] for name in logged if name.startswith("user_position"))
    low = butter(4, CUTOFF_HZ[rig] * 2.0 * period, output="sos")
    every = max(1, int(0.5 / CUTOFF_HZ[rig] / period / 2.0))

    def passed(values: Array) -> Array:
        return sosfiltfilt(low, values)

    theta = passed(logged[motion])
    speed = np.gradient(theta, period)
    torque = actuator_of(rig).value("motor.torque_constant_Nm_A") * logged["current_A"]
    direction = np.tanh(speed / (0.005 * np.max(np.abs(speed))))
    base = {"inertia_error": np.gradient(speed, period), "viscous_friction": speed, "dry": direction}
    top = np.max(np.abs(speed))
    waves = [wave(order * 2.0 * np.pi / TURN[rig] * theta) for order in ORDERS for wave in (np.sin, np.cos)]
    places = [wave(cycle * x / np.ptp(x)) for cycle in USER_CYCLES for wave in (np.sin, np.cos)]
    offered: dict[str, list[Array]] = {
        "constant_load": [np.ones_like(x)],
        "asymmetric_friction": [np.abs(speed)],
        "hinge_moment": [x],
        "cubic_spring": [x**3],
        "pendulum_load": [np.sin(x), np.cos(x)],
        "stribeck_friction": [direction * np.exp(-((speed / (share * top)) ** 2)) for share in SPEEDS],
        "quadratic_drag": [speed * np.abs(speed)],
        "load_dependent_friction": [direction * np.abs(torque)],
        "mesh_friction": [direction * np.abs(base["inertia_error"])],
        "torque_saturation": [torque * np.abs(torque)],
        "friction_drift": [direction * time],
        "position_dependent_friction": [direction * place for place in places],
    }
    if rig == "hobby":  # whose file has an arm, and whose motor's angle is not recorded
        base["moment"], offered["pendulum_load"] = np.sin(x), [np.cos(x)]
    else:
        offered |= {"cogging_torque": waves, "torque_ripple": [torque * wave for wave in waves]}
    moving = np.abs(speed) > 0.02 * top
    moving[: 4 * every] = moving[-4 * every :] = False
    kept = np.flatnonzero(moving)[::every]
    return (
        passed(torque)[kept],
        {name: passed(one)[kept, None] for name, one in base.items()},
        {name: np.stack([passed(one)[kept] for one in many], axis=1) for name, many in offered.items()},
    )


def solved(given: Problem, names: tuple[str, ...], ridge: float = 0.0) -> tuple[float, int, Columns]:
    """ln of the rms that is left, how many columns there are, and the coefficients by name."""
    columns = given.base | {name: given.offered[name] for name in names}
    matrix = np.concatenate([*columns.values()], axis=1)
    scale = np.linalg.norm(matrix, axis=0)
    size = matrix.shape[1]
    rows = np.concatenate([matrix / scale, np.sqrt(ridge) * np.eye(size)])
    found, *_ = np.linalg.lstsq(rows, np.r_[given.torque, np.zeros(size)], rcond=1e-10)
    left = given.torque - matrix / scale @ found
    parts = np.split(found / scale, np.cumsum([one.shape[1] for one in columns.values()])[:-1])
    return 0.5 * float(np.log(np.mean(left**2))), size, dict(zip(columns, parts))


def backward(given: Problem) -> list[tuple[str, ...]]:
    """For each of `SHARES` the effects that stay, the one that tells most first."""
    n, answers = len(given.torque), []
    kept = order = tuple(given.offered)
    for share in SHARES:
        while kept:
            now, size, _ = solved(given, kept)
            without = {name: solved(given, tuple(one for one in kept if one != name)) for name in kept}
            order = tuple(sorted(kept, key=lambda name: -without[name][0]))
            left, fewer, _ = without[order[-1]]
            if 2.0 * n * (left - now) >= (size - fewer) * np.log(n) and left - now >= share:
                break
            kept = tuple(one for one in kept if one != order[-1])
        answers.append(order if kept else ())
    return answers


def thresholded(given: Problem) -> list[tuple[str, ...]]:
    """For each of `THRESHOLDS` the same by sequentially thresholded least squares."""
    columns, answers = given.base | given.offered, []
    for threshold in THRESHOLDS:
        kept = tuple(given.offered)
        while True:
            values = solved(given, kept, RIDGE)[2]
            size = {name: float(np.linalg.norm(columns[name] @ values[name])) for name in values}
            least = threshold * max(size[name] for name in given.base)
            large = tuple(name for name in kept if size[name] >= least)
            if large == kept:
                break
            kept = large
        answers.append(tuple(sorted(kept, key=lambda name: -size[name])))
    return answers


METHODS: Mapping[str, tuple[tuple[float, ...], Callable[[Problem], list[tuple[str, ...]]]]] = {
    "backward elimination": (SHARES, backward),
    "STLSQ": (THRESHOLDS, thresholded),
}


def answer(given: Problem, names: tuple[str, ...], rig: str) -> dict[str, object]:
    """As a row of `discover`'s campaign; what is outside its tolerance is told of the base parameters."""
    actuator = actuator_of(rig)
    values = solved(given, names)[2]
    outside = []
    for name, key in BASE.items():
        path = f"motor.{key}"
        far = abs(float(values[name][0]) - actuator.value(path)) / actuator.tolerances[path].sigma
        outside += [path] if far > BEYOND_TOLERANCES else []
    return {
        "verdict": "effects_found" if names else "adequate",
        "effects": [*names],
        "same_as": [ALIKE.get(name, "") for name in names],
        "parameters": json.dumps({name: {} for name in names}),
        "outside": outside,
        "unknown": "",
        "ladder": [1.0],
        "floor_band": [1.0, 1.0],
        "at_bound": [],
    }


def main() -> None:
    """Prints the counts of each group, and of all, at each method's best strictness."""
    counts: dict[tuple[str, float], dict[str, Counter[str]]] = {}
    for case in sorted(path.parent for path in Path(sys.argv[1]).glob(f"*/*/{FITTED[0]}.csv")):
        group = case.parent.name
        rig = group.split("_")[0]
        given, truth = problem(case, rig), truth_of(str(case / f"{FITTED[0]}.csv"))
        for method, (levels, chosen) in METHODS.items():
            for level, names in zip(levels, chosen(given)):
                by_group = counts.setdefault((method, level), {})
                by_group.setdefault(group, Counter()).update(tally(answer(given, names, rig), truth))
    for method, (levels, _) in METHODS.items():
        total = {level: sum(counts[method, level].values(), Counter()) for level in levels}
        best = max(levels, key=lambda level: total[level]["right"] - total[level]["false"])
        print(f"{method}, strictness {best} of {levels}")
        for group, one in [*counts[method, best].items(), ("all", total[best])]:
            told = ", ".join(f"{name} {one[name]}" for name in ("cases", "showable", *COLUMNS[:4]))
            print(f"  {group:18} {told}")


if __name__ == "__main__":
    main()
