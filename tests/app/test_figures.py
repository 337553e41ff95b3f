"""Figures: the envelope keeps every peak; the bars escape what they show."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.effects import find
from emaviz import figures
from emaviz.figures.discovery import _symbol
from emaviz.figures.identification import fault_bars
from emaviz.figures.theme import envelope


@pytest.mark.parametrize("n", [10, 999, 1000, 1001, 5001, 123_457])
def test_the_envelope_keeps_minimum_and_maximum(n):
    random = np.random.default_rng(n)
    x = np.arange(n) * 1e-4
    spikes = random.standard_normal(n)
    spikes[random.integers(n)] = 50.0
    spikes[random.integers(n)] = -60.0
    drawn_x, drawn, other = envelope(x, [spikes, x], points=1000)
    assert len(drawn_x) == len(drawn) == len(other) <= 1000 if n > 1000 else n
    assert drawn.max() == spikes.max() and drawn.min() == spikes.min()
    assert np.all(np.diff(drawn_x) > 0.0)
    assert np.all(np.diff(other) >= 0.0)  # a rising line stays one


def test_bars_hold_all_faults_and_stay_inside():
    page = fault_bars(np.full(8, 2.0), load_actuator(), np.zeros(8), np.tile([-1.0, 3.0], (8, 1)), ("k1",))
    for i in range(1, 9):
        assert f"<b>k{i}</b>" in page
    assert "script" not in page and "-100" not in page and "200.00%" not in page


def test_titles_of_axes_begin_with_a_capital():
    axis = re.compile(r'(?:AXIS, "label": |title_text=f?|theme\.new\([^()]*?, )"([a-z]{3}[^"]*)"')
    found = {
        (path.name, text)
        for path in Path(figures.__file__).parent.glob("*.py")
        for text in axis.findall(path.read_text())
    }
    assert not found


def test_symbols_of_fitted_values_are_set_as_in_their_equation():
    assert "<msub>" in _symbol(find("hinge_moment"), "offset_Nm"), "no H_0 beside an equation that is typeset"
