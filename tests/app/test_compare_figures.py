"""Figures of a comparison: nothing of a spike is lost, units on every axis, regions marked, errors truthful."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plotly.offline import get_plotlyjs
from support.comparison_by_hand import comparison as by_hand

from ema_model.quantities import MODULATORS, amount, number, variable_title
from emaviz.figures import campaign, theme
from emaviz.figures import comparison as comparison_figures
from emaviz.figures.comparison import time_ranges
from emaviz.figures.theme import band, binned, line, scattered, why_missing

FIGURES = {
    "overlay": comparison_figures.overlay,
    "residual_time": comparison_figures.residual_time,
    "against_speed": lambda c, **k: comparison_figures.residual_against(c, "motor_speed", **k),
    "against_angle": lambda c, **k: comparison_figures.residual_against(c, "motor_angle", **k),
    "against_current": lambda c, **k: comparison_figures.residual_against(c, "current", **k),
    "polar": comparison_figures.residual_polar,
    "orders": comparison_figures.order_spectrum,
    "explained": comparison_figures.explained,
    "calibration": campaign.calibration_scores,
}


@pytest.fixture(scope="module")
def comparison():
    return by_hand(("first", "second"), duration_s=2.0)


@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_has_a_title_units_and_few_points(comparison, name):
    figure = FIGURES[name](comparison)
    assert len(figure.layout.title.text) <= 60
    if name != "polar":
        numeric = [figure.layout.xaxis.title.text] + [figure.layout.yaxis.title.text] * (
            name not in ("explained", "calibration")
        )
        for title in numeric:
            assert "[" in title or title == "Periods in each turn", title
    for trace in figure.data:
        x = trace.x if trace.type != "scatterpolar" else trace.theta
        assert 0 < len(x) <= theme.POINTS
    assert figure.to_json() and FIGURES[name](comparison, dark=True).layout.template.layout.font.color == theme.DARK.ink


@pytest.mark.parametrize("name", ["overlay", "residual_time", "against_speed", "against_angle", "polar", "explained"])
def test_a_highlighted_region_is_marked(comparison, name):
    for region in comparison.worst_regions:
        plain, marked = (FIGURES[name](replace(comparison, worst_regions=()), highlight=h) for h in (None, region))
        if name == "polar" and region.variable != "motor_angle":
            continue
        assert marked.to_json() != plain.to_json()


def test_shaded_times_are_those_of_the_region(comparison):
    speed = next(region for region in comparison.worst_regions if region.variable == "motor_speed")
    for recording in (0, 1):
        figure = comparison_figures.overlay(comparison, recording=recording, highlight=speed)
        time = comparison.recordings[recording].time_s
        shaded = np.zeros(len(time), dtype=bool)
        for shape in figure.layout.shapes:
            shaded |= (time >= shape.x0) & (time <= shape.x1)
        expected = speed.blocks[comparison.residuals.recording == recording]
        assert expected.any() and np.array_equal(shaded, expected)


def test_very_many_stretches_are_shaded_together(comparison):
    figure = theme.new("t", "x", "y")
    ranges = [(float(i), i + 0.2 + 0.3 * (i % 7 == 0)) for i in range(1000)]
    theme.shade(figure, ranges)
    shapes = figure.layout.shapes
    assert 0 < len(shapes) <= 150
    assert all(any(s.x0 <= low and high <= s.x1 for s in shapes) for low, high in ranges)


@settings(max_examples=60, deadline=None)
@given(st.integers(2, 30_000), st.integers(0, 60), st.integers(0, 2**32 - 1))
def test_decimated_lines_keep_every_extreme(count, holes, seed):
    random = np.random.default_rng(seed)
    x = np.arange(count) * 1e-3 + 50.0 * np.cumsum(random.random(count) < 20 / count)
    y = random.standard_normal(count)
    y[random.integers(count)], y[random.integers(count)] = 90.0, -70.0
    y[random.integers(0, count, holes)] = np.nan
    drawn_x, drawn = line(x, y, 4000)
    assert len(drawn_x) == len(drawn) <= 4000
    known = np.isfinite(y)
    if known.any():
        assert np.nanmax(drawn) == np.float32(y[known].max()) and np.nanmin(drawn) == np.float32(y[known].min())
    assert np.isfinite(drawn_x[np.isfinite(drawn)]).all()
    kept = scattered(x, y, 2000)
    assert len(kept) <= 2000 or len(kept) == known.sum()
    if known.any():
        assert y[kept].max() == y[known].max() and y[kept].min() == y[known].min()
    edge_x, edge = band(x, y - 1.0, y + 1.0, 4000)
    assert len(edge_x) == len(edge) <= 4000
    if known.any():
        assert np.nanmax(edge) == np.float32(y[known].max() + 1.0)


def test_lines_are_broken_where_nothing_is_known():
    x = np.array([0.0, 1.0, 2.0, 3.0, 60.0, 61.0, 10.0, 11.0])
    drawn_x, drawn = line(x, np.arange(8.0), 4000)
    assert np.flatnonzero(np.isnan(drawn)).tolist() == [4, 7]  # after a leap, and where time goes back
    assert drawn_x[~np.isnan(drawn)].tolist() == x.tolist()


def test_a_spike_of_one_block_reaches_the_figure(comparison):
    one = comparison.recordings[0]
    measured = one.measured["current_A"].copy()
    measured[1234] += 77.0
    spiked = replace(one, measured={**one.measured, "current_A": measured})
    figure = comparison_figures.residual_time(replace(comparison, recordings=[spiked]), "current_A")
    (residual,) = (trace for trace in figure.data if trace.name == "residual")
    assert np.nanmax(residual.y) == pytest.approx(measured[1234] - one.model["current_A"][1234], rel=1e-6)


def test_current_is_told_as_torque(comparison):
    amperes = comparison_figures.residual_against(comparison, "motor_speed", as_torque=False)
    torques = comparison_figures.residual_against(comparison, "motor_speed")
    (a,), (t,) = ([d for d in f.data if d.name == "mean ± error"] for f in (amperes, torques))
    factor = {"A": 1.0, "mA": 1e3}[amperes.layout.yaxis.title.text.split("[")[1].rstrip("]")]
    assert torques.layout.yaxis.title.text == "Residual torque [mN·m]"
    assert t.y / 1e3 == pytest.approx(a.y / factor * comparison.residuals.torque_constant)
    orders = comparison_figures.order_spectrum(comparison).data[0]
    strongest = comparison.orders[0]
    height = 1e3 * comparison.residuals.torque_constant * strongest.amplitude
    assert strongest.order == 12 and orders.y[list(orders.x).index(12)] == pytest.approx(height)


def test_a_mean_for_each_direction_where_direction_explains(comparison):
    names = [trace.name for trace in comparison_figures.residual_against(comparison, "current").data]
    assert {"mean, forward", "mean, backward"} <= set(names)
    names = [trace.name for trace in comparison_figures.residual_against(comparison, "motor_speed").data]
    assert "mean ± error" in names


def test_what_noise_could_have_made_is_pale(comparison):
    for trace in comparison_figures.explained(comparison).data:
        for name, opacity in zip(trace.y, trace.marker.opacity):
            modulator = next(m for m, one in MODULATORS.items() if one.title == trace.name)
            (found,) = (
                e for e in comparison.explained_by if variable_title(e.variable) == name and e.modulator == modulator
            )
            assert (opacity == 1.0) == found.significant


def test_what_is_not_there_is_said(comparison):
    bare = replace(comparison, orders=(), explained_by=(), calibration=None)
    texts = [
        comparison_figures.residual_against(bare, "temperature").layout.annotations[0].text,
        comparison_figures.overlay(bare, "motor_torque_Nm").layout.annotations[0].text,
        *(
            f(bare).layout.annotations[0].text
            for f in (comparison_figures.order_spectrum, comparison_figures.explained, campaign.calibration_scores)
        ),
    ]
    assert all(texts)


@pytest.mark.parametrize("correlated", [1, 50])
def test_errors_of_binned_means_are_truthful(correlated):
    scores = []
    for seed in range(40):
        random = np.random.default_rng(seed)
        time = np.arange(4000) * 5e-4
        # noise that stays the same for so many blocks; its mean is zero in every bin
        noise = np.repeat(random.standard_normal(4000 // correlated), correlated)
        x = np.sin(2 * np.pi * 15.3 * time)
        found = binned(x, noise, np.ones(4000), np.linspace(-1, 1, 9))
        scores.append(found.mean / found.error)
    assert 0.7 < np.std(scores) < 1.5


@pytest.mark.parametrize(
    ("low", "high", "parts"),
    [
        (40, 70, [(40, 70)]),
        (350, 370, [(350, 360), (0, 10)]),
        (350, 10, [(350, 360), (0, 10)]),
        (-10, 5, [(350, 360), (0, 5)]),
    ],
)
def test_ranges_over_the_end_of_a_turn(low, high, parts):
    assert comparison_figures.turn_ranges(low, high) == parts


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0352, "0.0352"), (1.3e-5, "1.30·10⁻⁵"), (-12.34, "−12.3"), (1234.0, "1234"), (np.nan, "–"), (0, "0.00")],
)
def test_numbers_are_short(value, text):
    assert number(value) == text


def test_units_suit_the_size():
    torque = comparison_figures.Quantity("Torque", "N·m")
    assert torque.scaled([0.035, -0.01]).text(0.035) == "35.0 mN·m"
    assert torque.scaled([2.0]).unit == "N·m" and torque.scaled([3e-6]).unit == "µN·m"
    assert comparison_figures.Quantity("Temperature", "°C").scaled([0.01]).unit == "°C"
    inertia, stiffness = (
        comparison_figures.Quantity("Inertia", "kg·m²"),
        comparison_figures.Quantity("Stiffness", "N·m/rad"),
    )
    assert inertia.powered([1.38e-5, 1.2e-5]).text(1.38e-5) == "13.8 10⁻⁶ kg·m²"
    assert stiffness.powered([100_750.0]).label == "Stiffness [kN·m/rad]"
    assert torque.powered([0.035]).unit == "mN·m" and torque.powered([0.0]).unit == "N·m"
    assert amount(1.3e-5, "kg·m²") == "13.0·10⁻⁶ kg·m²", "the power that an interval beside it has"
    assert amount(0.035, "N·m") == "35.0 mN·m"


def test_regions_in_time_end_with_their_run(comparison):
    everything = replace(comparison.worst_regions[0], blocks=np.ones(comparison.residuals.blocks, dtype=bool))
    assert len(time_ranges(comparison, everything, 0)) == 1


@pytest.mark.long
@pytest.mark.browser
def test_a_figure_with_its_legend_fits_a_panel_that_is_narrow_for_a_moment(browser):
    """Plotly fails where margins leave nothing, and takes the whole page with it."""
    figure = theme.new("Equivalent current", "Time [s]", "I [A]")
    for name in ("floor ±2σ", "uncalibrated", "measured", "calibrated"):
        figure.add_scatter(x=[0.0, 1.0], y=[0.0, 1.0], name=name)
    page = browser.new_page()
    page.set_content("<div id=a></div>")
    page.add_script_tag(content=get_plotlyjs())
    draw = "([f, w, h]) => { const g = JSON.parse(f); Plotly.react('a', g.data, {...g.layout, width: w, height: h}); }"
    for width, aspect in ((261, 0.42), (261, 0.3), (500, 0.42)):
        page.evaluate(draw, [figure.to_json(), width, aspect * width])
    page.close()


def test_a_figure_with_nothing_in_it_is_a_line_in_words(comparison):
    bare = replace(comparison, orders=(), explained_by=())
    assert why_missing(comparison_figures.order_spectrum(bare)).endswith(
        "orders of the motor's turn: nothing repeats with the motor's turn."
    )
    assert (
        why_missing(comparison_figures.order_spectrum(comparison))
        == why_missing(comparison_figures.overlay(comparison))
        == ""
    )
