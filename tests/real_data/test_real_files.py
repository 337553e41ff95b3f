"""The guessed mapping reads real logs; skipped where the data are not."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from ema_model.recordings import SideFile, guess_mapping, read_columns
from ema_model.recordings.health import health
from ema_model.recordings.read import read_measurement

DATA = Path(os.environ.get("EMAVIZ_DATA") or Path(__file__).resolve().parents[3] / "shared" / "data")
KINDS = {
    "xl330/*.csv": "time_s command_rad user_position_rad motor_speed_rad_s bus_voltage_V duty drive_enabled "
    "temperature_C",
    "odrive/slow2_*.csv": "time_s motor_position_rad current_A",
    "odrive/spinup_*.csv": "time_s motor_position_rad current_A segment",
    "odrive/holdmap_*.csv": "time_s motor_position_rad current_A",
}


@pytest.mark.skipif(not DATA.is_dir(), reason=f"no real data at {DATA}; name their folder in EMAVIZ_DATA")
@pytest.mark.parametrize("kind", KINDS)
def test_guessed_mapping_reads(kind):
    files = sorted(DATA.glob(kind))
    if not files:  # `emaviz data` makes the XL330's alone
        pytest.skip(f"no {kind} in {DATA}")
    for path in files:
        columns = read_columns(path)
        side = SideFile(kind="map" if "holdmap" in kind else "run")
        measurement = read_measurement(path, guess_mapping(columns), side=side)
        assert set(measurement) == set(KINDS[kind].split())
        assert measurement.samples == next(iter(columns.values())).size
        assert all(np.isfinite(values).all() for values in measurement.signals.values())
        card = health(measurement)
        assert card.findings and all(finding.sentence.isprintable() for finding in card.findings)
        if "xl330" in kind:
            speed = card.of("speed")
            assert speed is not None and speed.values["ratio"] == pytest.approx(1.0, abs=0.05)
            assert 180.0 < measurement.samples / measurement.duration_s < 260.0
        if "spinup" in kind:
            assert len(measurement.runs) == 50
