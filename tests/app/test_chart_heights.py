"""Charts over time in low and in tall windows: as many values at their axes as can be read at a glance."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from emaviz.figures.runs import LEAST_SPACE_PX, value_axis
from emaviz.page import window_layout
from emaviz.page.charts import ChartHeights, spaced
from emaviz.page.window_layout import TWO_COLUMNS_PX


def test_values_keep_a_distance_in_proportion_to_the_height():
    low, high = (spaced(({"label": "time"}, value_axis("A")), height) for height in (64, 240))
    assert low[1] == value_axis("A") and "space" not in low[0]
    assert high[1] == {**value_axis("A"), "space": 40} and LEAST_SPACE_PX < 40


class Pages:
    """What is sent to the one page that is open."""

    def __init__(self):
        self.aspects = []

    def pages(self):
        return (1,)

    def set_aspect(self, client, figure, aspect):
        self.aspects.append(aspect)


def test_a_window_that_has_just_two_columns_is_told_from_one_that_has_not():
    assert TWO_COLUMNS_PX in window_layout.WINDOWS_PX


def test_a_figure_takes_what_its_column_has_between_what_it_needs_and_what_fills_it():
    pages: Any = Pages()
    heights, figure = ChartHeights(pages), SimpleNamespace(_impl=SimpleNamespace(uuid="one"), aspect=0.0)
    heights.set_figure(figure, 300, 500, 800, 200)
    assert figure.aspect == pages.aspects[-1] == pytest.approx(700 / 465), "in the usual window"
    for width, height, px, across in (
        (1900, 1060, 800, 715),
        (1400, 900, 700, 465),
        (1400, 400, 300, 465),
        (1100, 400, 500, 675),
    ):
        heights.fit_width(1, width)
        heights.fit(1, height)
        assert pages.aspects[-1] == pytest.approx(px / across)
