"""Held-out recordings whose encoder is turned, mirrored or shifted: it is said, and the effect is named."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.unknown_drive import drive_of, logged

from ema_model.discovery import Discovery, discover
from ema_model.recordings import Measurement
from ema_model.recordings.side_file import SideFile

AMONG = ("cogging_torque", "torque_ripple", "hinge_moment", "friction_zone")


def held_map(seed: int, turned_rad: float = 0.0, sign: float = 1.0, waves=((0.004, 7.0, 0.4),)) -> Measurement:
    """The current that holds a rotor against its cogging, by the angle that its encoder shows."""
    random = np.random.default_rng(seed)
    shown = np.linspace(0.0, 2.0 * np.pi, 500, endpoint=False)
    true = sign * shown + turned_rad
    torque = sum(size * np.sin(order * true + phase) for size, order, phase in waves)
    current = torque / 0.05 + 0.004 * random.standard_normal(shown.size)
    signals = {"time_s": np.arange(500.0), "motor_position_rad": shown, "current_A": current}
    return Measurement(signals, name=f"map {seed}", side=SideFile(kind="map"))


def found_of(folder, held: Measurement, **how) -> Discovery:
    fitted = [held_map(1, **how), held_map(2, **how)]
    return discover(fitted, drive_of(folder, False), holdout=[held], candidates=AMONG)


@pytest.mark.parametrize("turned_rad", [0.5 * math.pi, 0.3, 0.0])
def test_a_map_against_a_turned_one_names_its_cogging(tmp_path, turned_rad):
    found = found_of(tmp_path, held_map(5, turned_rad))
    assert found.verdict == "effects_found" and [one.name for one in found.effects] == ["cogging_torque"]
    assert (found.ladder[-1].holdout_rmse or 9.0) < 1.2
    if turned_rad == 0.0:
        assert not found.disagreements
        return
    [one] = found.disagreements
    assert one.recording == "map 5" and one.signal == "motor_position_rad" and one.before > 3.0 > 1.3 > one.after
    assert one.how == "zero" and "its encoder turned by" in one.sentence and one.sentence in str(found)


@pytest.mark.parametrize(
    ("turned_rad", "sign", "said"), [(0.5 * math.pi, 1.0, "turned by 90"), (0.3, -1.0, "mirrored")]
)
def test_a_map_of_several_orders_tells_the_turn_itself(tmp_path, turned_rad, sign, said):
    waves = ((0.004, 7.0, 0.4), (0.003, 12.0, 1.1))
    found = found_of(tmp_path, held_map(5, turned_rad, sign, waves=waves), waves=waves)
    assert {one.name for one in found.effects} == {"cogging_torque"} and (found.ladder[-1].holdout_rmse or 9.0) < 1.3
    [one] = found.disagreements
    assert said in one.sentence and one.how == ("zero" if sign > 0.0 else "sign")


def test_another_rotor_is_not_taken_for_a_turned_one(tmp_path):
    found = found_of(tmp_path, held_map(5, waves=((0.004, 5.0, 0.4),)))
    assert all("encoder turned" not in one.sentence for one in found.disagreements)
    assert found.verdict == "partly_explained"


@pytest.mark.long
def test_a_motion_of_a_turned_encoder_names_its_cogging(tmp_path):
    moves = [logged(i, hidden=lambda angle, speed: 0.004 * np.sin(3.0 * angle), name=f"move {i}") for i in range(3)]
    held = moves[2].with_signals(motor_position_rad=moves[2]["motor_position_rad"] + 0.7)
    found = discover(moves[:2], drive_of(tmp_path, False), holdout=[replace(held, name="turned")])
    assert [one.name for one in found.effects] == ["cogging_torque"]
    [one] = found.disagreements
    assert one.recording == "turned" and one.how == "zero"
