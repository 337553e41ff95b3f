"""Settings: a browser may send anything, and only sense gets in."""

from __future__ import annotations

import math

import pytest

from ema_model.errors import InputError
from emaviz.session.settings import Settings

NONSENSE = [math.nan, math.inf, "abc", None, "", [], {}, "<script>"]


def test_faults_are_clamped_to_the_box():
    settings = Settings()
    assert settings.set_fault(0, 99.5) == 1.0
    assert settings.set_fault(1, -3) == 0.0
    assert settings.set_fault(2, "0.25") == 0.25


@pytest.mark.parametrize("value", NONSENSE)
@pytest.mark.parametrize(
    "setter", ["set_duration", "set_load", "set_population", "set_iterations", "set_seed", "set_algorithm",
               "set_fitness", "set_monitor", "set_command"],
)  # fmt: skip
def test_nonsense_is_refused_and_changes_nothing(setter, value):
    settings = Settings()
    before = {name: getattr(settings, name) for name in vars(settings) if name != "k"}
    with pytest.raises(InputError) as told:
        getattr(settings, setter)(value)
    assert "\n" not in str(told.value)
    assert {name: getattr(settings, name) for name in vars(settings) if name != "k"} == before


@pytest.mark.parametrize("value", [0, 1e9, -1, 2.5])
def test_sizes_that_would_hang_are_refused(value):
    with pytest.raises(InputError):
        Settings().set_population(value)


def test_a_bad_command_setting_leaves_the_old_one():
    settings = Settings()
    settings.set_command_setting("chirp", "end_Hz", 20.0)
    with pytest.raises(InputError):
        settings.set_command_setting("chirp", "end_time_s", 0.0)
    with pytest.raises(InputError):
        settings.set_command_setting("multisine", "frequencies_Hz", "1+x")
    assert settings.run().command.settings()["end_Hz"] == 20.0
