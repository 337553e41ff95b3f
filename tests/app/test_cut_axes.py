"""An axis that a start alone would set is cut, and says so; any other shows all of its values."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go
import pytest

from emaviz.figures.theme import cut, cut_note, end_of

NOISE = 0.1 * np.random.default_rng(1).standard_normal(1000)
START = np.concatenate([np.full(5, -3.0), NOISE[5:]])


def test_a_start_does_not_set_the_axis():
    end = end_of(START)
    assert end == pytest.approx(0.5) and np.count_nonzero(np.abs(START) > end) == 5
    assert cut_note(end, START, "A") == "cut at ±0.5 A, largest 3.00 A"
    figure: Any = go.Figure(go.Scatter(y=START))
    cut(figure, START, "A")
    assert tuple(figure.layout.yaxis.range) == (-end, end) and "cut at" in figure.layout.annotations[0].text


@pytest.mark.parametrize("values", [NOISE, np.sin(np.arange(1000.0)), np.zeros(10), [], [np.nan, 1.0]])
def test_any_other_shows_all(values):
    assert end_of(values) is None
    figure: Any = go.Figure()
    cut(figure, values, "A")
    assert figure.layout.yaxis.range is None and not figure.layout.annotations
