"""Real rigs: the missing effect is named, and what was not fitted improves."""

from __future__ import annotations

import numpy as np
import pytest
from support.pendulum_by_hand import error_by_hand

from ema_model.actuator import load_actuator
from ema_model.comparison import compare
from ema_model.discovery import discover
from ema_model.recordings import read as read_recording


def read(folder, pattern, actuator):
    return [read_recording(file, actuator) for file in sorted(folder.glob(pattern))]


def rms_of(errors) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))


@pytest.mark.long
@pytest.mark.parametrize("moves", [["sin_sin", "up_and_down"], ["*"]], ids=" and ".join)
def test_servo_on_a_pendulum_lacks_friction_that_grows_with_the_load(data_folder, actuators, moves):
    """Fitted at the gains 100 and 800, held out at 400.  Few logs tell it from friction by the motor's torque.

    A servo programmed here, without the project's models, moves as the logs do by as much.
    """
    actuator = load_actuator(actuators / "xl330.toml")
    folder = data_folder / "xl330"
    fitted, held = (
        [one for gain in gains for move in moves for one in read(folder, f"*kp{gain}_{move}.csv", actuator)]
        for gains in ((100, 800), (400,))
    )
    found = discover(fitted, actuator, holdout=held)
    print([(rung.change, rung.signals, rung.holdout_signals, rung.rmse, rung.holdout_rmse) for rung in found.ladder])
    assert found.effects, found
    assert found.effects[0].name == "mesh_friction" and {*found.effects[0].same_as} <= {"load_dependent_friction"}
    before, after = found.ladder[0].holdout_rmse, found.ladder[-1].holdout_rmse
    assert before is not None and after is not None and after <= 0.65 * before
    assert not found.events  # what swings or stalls in its own time did not jump
    ratio = found.effects[0].parameters["ratio"].value
    bare = compare(fitted, actuator).calibration.actuator
    by_hand = [(error_by_hand(bare, one), error_by_hand(found.actuator, one, ratio)) for one in held]
    print(by_hand)
    assert rms_of([after for _, after in by_hand]) <= 0.65 * rms_of([before for before, _ in by_hand])


@pytest.mark.long
def test_spin_ups_lack_cogging(data_folder, actuators):
    """One set of spin-ups fitted, the other held out."""
    actuator = load_actuator(actuators / "odrive.toml")
    folder = data_folder / "odrive"
    found = discover(read(folder, "spinup_4*.csv", actuator), actuator, holdout=read(folder, "spinup_5*.csv", actuator))
    print([(rung.change, rung.signals, rung.holdout_signals) for rung in found.ladder])
    assert {one.name for one in found.effects} == {"cogging_torque"}
    orders = [one.chosen["order"] for one in found.effects]
    assert orders[0] == 7.0 and len({7.0, 12.0, 14.0, 28.0, 36.0, 84.0} & set(orders)) >= 4
    assert found.ladder[-1].signals["current_A"] <= 0.38
    assert found.ladder[-1].holdout_signals["current_A"] <= 0.38 < found.ladder[0].holdout_signals["current_A"]
