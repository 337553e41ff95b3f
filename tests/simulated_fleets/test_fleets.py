"""Fleets that are made: what is drawn is in the recordings, and nothing else differs."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.errors import InputError
from ema_model.recordings import read
from ema_model.simulated_fleets import RUNS, TRUTH, draw, own, read_truth, recorded, told, write

ACTUATOR = load_actuator()


def test_units_differ_in_what_is_drawn_and_in_nothing_else():
    counts, several, alike = set(), set(), 0
    for seed in range(30):
        fleet = draw(ACTUATOR, seed, size=8.0)
        assert np.sum(np.ptp(fleet.x, axis=0) > 1e-12) == len(fleet.differences)
        for one in fleet.differences:
            at = fleet.parameters.index(one.parameter)
            moved = fleet.x[list(one.units), at] - np.delete(fleet.x[:, at], one.units)[0]
            assert moved == pytest.approx(one.change) and one.parameter in one.together
            assert 2 * len(one.units) <= len(fleet.names)
            alike += len(one.units) == 2
        counts.add(len(fleet.names))
        several.add(len(fleet.differences))
        assert np.abs(fleet.x).max() <= 4.5 and len(set(fleet.names)) == len(fleet.x)
    assert min(counts) == 2 and max(counts) >= 18 and several == {1, 2, 3} and alike > 2


def test_what_is_only_known_together():
    """Torque constant and speed gain show as their product where no limit is met; a fast step tells them apart."""
    both = {"controller.speed_gain_Nms_rad", "motor.torque_constant_Nm_A"}
    by_name = {one.parameter: one for one in own(ACTUATOR, ("chirp", "loaded"))}
    assert all(set(by_name[name].together) == both for name in both)
    assert all(len(one.together) == 1 for one in own(ACTUATOR, tuple(RUNS)))
    names = {one.parameter for one in own(ACTUATOR, ("chirp",))}
    assert "motor.resistance_Ohm" not in names and "motor.inertia_kgm2" in names


def test_all_units_scatter_where_that_is_asked():
    fleet = draw(ACTUATOR, 3, units=20, differing=0, spread=0.3)
    assert fleet.x.std(axis=0).mean() == pytest.approx(0.3, abs=0.05) and not fleet.differences


def test_recordings_are_of_the_unit_and_no_two_are_alike():
    fleet = draw(ACTUATOR, 4, units=2, differing=0)
    one, again, other = (recorded(fleet.unit(unit), 4, unit, ["step"])["step"] for unit in (0, 0, 1))
    assert np.array_equal(one["current_A"], again["current_A"])
    apart = one["current_A"] - other["current_A"]
    assert 0.6 < np.std(apart) < 1.5  # the sensors' noise, twice, and the chopping
    assert set(one.signals) >= {"time_s", "command_rad", "motor_position_rad", "current_A"}


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"units": 1}, "2 to 20"),
        ({"differing": 4}, "0 to 3"),
        ({"size": 0.1}, "1 to 10"),
        ({"spread": 2.0}, "0 to 0.5"),
    ],
)
def test_no_such_fleet(asked, words):
    with pytest.raises(InputError, match=words):
        draw(ACTUATOR, 0, **asked)


def test_a_fleet_as_a_folder(tmp_path):
    fleet = draw(ACTUATOR, 5, units=2, differing=1, runs=("step",))
    folder = tmp_path / "fleet"
    write(fleet, folder)
    assert sorted(path.name for path in folder.iterdir()) == ["actuator.toml", TRUTH, "unit_01", "unit_02"]
    assert {path.name for path in (folder / "unit_02").iterdir()} == {"step.parquet", "unseen.parquet"}
    assert read(folder / "unit_01" / "step.parquet", load_actuator(folder / "actuator.toml")).samples > 1000
    assert read_truth(folder) == told(fleet) and told(fleet)[0]["parameter"] not in (folder / TRUTH).read_text()
    with pytest.raises(InputError, match="not empty"):
        write(fleet, folder)
    found = subprocess.run(
        [sys.executable, "-m", "ema_model.simulated_fleets", str(folder)], capture_output=True, text=True, check=True
    )
    assert fleet.differences[0].parameter in found.stdout
