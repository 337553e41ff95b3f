"""A large recording, of every format, is read in 4 s and its health card made in 1 s."""

from __future__ import annotations

from time import perf_counter

import numpy as np
import pytest

from ema_model.recordings import Measurement, write_measurement
from ema_model.recordings.health import health
from ema_model.recordings.read import read_measurement


@pytest.mark.study
@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".npz", ".mat"])
def test_a_million_samples(suffix, tmp_path):
    time = np.arange(1_000_000) / 10_000.0
    rng = np.random.default_rng(13)
    names = "command_rad user_position_rad motor_position_rad motor_speed_rad_s current_A bus_voltage_V temperature_C"
    signals = {name: np.round(np.sin((1.0 + i) * time) + 0.01 * rng.normal(size=time.size), 6) for i, name in
               enumerate(names.split())}  # fmt: skip
    write_measurement(Measurement({"time_s": time, **signals}), tmp_path / f"a{suffix}")
    seconds = []
    for _ in range(3):
        began = perf_counter()
        measurement = read_measurement(tmp_path / f"a{suffix}")
        between = perf_counter()
        assert health(measurement).findings
        seconds.append((between - began, perf_counter() - between))
    reading, checking = np.median(seconds, axis=0)
    print(f"{suffix}: read in {reading:.2f} s, health in {checking:.2f} s")
    assert len(measurement.signals) == 8 and reading <= 4.0 and checking <= 1.0
