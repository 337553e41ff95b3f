"""Identification errors beside the thesis's: python tests/benchmarks/accuracy.py [seeds]

Data are the three-phase reference model's, fitness filtered, 50 × 150, k7 scored literally as T 5.2 prints it.
"best" takes, for each seed, the answer of Honey Badger or Dandelion with the lower rmse.
"""

from __future__ import annotations

import sys

import numpy as np

from ema_model import faults
from ema_model.actuator import load_actuator
from ema_model.identification.objective import Objective, simulated
from ema_model.identification.run import identify
from ema_model.sensors import Sensors
from ema_model.simulation import Run

CASES = (
    ("friction k1 = 0.25", {"k1": 0.25}),
    ("friction k1 = 0.75", {"k1": 0.75}),
    ("backlash k2 = 0.25", {"k2": 0.25}),
    ("backlash k2 = 0.75", {"k2": 0.75}),
    ("short circuit k3 = 0.25", {"k3": 0.25}),
    ("short circuit k3 = 0.75", {"k3": 0.75}),
    ("gain k8 = 0.25", {"k8": 0.25}),
    ("gain k8 = 0.75", {"k8": 0.75}),
    ("eccentricity k6 = 0.25", {"k6": 0.25}),
    ("eccentricity k6 = 0.75", {"k6": 0.75}),
)
ALGORITHMS = ("ssa", "hba", "do")


def main() -> None:
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    actuator, run = load_actuator(), Run()
    for noise in (0.0, 0.1):
        print(f"\nNoise {noise:g} A rms, {seeds} seeds, Err % mean (worst)\n")
        print("| fault | Sparrow Search | Honey Badger | Dandelion | best of the last two |")
        print("|---|---|---|---|---|")
        single = []
        for name, fault in CASES:
            truth = faults.vector(fault)
            clean = simulated(run, actuator, truth)
            errors: dict[str, list[float]] = {algorithm: [] for algorithm in (*ALGORITHMS, "best")}
            for seed in range(seeds):
                objective = Objective([Sensors(noise).record(clean, 1000 + seed)], actuator)
                found = {a: identify(objective, a, seed=seed, truth=truth) for a in ALGORITHMS}
                for algorithm, answer in found.items():
                    errors[algorithm].append(answer.error_percent or 0.0)
                best = min((found["hba"], found["do"]), key=lambda answer: answer.rmse)
                errors["best"].append(best.error_percent or 0.0)
            if "eccentricity" not in name:
                single += errors["best"]
            print(f"| {name} | " + " | ".join(f"{np.mean(e):.2f} ({max(e):.2f})" for e in errors.values()) + " |")
        print(f"\nfriction, backlash, short circuit, gain: mean of the best {np.mean(single):.2f} %")


if __name__ == "__main__":
    main()
