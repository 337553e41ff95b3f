"""An identification's recording opens on its answer: curves that follow the iterations, a race in one overlay."""

from __future__ import annotations

import numpy as np
import pytest
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from emaviz.recording import RecordingWriter
from emaviz.recording.blueprint import POINTS, Algorithm, Chart, Contents, axes_path, build, fit_path, plot, view

TIME = np.linspace(0.0, 0.5, 5001)
CURRENT = 4.0 * np.sin(40.0 * TIME)
RACE = ("robust", "do")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("runs") / "race.rrd"
    with RecordingWriter(path) as writer:
        writer.fit("current_A", TIME, CURRENT, RACE)
        writer.curve("current_A", "measured", TIME, CURRENT)
        writer.truth(np.full(8, 0.1))
        for name in RACE:
            for i in range(3):
                writer.iteration(name, i, 1.0 / (i + 1.0), np.full(8, 0.1 * i), np.full((4, 8), 0.1))
                writer.fit_iteration(name, i, "current_A", TIME, CURRENT * (0.5 + 0.1 * i))
            writer.interval(name, 3, np.tile([0.0, 0.2], (8, 1)))
            writer.result({"k1": 0.1}, name)
        writer.answer("# Not healthy: friction × 1.20 ± 0.01.")
    assert writer.failed is None
    return path


def test_curves_are_on_the_iterations_and_what_stays_is_static(written):
    timelines, static = {}, set()
    for chunk in RrdReader(written).stream():
        path = str(chunk.entity_path)
        if chunk.is_static:
            static.add(path)
        else:
            timelines.setdefault(path, set()).update(chunk.timeline_names)
    for name in RACE:
        assert timelines[fit_path(name, "current_A", "model")] == {"iteration"}
        assert timelines[f"/identification/{name}/interval/k1"] == {"iteration"}
        assert fit_path(name, "current_A", "measured") in static
    assert {"/answer", "/curves/current_A/measured", f"{axes_path('current_A')}/grid"} <= static
    assert {one for names in timelines.values() for one in names} == {"iteration"}


def test_it_opens_on_one_dashboard_at_the_last_iteration(written):
    (layout,) = RrdReader(written).blueprints()
    texts = " ".join(str(c.to_record_batch().columns) for c in RrdReader(written).stream(store=layout))
    assert "The answer" in texts and "iteration" in texts
    assert "Identification robust" not in texts and "Identification do" not in texts, "a race is one overlay"
    assert "Signals" in texts and "/identification/do/fit/current_A" in texts


def test_a_dashboard_is_as_light_or_dark_as_the_viewer():
    shown = view("current", ["/curves/current_A/**"])
    assert "Background" not in shown.properties and "VisualBounds2D" in shown.properties


WIDE_PX, BESIDE_PX, LETTER_PX = 1000.0, 115.0, 5.9  # of the viewer in the app; a title's icon and buttons; a letter


def _titles(part, wide_px):
    """Every view's title, with the px that its place leaves it."""
    if not isinstance(part, rrb.Container):
        yield str(part.name), wide_px - BESIDE_PX
        return
    for i, one in enumerate(part.contents):
        share = {"Horizontal": part.column_shares, "Grid": [1.0] * (part.grid_columns or 1)}.get(type(part).__name__)
        yield from _titles(one, wide_px * (share[i % len(share)] / sum(share) if share else 1.0))


def test_titles_of_the_dashboard_are_whole_where_the_app_shows_it():
    chart = Chart.of("current_A", TIME, CURRENT)
    algorithms = {name: Algorithm(iterations=True) for name in RACE}
    held = Contents(charts={"current_A": chart}, algorithms=algorithms, answer=True, truth=True)
    titles = list(_titles(build(held).root_container.contents[0], WIDE_PX))
    assert {"The answer", "k3 short circuit A", "k8 proportional gain"} <= {title for title, _ in titles}
    assert [title for title, px in titles if LETTER_PX * len(title) > px] == []


def test_what_was_not_recorded_has_no_view():
    tabs = [
        one.name
        for one in build(Contents(charts={"current_A": Chart("A", 0.0, 1.0, -1.0, 1.0)})).root_container.contents
    ]
    assert tabs == ["Identification"]


def test_no_tab_is_empty_on_the_timeline_that_it_opens_with():
    chart = Chart.of("current_A", TIME, CURRENT)
    held = Contents(signals={"measurement": ["current_A"]}, charts={"current_A": chart})
    assert _tabs(held)[-1].startswith("Over time"), "without static curves they stand nowhere else"
    held.curves["current_A"] = chart
    assert _tabs(held) == ["Identification", "Signals"]


def _tabs(contents):
    return [tab.name for tab in build(contents).root_container.contents]


def test_a_curve_keeps_its_peaks_within_its_axes():
    values = CURRENT.copy()
    values[1234] = 9.0
    chart = Chart.of("current_A", TIME, CURRENT)
    strip = chart.strip(TIME, values)
    assert len(strip) <= POINTS + 2 and strip[0, 0] == 0.0 and strip[:, 0].max() == pytest.approx(2.3)
    assert strip[:, 1].min() == pytest.approx(-0.5), "what is off the axes stands at their edge"
    flat = Chart.of("current_A", TIME, np.zeros_like(TIME))
    assert np.all(np.isfinite(flat.strip(TIME, np.zeros_like(TIME))))


@pytest.mark.parametrize(("falls", "corner"), [(False, rrb.Corner2D.RightBottom), (True, rrb.Corner2D.RightTop)])
def test_a_legend_lies_where_curves_seldom_are(falls, corner):
    legend = plot("current", ["/reference/current_A"], falls=falls).properties["PlotLegend"]
    assert legend.corner.as_arrow_array().to_pylist() == [corner.value]
