"""A drive whose controller nobody knows: a true model of it leaves what the floor says, whatever its log lacks."""

from __future__ import annotations

import numpy as np
import pytest
from support.unknown_drive import drive_of, logged

from ema_model.actuator import Actuator
from ema_model.comparison import compare
from ema_model.comparison.criteria import SLOW
from ema_model.comparison.verdict import slow_ratio

SEEDS = range(12)


@pytest.fixture(params=["whole", "steady parts"])
def actuator(request, tmp_path) -> Actuator:
    return drive_of(tmp_path, leaves_out_reversals=request.param == "steady parts")


@pytest.mark.parametrize(
    ("rate_Hz", "noise_A", "counts"),
    [(500.0, 0.2, None), (2000.0, 0.2, None), (1000.0, 0.05, 652.0)],
    ids=["noise", "noise, logged fast", "a coarse encoder"],
)
def test_a_true_model_is_adequate_and_at_its_floor(actuator, rate_Hz, noise_A, counts):
    """A filter leaves noise alike for a while, which is no lasting error; what it cannot know at the ends, is none."""
    found = [compare([logged(seed, rate_Hz, noise_A, counts)], actuator) for seed in SEEDS]
    error = np.array([one.over_floor for one in found])
    print(np.round(error, 3), np.round(np.mean([one.floor_band for one in found], axis=0), 3))
    assert 0.9 <= np.median(error) <= 1.03
    assert max(slow_ratio(one.residuals, "current_A") for one in found) < 0.75 * SLOW
    assert sum(one.adequate for one in found) >= len(SEEDS) - 1
    assert sum(low <= one <= high for one, (low, high) in zip(error, (each.floor_band for each in found))) >= 9
