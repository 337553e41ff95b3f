"""The study of lives, `assets/plans/lives.toml`: no false trends, and intervals that hold the life that remains."""

from __future__ import annotations

import numpy as np
import pytest
from support.studied import studied

from ema_model.simulated_lives import LAWS

pytestmark = pytest.mark.study


@pytest.mark.parametrize("law", LAWS)
def test_intervals_hold_the_remaining_life(law):
    rows = studied("lives")[law]
    held = [low <= true <= high for row in rows for true, low, high in zip(row["true"], row["p05"], row["p95"])]
    assert len(held) > 4 * len(rows), "most lives are told before they end"
    assert 0.85 <= np.mean(held) <= 0.95


def test_a_healthy_life_has_no_trend():
    rows = studied("lives")["healthy"]
    assert sum(bool(row["trends"]) for row in rows) <= max(1, 0.01 * len(rows))
