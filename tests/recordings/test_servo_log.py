"""Logs of Rhoban/bam's recorder: the duty as a ratio, a register with a sign, or lost."""

from __future__ import annotations

import json

import numpy as np
import pytest
from support.servo_logs import SERVO_SIGNALS, write_servo_log

from ema_model.recordings import read_columns

DUTY = np.tile([0.0, 1.0 / 885, -1.0 / 885, 1.0, -1.0], 40)


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "2026-01-15_10h28m10.json"
    time = np.arange(DUTY.size) / 200.0
    write_servo_log(path, {**dict.fromkeys(SERVO_SIGNALS, np.sin(time)), "time_s": time, "duty": DUTY}, kp=100)
    return path


def changed(path, change):
    document = json.loads(path.read_text())
    for i, entry in enumerate(document["entries"]):
        change(i, entry)
    path.write_text(json.dumps(document))


def test_the_register_has_a_sign(log):
    np.testing.assert_allclose(read_columns(log)["duty"], DUTY, rtol=1e-15)


def test_later_logs_have_the_ratio(log):
    changed(log, lambda i, entry: entry.update(load=DUTY[i]))
    np.testing.assert_array_equal(read_columns(log)["duty"], DUTY)


def test_a_duty_between_counts_of_lost_sign_is_none(log):
    changed(log, lambda i, entry: entry.update(load=32_000.5 if i == 3 else entry["load"]))
    columns = read_columns(log)  # as bam/process.py resamples the register
    assert "duty" not in columns and columns["load"][3] == 32_000.5


def test_a_record_without_load_leaves_the_others(log):
    changed(log, lambda i, entry: entry.pop("load") if i == 7 else None)
    columns = read_columns(log)
    assert "duty" not in columns and "position [rad]" in columns
