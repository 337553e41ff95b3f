"""Orders along a linear motor: those of its magnets and its screw stand out of the periodogram."""

from __future__ import annotations

import numpy as np
import pytest

from ema_model.comparison import explain
from ema_model.comparison.explain import HIGHEST, pitches

X = 0.1 * np.sin(np.linspace(0.0, 20.0, 3000)) + 0.02  # m, not evenly
NOISE = 0.2 * np.random.default_rng(3).standard_normal(X.size)


def test_pitches_are_found_with_their_amplitude_and_phase():
    teeth, lead = 2.0 * np.pi * 12 / 0.01, 2.0 * np.pi / 0.01
    first, second = pitches(X, 0.5 + 0.4 * np.sin(teeth * X + 0.7) + 0.2 * np.sin(lead * X - 1.0) + NOISE)[:2]
    assert first.order == pytest.approx(teeth, abs=1.0) and second.order == pytest.approx(lead, abs=2.0)
    assert first.amplitude == pytest.approx(0.4, rel=0.1) and first.phase == pytest.approx(0.7, abs=0.1)
    assert second.amplitude == pytest.approx(0.2, rel=0.2)


def test_noise_has_no_pitch():
    strongest = pitches(X, NOISE)[0]
    assert not strongest.is_significant(2000)


def test_a_pitch_that_blocks_pass_over_is_not_looked_for():
    fast = np.full(X.size, 2e-3)  # m a block
    assert all(one.order < 0.61 * 2.0 * np.pi / 2e-3 for one in pitches(X, NOISE, fast))
    assert max(one.order for one in pitches(X, NOISE)) <= HIGHEST * 1.01


def test_as_many_at_once_as_memory_lets_tell_the_same(monkeypatch):
    """The last part may be one order alone, and of a long recording each is."""
    x = X[::10]
    values = np.sin(2.0 * np.pi * 40.0 * x) + NOISE[::10]
    at_once = pitches(x, values)
    for size in (x.size, 7 * x.size):
        monkeypatch.setattr(explain, "_AT_ONCE", size)
        assert [one.order for one in pitches(x, values)] == pytest.approx([one.order for one in at_once])


@pytest.mark.parametrize("x", [np.zeros(100), np.full(100, np.nan), np.zeros(0)])
def test_without_travel_there_is_none(x):
    assert pitches(x, np.ones(x.size)) == []
