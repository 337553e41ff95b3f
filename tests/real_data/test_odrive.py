"""A brushless motor with cogging: spin-ups by inverse dynamics, slow sweeps, and static hold maps."""

from __future__ import annotations

import pytest

from ema_model.actuator import load_actuator
from ema_model.comparison import compare
from ema_model.recordings import read

KNOWN_ORDERS = {7, 12, 14, 28, 36, 84}


@pytest.fixture(scope="module")
def actuator(actuators):
    return load_actuator(actuators / "odrive.toml")


def test_spin_ups_show_cogging(data_folder, actuator):
    files = sorted((data_folder / "odrive").glob("spinup_*.csv"))
    found = compare([read(file, actuator) for file in files], actuator)
    assert found.calibration is not None and found.calibration.converged
    first = found.explained_by[0]
    assert first.variable == "motor_angle" and first.significant
    assert len(KNOWN_ORDERS & {one.order for one in found.orders[:6]}) >= 3
    # inertia, Coulomb and viscous friction alone leave 0.432 A by another implementation and filter
    assert found.signals["current_A"].rmse == pytest.approx(0.42, abs=0.03)
    assert "A more current" in found.sentences[2], "without a torque constant currents are told as they are"


@pytest.mark.parametrize("name", ["holdmap_a_4", "holdmap_a_16"])
def test_hold_map_orders(data_folder, actuator, name):
    found = compare([read(data_folder / "odrive" / f"{name}.csv", actuator)], actuator)
    assert found.recordings[0].measurement.is_map
    assert [one.order for one in found.orders[:3]] == [7, 28, 14]
    known = {7: 0.86, 28: 0.56, 14: 0.35, 36: 0.29, 12: 0.26, 84: 0.12}
    for one in found.orders[:6]:
        assert one.amplitude == pytest.approx(known[one.order], abs=0.02)


@pytest.mark.long
def test_slow_sweeps_show_the_same_orders(data_folder, actuator):
    recordings = [read(file, actuator) for file in sorted((data_folder / "odrive").glob("slow2_*.csv"))]
    found = compare([recording.selected((1.0, 1e9)) for recording in recordings], actuator)
    assert found.explained_by[0].variable == "motor_angle"
    assert {7, 28, 14} <= {one.order for one in found.orders[:4]}
