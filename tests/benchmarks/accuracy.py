"""Identification errors beside the thesis's: python tests/benchmarks/accuracy.py [seeds]

Data are the three-phase reference model's, fitness filtered, 50 × 150, k7 scored literally as T 5.2 prints it.
"polished" is the same run with the least-squares fit after it.  The last table turns the coordinates k1…k6 round
(k → 1 − k) before a metaheuristic sees them: what it gains or loses is its pull towards 0, where healthy k are.
"""

from __future__ import annotations

import sys

import numpy as np

from ema_model import faults
from ema_model.actuator import load_actuator
from ema_model.campaign.thesis import CASES
from ema_model.identification.optimisers import create
from ema_model.identification.run import identify
from ema_model.identification.search import Objective
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.plant import simulated
from ema_model.simulation.run import Run

ALGORITHMS = ("ssa", "hba", "do")


def main() -> None:
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    actuator, run = load_actuator(), Run()
    for noise in (0.0, 0.1):
        print(f"\nNoise {noise:g} A rms, {seeds} seeds, Err % mean (worst)\n")
        columns = [*ALGORITHMS, *(f"{algorithm} polished" for algorithm in ALGORITHMS), "robust"]
        print("| fault | " + " | ".join(columns) + " |")
        print("|---" * (len(columns) + 1) + "|")
        for case in CASES:
            truth = case.k
            clean = simulated(run, actuator, truth)
            errors: dict[str, list[float]] = {column: [] for column in columns}
            for seed in range(seeds):
                objective = Objective([Sensors(noise).record(clean, 1000 + seed)], actuator)
                for column in columns:
                    algorithm, _, polished = column.partition(" ")
                    answer = identify(
                        objective, algorithm, seed=seed, truth=truth, parameters_known=True, polish=bool(polished)
                    )
                    errors[column].append(answer.error_percent or 0.0)
            print(f"| {case.title} | " + " | ".join(f"{np.mean(e):.2f} ({max(e):.2f})" for e in errors.values()) + " |")
    reflected(seeds)


def reflected(seeds: int) -> None:
    """The pull towards 0: healthy and faulty actuators, as they are and with k1…k6 turned round."""
    actuator, run = load_actuator(), Run()
    turned = np.arange(8) < 6
    print(f"\nPull towards 0, {seeds} seeds, noise-free: Err % mean (worst)\n")
    print("| fault | algorithm | coordinates as they are | k1…k6 turned round |\n|---|---|---|---|")
    for name, truth in (("healthy", faults.HEALTHY), *((case.title, case.k) for case in (CASES[0], CASES[-1]))):
        objective = Objective([simulated(run, actuator, truth)], actuator)
        for algorithm in ALGORITHMS:
            shown = []
            for turn in (np.zeros(8, dtype=bool), turned):
                errors = []
                for seed in range(seeds):
                    optimiser = create(algorithm, dimension=8, seed=seed)
                    while not optimiser.done:
                        asked = optimiser.ask()
                        optimiser.tell(objective(np.where(turn, 1.0 - asked, asked)))
                    best = np.where(turn, 1.0 - optimiser.best_x, optimiser.best_x)
                    errors.append(faults.error_percent(best, truth))
                shown.append(f"{np.mean(errors):.2f} ({max(errors):.2f})")
            print(f"| {name} | {algorithm} | {shown[0]} | {shown[1]} |")


if __name__ == "__main__":
    main()
