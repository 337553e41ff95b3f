"""A hinge moment and an acceleration are the same curve turned over in one sine; a second frequency parts them."""

from __future__ import annotations

import pytest
from support.hidden_effects import ACTUATOR, SINE, recorded

from ema_model.comparison import compare

FASTER = ("sine", {"amplitude_rad": 0.015, "frequency_Hz": 6}, 1.0)  # half the angle, twice the acceleration
HINGE = {"hinge_moment": {"stiffness_Nm_rad": 1000.0}}
_APART = 0.1  # of what may be explained; directness, the tie-break, is worth 0.02


def _ahead(seed: int, commands) -> float:
    """What the user's position explains, of what may be explained at all, less what the acceleration does."""
    found = compare(recorded(seed, commands=commands, effects=HINGE), ACTUATOR)
    r2 = {one.variable: one.beyond_noise for one in found.explained_by if one.modulator == "1"}
    assert found.explained_by[0].variable == "user_position" and found.explained_by[0].significant
    return r2["user_position"] - r2["acceleration"]


@pytest.mark.long
@pytest.mark.parametrize("seed", [61002, 61003])
def test_second_frequency_tells_a_hinge_moment_from_an_acceleration(seed):
    assert _ahead(seed, [SINE, FASTER]) > _APART


def test_one_sine_leaves_it_to_the_tie_break():
    assert abs(_ahead(61002, [SINE])) < _APART
