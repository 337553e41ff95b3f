"""Charts over time in low and in tall windows: as many values at their axes as can be read at a glance."""

from __future__ import annotations

import pytest
from support.on_page import wait_until

from emaviz.figures.signals import LEAST_SPACE_PX, value_axis
from emaviz.page.chart_heights import spaced

# Of each value axis that is seen: how many values stand at it, and how high its chart is.
VALUES = """() => Object.values(window.__viserTestpoints.uplots).map(one => one.chart)
  .filter(one => one.root.checkVisibility())
  .flatMap(one => one.axes.filter(axis => axis.side % 2 && axis._values)
    .map(axis => [axis._values.filter(text => text).length, one.height]))"""


def test_values_keep_a_distance_in_proportion_to_the_height():
    low, high = (spaced(({"label": "time"}, value_axis("A")), height) for height in (64, 240))
    assert low[1] == value_axis("A") and "space" not in low[0]
    assert high[1] == {**value_axis("A"), "space": 40} and LEAST_SPACE_PX < 40


@pytest.mark.browser
def test_a_tall_window_has_no_more_values_than_one_reads(shared_page):
    page = shared_page
    page.get_by_role("tab", name="Explore", exact=True).click()
    try:
        for width, height in ((1920, 1080), (1400, 900), (1100, 700)):
            page.set_viewport_size({"width": width, "height": height})

            def few() -> bool:
                seen = page.evaluate(VALUES)
                return len(seen) >= 4 and all(2 <= count <= 6 for count, _ in seen)

            wait_until(few, 20.0)
    finally:
        page.set_viewport_size({"width": 1400, "height": 900})
