"""Units of the live charts: they follow the range, and stand still within it."""

from __future__ import annotations

import numpy as np
import pytest

from emaviz.figures.runs import charts, fitted

POSITION = next(chart for chart in charts() if chart.signal == "user_position_rad")


def units(values, difference, chart=POSITION):
    chart = fitted(chart, np.array(values), np.array(difference))
    return chart.unit, chart.difference_unit


@pytest.mark.parametrize(
    "values, difference, expected",
    [
        ([-0.005, 0.005], [2e-6], ("mrad", "µrad")),
        ([-0.005, 0.005], [1.2e-3], ("mrad", "mrad")),
        ([0.0, 1.0], [0.3], ("rad", "mrad")),
        ([4e-7], [0.0], ("µrad", "µrad")),
        ([np.nan, np.inf], [np.nan], ("mrad", "µrad")),
    ],
)
def test_a_unit_has_the_prefix_that_its_range_asks_for(values, difference, expected):
    assert units(values, difference) == expected


def test_a_unit_stays_while_a_slider_moves_about_its_limit():
    large = fitted(POSITION, np.array([0.005]), np.array([1.1e-3]))
    assert large.difference_unit == "mrad" and large.difference_scale == 1e3
    assert units([0.005], [0.9e-3], large) == ("mrad", "mrad")
    assert units([0.005], [0.9e-3]) == ("mrad", "µrad")


def test_numbers_are_those_of_the_unit():
    for size in (3e-7, 4e-4, 0.2, 7.0):
        chart = fitted(POSITION, np.array([size]), np.array([size]))
        factor = {"rad": 1.0, "mrad": 1e3, "µrad": 1e6}
        assert chart.scale == factor[chart.unit] and chart.difference_scale == factor[chart.difference_unit]
