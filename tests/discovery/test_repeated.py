"""Where a command was recorded twice, the rig's own repeatability says whether the floor is believable."""

from __future__ import annotations

from dataclasses import replace

import pytest

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.discovery.discover import result_of
from ema_model.discovery.history import begun
from ema_model.discovery.words import document_of
from ema_model.faults import vector
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_reference

ACTUATOR = load_actuator()


def recorded(name, seed, frequency=4.0, **faults):
    run = Run(command("sine", {"amplitude_rad": 0.02, "frequency_Hz": frequency}), 0.5)
    clean = simulate_reference(run, ACTUATOR, vector(faults))
    return replace(Sensors(current_noise_A=0.2, encoder_bits=14).record(clean, seed), name=name)


def found_in(fitted, held=()):
    return result_of(begun(fitted, ACTUATOR, held))


def test_a_rig_that_repeats_itself_bears_out_the_floor():
    found = found_in([recorded("one", 1), recorded("other", 2, 3.0)], [recorded("again", 3)])
    twice = found.repeated
    assert twice is not None and twice.recordings == ("one", "again")
    assert 0.4 < twice.apart < 1.3 and twice.signals["current_A"] > 0.0
    document = found.to_dict()
    assert document["floor_believable"] and document["ladder"][0]["rmse"] == pytest.approx(found.ladder[0].rmse)
    assert "one and again are of one command" in str(document_of(found))


def test_a_rig_that_does_not_has_errors_in_units_alone():
    found = found_in([recorded("one", 1), recorded("worn", 2, k1=0.6)])
    twice = found.repeated
    assert twice is not None and twice.apart > 2.0
    document = found.to_dict()
    (rung,) = document["ladder"]
    assert document["floor_believable"] is False and document["repeatability"]["over_floor"] > 2.0
    assert rung["rmse"] is None and rung["holdout_rmse"] is None and rung["signals"]["current_A"] > 0.0
    text = str(document_of(found))
    assert "errors count in units alone" in text and "(rms of what was fitted)" in text and "1 is the floor" not in text


def test_where_no_command_was_repeated_nothing_is_said():
    found = found_in([recorded("one", 1), recorded("other", 2, 3.0)])
    assert found.repeated is None and found.to_dict()["repeatability"] is None
    assert found.to_dict()["floor_believable"]
