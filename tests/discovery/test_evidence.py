"""Evidence is relative to what is left: at the floor χ² itself, far above it the number of shapes that are left."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from ema_model.comparison.explain import colour as around_orders
from ema_model.discovery.candidates.harmonics import _stands_out
from ema_model.discovery.candidates.paid_for import _lasts
from ema_model.discovery.criteria import LEAST_BIC
from ema_model.discovery.uncertainty import colour, evidence

RANDOM = np.random.default_rng(5)
N = 8000


def data_of(signals=("current_A",), windows=2):
    shown = [
        SimpleNamespace(
            measured=dict.fromkeys(signals), blocks=N // windows, recording=i, time_s=np.arange(N // windows)
        )
        for i in range(windows)
    ]
    return SimpleNamespace(signals=dict.fromkeys(signals, 1.0)), SimpleNamespace(windows=shown)


def fit_of(plant, residual):
    class Fit(SimpleNamespace):
        __hash__ = object.__hash__

    return Fit(plant=plant, residual=residual, calibration=SimpleNamespace(x=np.zeros(1)))


class Data(SimpleNamespace):
    __hash__ = object.__hash__


def test_at_the_floor_a_fall_is_worth_itself():
    data, plant = data_of()
    noise = RANDOM.standard_normal(N)
    assert colour(data, plant, noise) == pytest.approx(1.0, abs=0.1)
    shape = 0.2 * np.sin(np.arange(N) / 40.0)
    told = evidence(Data(**vars(data)), fit_of(plant, noise + shape), fit_of(plant, noise))
    assert told == pytest.approx(np.sum((noise + shape) ** 2) - np.sum(noise**2), rel=0.12)


@pytest.mark.parametrize("size", [10.0, 30.0, 100.0])
def test_far_above_the_floor_nothing_trivial_is_significant(size):
    """A wave of few floors lies in an error of many, that lasts: χ² falls by hundreds, and tells nothing."""
    data, plant = data_of()
    lasting = lfilter([1.0], [1.0, -0.99], RANDOM.standard_normal(N))
    left = size * lasting / np.std(lasting)
    wave = 0.05 * size * np.sin(np.arange(N) / 300.0)
    wave *= 1.0 - 2.0 * (wave @ left < 0.0)
    before, after = fit_of(plant, left + wave), fit_of(plant, left)
    assert before.residual @ before.residual - left @ left > 10.0 * LEAST_BIC
    assert evidence(Data(**vars(data)), before, after) < LEAST_BIC
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


def test_overwhelming_evidence_in_two_moments_counts_in_one_it_does_not():
    """A bus sags where the drive is at its limit, a hundredth of the time."""
    data, plant = data_of()
    noise = RANDOM.standard_normal(N)
    for moments, seen in (([2000], False), ([2000, 6000], True)):
        sag = np.zeros(N)
        for at in moments:
            sag[at : at + 20] = 8.0
        assert _lasts(Data(**vars(data)), fit_of(plant, noise + sag), fit_of(plant, noise)) is seen


def test_an_order_without_a_cause_tells_no_more_than_its_neighbours():
    drops = np.random.default_rng(2).chisquare(2, 96) * 5000.0
    around = dict(zip(range(1, 97), around_orders(drops)))
    assert not _stands_out(53.0, 30_000.0, around)
    assert _stands_out(12.0, 1_200_000.0, around)
