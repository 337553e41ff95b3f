"""Readings, spectra and events of known signals."""

from __future__ import annotations

import numpy as np
import pytest

from ema_model.errors import InputError
from ema_model.recordings.signals import event, reading, spectrum

TIME = np.linspace(0.0, 1.0, 2001)


def test_a_reading_is_the_integral_over_its_window():
    """Of a sine over whole periods on a ramp, between samples, whatever their steps are."""
    uneven = np.sort(np.random.default_rng(1).uniform(0.0, 1.0, 40_000))
    uneven[[0, -1]] = 0.0, 1.0
    for time_s in (np.linspace(0.0, 1.0, 20_001), uneven):
        found = reading(time_s, 3.0 + 2.0 * np.sin(20.0 * np.pi * time_s), 0.70003, 0.20003)
        assert found.mean == pytest.approx(3.0, abs=1e-4)
        assert found.rms == pytest.approx(np.sqrt(11.0), abs=1e-4)
        assert found.difference == pytest.approx(0.0, abs=1e-4) and found.first == pytest.approx(found.last, abs=1e-4)
    ramp = reading(TIME, 5.0 - 4.0 * TIME, 0.10007, 0.6)
    assert (ramp.slope, ramp.difference) == (pytest.approx(-4.0), pytest.approx(-4.0 * (0.6 - 0.10007)))
    assert ramp.mean == pytest.approx(5.0 - 4.0 * 0.5 * (0.6 + 0.10007))


def test_samples_that_are_missing_are_left_out_and_beyond_the_signal_nothing_is_said():
    values = np.where(np.abs(TIME - 0.5) < 0.01, np.nan, 2.0)
    assert reading(TIME, values, 0.3, 0.7).rms == pytest.approx(2.0)
    outside = reading(TIME, values, 0.9, 1.1)
    assert outside.first == pytest.approx(2.0) and np.isnan([outside.last, outside.mean, outside.slope]).all()
    assert np.isnan(reading(TIME, np.full(2001, np.nan), 0.1, 0.2).first)


def test_a_spectrum_has_a_sines_amplitude_at_its_frequency():
    values = 7.0 + 30.0 * TIME + 1.5 * np.sin(2.0 * np.pi * 50.0 * TIME) + 0.2 * np.cos(2.0 * np.pi * 333.0 * TIME)
    frequency, amplitude = spectrum(TIME[:-1], values[:-1])
    assert frequency[0] == pytest.approx(1.0) and frequency[-1] == pytest.approx(1000.0)
    for tone, size in ((50.0, 1.5), (333.0, 0.2)):
        at = int(np.argmin(np.abs(frequency - tone)))
        assert amplitude[at] == pytest.approx(size, rel=0.02)
    assert np.max(amplitude[(frequency > 60.0) & (frequency < 300.0)]) < 1e-2
    with pytest.raises(InputError, match="needs 16 samples"):
        spectrum(TIME[:9], values[:9])


def test_the_event_of_a_step_is_found_in_noise_and_a_sine_has_none():
    rise = np.clip((TIME - 0.4) / 0.05, 0.0, 1.0)
    noise = np.random.default_rng(2).normal(0.0, 0.003, TIME.shape)
    for sign in (1.0, -1.0):
        low, high = event(TIME, sign * rise + noise)
        assert 0.38 < low < 0.402 < 0.445 < high < 0.48
    assert event(TIME, np.sin(40.0 * TIME)) is None and event(TIME, noise) is None
    assert event(TIME, np.zeros(2001)) is None and event(TIME[:5], rise[:5]) is None
    both = event(TIME, rise, np.clip((TIME - 0.6) / 0.05, 0.0, 1.0))
    assert both[0] < 0.4 and both[1] > 0.65, "until all have settled"
