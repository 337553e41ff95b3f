"""Colours mean one thing each, and stay apart for the colour-blind where they stand beside each other."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from emaviz import colours
from emaviz.colours import rgb

MEANT = {
    name: getattr(colours, name)
    for name in ("REFERENCE MONITOR DIFFERENCE COMMAND FAULT FITTED HELD_OUT LIMIT TRUTH".split())
}
OTHERS = {
    *colours.CASES,
    *colours.RUNS,
    *colours.PHASES,
    *(one for one in colours.ALGORITHMS.values() if one != colours.MONITOR),
    colours.FORWARD,
    colours.BACKWARD,
    colours.GHOST,
}
BESIDE = {
    "a race": (*colours.ALGORITHMS.values(), colours.REFERENCE),
    "both directions": (colours.FORWARD, colours.BACKWARD, colours.MONITOR),
    "two runs": colours.RUNS,
    "phases": colours.PHASES,
    "fitted and held out": (colours.FITTED, colours.HELD_OUT),
    "measured, model and command": (colours.REFERENCE, colours.MONITOR, colours.COMMAND),
    "a frozen run": (colours.GHOST, colours.REFERENCE, colours.MONITOR),
}
# Machado, Oliveira and Fernandes 2009, of linear RGB: no red cones, no green cones.
SEEN = {
    "all cones": np.eye(3),
    "protanopia": np.array([[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]]),
    "deuteranopia": np.array([[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]]),
}
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def linear(colour):
    values = np.array(rgb(colour)) / 255.0
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def lab(colour, seen="all cones"):
    """CIE L*a*b*, as somebody sees it."""
    white = np.array([0.9505, 1.0, 1.089])
    x, y, z = np.cbrt(np.clip(XYZ @ np.clip(SEEN[seen] @ linear(colour), 0.0, 1.0) / white, 1e-4, None))
    return np.array([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])


def apart(one, other, seen="all cones"):
    return float(np.linalg.norm(lab(one, seen) - lab(other, seen)))


def contrast(one, other):
    light, dark = sorted((float(XYZ[1] @ linear(colour)) for colour in (one, other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("other", sorted(OTHERS))
def test_what_has_a_meaning_shares_its_colour_with_nothing(other):
    near = {name: round(apart(other, one)) for name, one in MEANT.items() if apart(other, one) < 20.0}
    assert not near


@pytest.mark.parametrize("phase", colours.PHASES)
def test_a_phase_is_like_nothing_that_has_a_meaning(phase):
    near = {name: round(apart(phase, one)) for name, one in MEANT.items() if apart(phase, one) < 35.0}
    assert not near, "in the windings and beside all else: twenty are too few"


@pytest.mark.parametrize("beside", BESIDE)
@pytest.mark.parametrize("seen", SEEN)
def test_what_stands_beside_each_other_is_told_apart(beside, seen):
    near = {
        pair: round(apart(*pair, seen))
        for pair in itertools.combinations(BESIDE[beside], 2)
        if apart(*pair, seen) < 12.0
    }
    assert not near


@pytest.mark.parametrize("one", sorted(OTHERS | set(MEANT.values())))
def test_it_is_seen_on_light_and_on_dark(one):
    assert contrast(one, "#ffffff") > 2.2 and contrast(one, "#1a1d21") > 2.2
