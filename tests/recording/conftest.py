"""A small recording."""

from __future__ import annotations

import numpy as np
import pytest


@pytest.fixture(scope="session")
def signals():
    """Times (500,), s, on whole microseconds, and two signals."""
    time = np.arange(500) / 1e4
    return time, {"current_A": np.sin(200.0 * time), "user_position_rad": 0.1 * time}


@pytest.fixture
def write(signals):
    """Writes the whole of what a recording can hold into an open writer; gives the arrays."""

    def write(writer):
        rng = np.random.default_rng(1)
        time, values = signals
        truth = np.array([0.25, 0, 0, 0.4, 0, 0.1, 0.5, 0.5])
        best, population = rng.random((60, 8)), rng.random((60, 20, 8))
        rmse, population_rmse = rng.random(60) + 0.1, rng.random((60, 20))
        writer.config("# Settings\n\n| a | b |\n|---|---|\n| seed | 7 |\n")
        writer.properties({"seed": 7, "faults": {"k1": 0.25}, "k": truth, "name": "x|y"})
        for group in ("reference", "monitor"):
            writer.signals(group, time, values)
        writer.signals("residual", time, {"current_A": values["current_A"] - 1.0})
        writer.truth(truth)
        for i in range(60):
            writer.iteration("hba", i, rmse[i], best[i], population[i], population_rmse[i])
        writer.monitor_iteration("hba", 40, time, values["current_A"])
        writer.result({"rmse": 0.25, "verdict": "k1 | friction"})
        return dict(
            truth=truth, best=best, population=population, rmse=rmse, population_rmse=population_rmse, time=time
        )

    return write
