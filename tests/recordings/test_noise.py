"""The noise that a signal tells of itself: on a grid, beside a motion that is sampled slowly, with outliers."""

from __future__ import annotations

import numpy as np
import pytest

from ema_model.recordings.noise import is_of_grid, sample_noise, white_noise

STEP = 1e-3


def motion(samples: int, seed: int):
    time = np.arange(samples) / 1000.0
    return np.sin(2.0 * np.pi * 3.0 * time + np.random.default_rng(seed).uniform(0.0, 6.0))


@pytest.mark.parametrize("noise", [0.0, 0.3, 1.0, 5.0])
def test_of_a_quantised_signal_it_is_neither_more_nor_less(noise):
    """The median of third differences is a whole number of steps: up to a seventh too much."""
    found = []
    for seed in range(12):
        random = np.random.default_rng(seed)
        clean = motion(2000, seed)
        seen = np.round((clean + noise * STEP * random.standard_normal(2000)) / STEP) * STEP
        found.append(sample_noise(seen, "motor_position_rad") / (STEP * np.hypot(noise, 1.0 / np.sqrt(12.0))))
    assert np.mean(found) == pytest.approx(1.0, abs=0.06)
    assert np.std(found) < 0.06


@pytest.mark.parametrize(("noise", "is_grids"), [(0.0, True), (0.3, False), (1.0, False)])
def test_what_is_of_the_grid_is_known_exactly(noise, is_grids):
    """That of a slow motion, whose readings are held, and of a fast one."""
    for samples, seed in ((2000, 0), (2000, 1), (400, 2)):
        random = np.random.default_rng(seed)
        seen = np.round((motion(samples, seed) / STEP) + noise * random.standard_normal(samples)) * STEP
        assert is_of_grid(seen) == is_grids
        exactly = sample_noise(seen, "motor_position_rad") == pytest.approx(STEP / np.sqrt(12.0), rel=1e-6)
        assert exactly == is_grids


def test_a_fast_motion_sampled_slowly_is_no_noise():
    time = np.arange(400) / 500.0
    chirp = np.sin(2.0 * np.pi * (2.0 * time + 20.0 * time**2))
    seen = chirp + 1e-3 * np.random.default_rng(3).standard_normal(400)
    assert sample_noise(seen, "motor_position_rad") == pytest.approx(1e-3, rel=0.2)
    third = np.median(np.abs(np.diff(seen, 3))) * 1.4826 / np.sqrt(20.0)
    assert third > 2e-3  # what the third differences alone make of it


def test_steps_and_reversals_are_no_noise():
    random = np.random.default_rng(4)
    seen = 0.1 * random.standard_normal(3000) + np.where(np.arange(3000) % 100 < 50, 2.0, -2.0)
    assert white_noise(seen) == pytest.approx(0.1, rel=0.1)
