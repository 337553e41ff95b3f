"""Settings: a browser may send anything, and only sense gets in."""

from __future__ import annotations

import json
import math

import pytest

from ema_model.errors import InputError
from ema_model.quantities import Axes
from emaviz.session.settings import Settings, limits

NONSENSE = [math.nan, math.inf, "abc", None, "", [], {}, "<script>"]


def test_faults_are_clamped_to_the_box():
    settings = Settings()
    assert settings.set_fault(0, 99.5) == 1.0
    assert settings.set_fault(1, -3) == 0.0
    assert settings.set_fault(2, "0.25") == 0.25


@pytest.mark.parametrize("value", NONSENSE)
@pytest.mark.parametrize(
    "name",
    sorted({*Settings.__struct_fields__} - {"axes", "source", "command_settings", "effects"}),
)
def test_nonsense_is_refused_and_changes_nothing(name, value):
    settings = Settings()
    before = json.dumps(settings.saved())
    with pytest.raises(InputError) as told:
        settings.set(name, value)
    assert "\n" not in str(told.value)
    assert json.dumps(settings.saved()) == before


@pytest.mark.parametrize(
    ("name", "value", "line"),
    [
        ("duration_s", 7.0, "the duration must lie between 0.01 and 5 s, not 7"),
        ("load_torque_Nm", -2e3, "the load must lie between −1000 and 1000 N, not -2000"),
        ("population", 2.5, "population must be a whole number from 4 to 1000, not 2.5"),
        ("seed", "x", "seed must be a whole number from 0 to 2147483647, not 'x'"),
        ("start_side", math.nan, "the side of the play must lie between −1 and 1, not nan"),
        ("monitor", "none", "monitor model must be one of healthy, same faults, identified, not 'none'"),
        ("source", 7, "what to identify must be a text, not 7"),
        ("k", [0.0] * 7, "k must be a list of 8 numbers"),
    ],
)
def test_what_is_refused_is_said_with_its_name_its_range_and_its_unit(name, value, line):
    with pytest.raises(InputError) as told:
        Settings(axes=Axes("rotary", "linear")).set(name, value)
    assert str(told.value).startswith(line)


def test_a_control_has_the_range_of_its_setting():
    assert limits(Settings, "population") == {"min": 4, "max": 1000}
    assert limits(Settings, "duration_s") == {"min": 0.01, "max": 5.0} and limits(Settings, "source") == {}


@pytest.mark.parametrize("value", [0, 1e9, -1, 2.5])
def test_sizes_that_would_hang_are_refused(value):
    with pytest.raises(InputError):
        Settings().set("population", value)


def test_a_bad_command_setting_leaves_the_old_one():
    settings = Settings()
    settings.set_command_setting("chirp", "end_Hz", 20.0)
    with pytest.raises(InputError):
        settings.set_command_setting("chirp", "end_time_s", 0.0)
    with pytest.raises(InputError):
        settings.set_command_setting("multisine", "frequencies_Hz", "1+x")
    assert settings.run().command.settings()["end_Hz"] == 20.0
