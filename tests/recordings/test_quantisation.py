"""Quantisation that no mean takes away: of a signal that goes on by whole steps a sample, or stays on one."""

from __future__ import annotations

import numpy as np
import pytest

from ema_model.recordings.noise import beating, held

STEP, SIZE = 1e-6, 5


def read(pace: float, count: int = 4000) -> np.ndarray:
    """A motion of so many steps a sample, as a sensor on that grid reads it, begun within 20 samples."""
    begins = np.minimum(np.arange(count) / 20.0, 1.0)
    return STEP * np.round(0.3 + np.cumsum(pace * begins))


@pytest.mark.parametrize("pace", [10.0, -3.002])
def test_a_pace_of_whole_steps_leaves_its_error_in_every_mean(pace):
    assert beating(read(pace), SIZE)[10:-10] == pytest.approx(np.full(780, STEP * np.sqrt(0.8 / 12.0)))


@pytest.mark.parametrize("pace", [9.6, 3.3, 0.0, 0.02])
def test_another_pace_or_a_signal_that_stands_does_not(pace):
    assert not np.any(beating(read(pace), SIZE))


def test_a_pace_that_passes_by_whole_steps_does_not():
    time = np.arange(4000)
    assert not np.any(beating(STEP * np.round(0.002 * time**2), SIZE))


def test_what_is_on_no_grid_does_not():
    random = np.random.default_rng(6)
    assert not np.any(beating(np.cumsum(random.standard_normal(4000)), SIZE))
    assert not np.any(beating(np.zeros(4000), SIZE)) and not np.any(beating(read(10.0, count=12), SIZE))


def test_its_size_is_that_of_what_is_read():
    """Of paces near a whole one the means' rms error is that, over the phases that such a motion may have."""
    errors = []
    for phase in np.linspace(0.0, 1.0, 50, endpoint=False):
        exact = phase + 7.0 * np.arange(500)
        errors.append((STEP * (np.round(exact) - exact)).reshape(-1, SIZE).mean(axis=1))
    whole = np.hypot(beating(read(7.0), SIZE)[400], STEP / np.sqrt(12.0 * SIZE))
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(whole, rel=0.05)


def test_a_reading_is_held_until_it_changes():
    assert held(np.repeat([0.0, 1.0, 2.0], [3, 5, 7]), 1) == pytest.approx(np.repeat([3.0, 5.0, 7.0], [3, 5, 7]))
    assert held(read(0.02), 1)[100:-100] == pytest.approx(np.full(3800, 50.0), abs=1.0)


def test_a_mean_has_the_length_that_its_readings_have():
    assert held(np.repeat([0.0, 1.0], [6, 4]), 5) == pytest.approx([6.0, (6.0 + 4.0 * 4.0) / 5.0])
    assert len(held(np.zeros(13), 5)) == 2 and not len(held(np.zeros(3), 5))


def test_what_is_noisier_than_its_grid_is_not_held():
    random = np.random.default_rng(7)
    assert np.mean(held(STEP * np.round(2.0 * random.standard_normal(4000)), 1)) < 1.5
