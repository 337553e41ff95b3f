"""How many values a residual counts for: all at the floor, far above it the number of shapes that are left."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from ema_model.discovery.uncertainty import colour
from ema_model.estimation.model_fit import Data

RANDOM = np.random.default_rng(5)
N = 8000


def data_of(signals=("current_A",), windows=2):
    shown = [
        SimpleNamespace(
            measured=dict.fromkeys(signals), blocks=N // windows, recording=i, time_s=np.arange(N // windows)
        )
        for i in range(windows)
    ]
    return Data((), None, (), dict.fromkeys(signals, 1.0)), SimpleNamespace(windows=shown)


def test_at_the_floor_each_value_counts():
    data, plant = data_of()
    assert colour(data, plant, RANDOM.standard_normal(N)) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("size", [10.0, 30.0, 100.0])
def test_far_above_the_floor_few_values_are_left(size):
    """An error of many floors that lasts is of few shapes."""
    data, plant = data_of()
    lasting = lfilter([1.0], [1.0, -0.99], RANDOM.standard_normal(N))
    left = size * lasting / np.std(lasting)
    assert np.sum(left**2 / colour(data, plant, left)) < 0.05 * N


def test_bursts_count_as_few_as_they_are():
    data, plant = data_of()
    burst = np.where(np.arange(N) % 2000 < 60, 20.0, 1.0) * RANDOM.standard_normal(N)
    assert np.all(colour(data, plant, burst) > 30.0)


def test_each_signal_has_its_own_colour():
    data, plant = data_of(("current_A", "user_position_rad"), windows=1)
    lasting = 30.0 * np.sin(np.arange(N) / 200.0)
    found = colour(data, plant, np.concatenate([RANDOM.standard_normal(N), lasting]))
    assert found[0] < 1.2 and found[-1] > 1e4
