"""What a signal tells of its own noise and grid: of slow and fast motion, of outliers, and what no mean takes away."""

from __future__ import annotations

import numpy as np
import pytest

from ema_model.recordings.signals import beating, held, is_of_grid, sample_noise, white_noise

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


# --- quantisation that no mean takes away: of a signal that goes on by whole steps a sample, or stays on one ----------

GRID, SIZE = 1e-6, 5


def on_a_grid(pace: float, count: int = 4000) -> np.ndarray:
    """A motion of so many steps a sample, as a sensor on that grid reads it, begun within 20 samples."""
    begins = np.minimum(np.arange(count) / 20.0, 1.0)
    return GRID * np.round(0.3 + np.cumsum(pace * begins))


@pytest.mark.parametrize("pace", [10.0, -3.002])
def test_a_pace_of_whole_steps_leaves_its_error_in_every_mean(pace):
    assert beating(on_a_grid(pace), SIZE)[10:-10] == pytest.approx(np.full(780, GRID * np.sqrt(0.8 / 12.0)))


@pytest.mark.parametrize("pace", [9.6, 3.3, 0.0, 0.02])
def test_another_pace_or_a_signal_that_stands_does_not(pace):
    assert not np.any(beating(on_a_grid(pace), SIZE))


def test_a_pace_that_passes_by_whole_steps_does_not():
    time = np.arange(4000)
    assert not np.any(beating(GRID * np.round(0.002 * time**2), SIZE))


def test_what_is_on_no_grid_does_not():
    random = np.random.default_rng(6)
    assert not np.any(beating(np.cumsum(random.standard_normal(4000)), SIZE))
    assert not np.any(beating(np.zeros(4000), SIZE)) and not np.any(beating(on_a_grid(10.0, count=12), SIZE))


def test_its_size_is_that_of_what_is_read():
    """Of paces near a whole one the means' rms error is that, over the phases that such a motion may have."""
    errors = []
    for phase in np.linspace(0.0, 1.0, 50, endpoint=False):
        exact = phase + 7.0 * np.arange(500)
        errors.append((GRID * (np.round(exact) - exact)).reshape(-1, SIZE).mean(axis=1))
    whole = np.hypot(beating(on_a_grid(7.0), SIZE)[400], GRID / np.sqrt(12.0 * SIZE))
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(whole, rel=0.05)


def test_a_reading_is_held_until_it_changes():
    assert held(np.repeat([0.0, 1.0, 2.0], [3, 5, 7]), 1) == pytest.approx(np.repeat([3.0, 5.0, 7.0], [3, 5, 7]))
    assert held(on_a_grid(0.02), 1)[100:-100] == pytest.approx(np.full(3800, 50.0), abs=1.0)


def test_a_mean_has_the_length_that_its_readings_have():
    assert held(np.repeat([0.0, 1.0], [6, 4]), 5) == pytest.approx([6.0, (6.0 + 4.0 * 4.0) / 5.0])
    assert len(held(np.zeros(13), 5)) == 2 and not len(held(np.zeros(3), 5))


def test_what_is_noisier_than_its_grid_is_not_held():
    random = np.random.default_rng(7)
    assert np.mean(held(GRID * np.round(2.0 * random.standard_normal(4000)), 1)) < 1.5
