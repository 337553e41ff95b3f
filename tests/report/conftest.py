"""A comparison to report."""

from __future__ import annotations

import pytest
from support.comparison_by_hand import comparison as by_hand

from ema_model.comparison.result import Comparison


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    """Two recordings."""
    return by_hand(("bench run", "second run"))
