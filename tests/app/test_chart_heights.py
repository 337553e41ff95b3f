"""Charts over time in low and in tall windows: as many values at their axes as can be read at a glance."""

from __future__ import annotations

from emaviz.figures.signals import LEAST_SPACE_PX, value_axis
from emaviz.page.chart_heights import spaced


def test_values_keep_a_distance_in_proportion_to_the_height():
    low, high = (spaced(({"label": "time"}, value_axis("A")), height) for height in (64, 240))
    assert low[1] == value_axis("A") and "space" not in low[0]
    assert high[1] == {**value_axis("A"), "space": 40} and LEAST_SPACE_PX < 40
