"""The data class: its time base, copies and resampling."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ema_model.errors import InputError
from ema_model.recordings import Measurement


def line(time, **more):
    """A signal linear in time."""
    time = np.asarray(time, dtype=float)
    return Measurement({"time_s": time, "current_A": 3.0 * time - 2.0, **more}, name="line")


def test_time_base():
    measurement = line([1.0, 1.1, 1.2, 1.31])
    assert measurement.samples == 4
    assert measurement.duration_s == pytest.approx(0.31)
    assert measurement.sample_period_s == pytest.approx(0.1)
    assert measurement.jitter == pytest.approx(0.2 / 3)
    assert not measurement.is_uniform
    assert line(np.arange(500_000) * 1e-4).is_uniform
    assert line([0.0, 1.0, 2.0005]).is_uniform and not line([0.0, 1.0, 2.0015, 3.0]).is_uniform
    assert np.isnan(line([5.0]).sample_period_s) and line([5.0]).is_uniform
    assert line([]).duration_s == 0.0


def test_signals_are_copied_once_and_cannot_be_written():
    time = np.arange(3.0)
    measurement = line(time)
    time[0] = 9.0
    assert measurement.time_s[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        measurement["current_A"][0] = 1.0
    changed = measurement.with_signals(duty=[1, 0, 1], current_A=np.zeros(3))
    assert changed["time_s"] is measurement["time_s"] and changed.name == "line"
    assert "duty" in changed and "duty" not in measurement and measurement["current_A"][0] == -2.0
    assert changed["duty"].dtype == np.float64
    assert measurement.get("duty") is None and changed.get("duty", 0.0) is changed["duty"]


def test_needs_time_and_one_length():
    with pytest.raises(InputError, match="time_s is needed"):
        Measurement({"current_A": np.zeros(3)})
    with pytest.raises(InputError, match=r"duty has the shape \(2,\), but time_s has 3 samples"):
        line(np.arange(3.0), duty=np.zeros(2))
    with pytest.raises(InputError, match="shape"):
        Measurement({"time_s": np.zeros((2, 2))})


@settings(max_examples=50, deadline=None)
@given(
    steps=st.lists(st.floats(1e-4, 2e-3), min_size=2, max_size=50),
    start=st.floats(-5.0, 5.0),
    period=st.floats(1e-4, 1e-2),
)
def test_resampling_is_exact_on_a_line(steps, start, period):
    measurement = line(start + np.cumsum(steps))
    resampled = measurement.resampled(period)
    time = resampled.time_s
    np.testing.assert_allclose(resampled["current_A"], 3.0 * time - 2.0, rtol=0, atol=1e-7)
    np.testing.assert_allclose(np.diff(time), period, rtol=1e-9)
    assert time[0] == measurement.time_s[0]
    assert -1e-5 * period <= measurement.time_s[-1] - time[-1] < period
    assert resampled.is_uniform and "resampled from" in resampled.notes[-1]


def test_resampling_to_its_own_grid_changes_nothing():
    time = np.arange(1000) * 1e-4
    measurement = line(time, segment=np.zeros(1000), drive_enabled=np.arange(1000) % 2)
    resampled = measurement.resampled(1e-4)
    assert resampled.samples == 1000
    for name in measurement:
        np.testing.assert_allclose(resampled[name], measurement[name], rtol=1e-12, atol=1e-12)


def test_states_are_held_and_segments_kept_apart():
    measurement = line([0.0, 1.0, 2.0, 0.5, 1.5], drive_enabled=[0, 1, 1, 1, 0], segment=[1, 1, 1, 2, 2])
    assert measurement.runs == [slice(0, 3), slice(3, 5)]
    assert measurement.duration_s == 3.0 and measurement.sample_period_s == 1.0 and measurement.is_uniform
    resampled = measurement.resampled(0.5)
    np.testing.assert_allclose(resampled.time_s, [0, 0.5, 1, 1.5, 2, 0.5, 1, 1.5])
    np.testing.assert_allclose(resampled["current_A"], 3.0 * resampled.time_s - 2.0)
    np.testing.assert_array_equal(resampled["drive_enabled"], [0, 0, 1, 1, 1, 1, 1, 0])
    np.testing.assert_array_equal(resampled["segment"], [1, 1, 1, 1, 1, 2, 2, 2])


@pytest.mark.parametrize("period", [0.0, -1.0, np.nan, np.inf, 1e-12])
def test_periods_that_give_no_grid(period):
    with pytest.raises(InputError, match="sample period"):
        line(np.arange(10.0)).resampled(period)
