"""Identify: races of optimisers, pause, the swarm, the table; without a browser and in a real one."""

from __future__ import annotations

import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
from support.on_page import wait_until

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.errors import InputError
from ema_model.faults import performance_coefficient, vector
from ema_model.identification.run import ALGORITHMS, Progress, facts, way_sentences, why_best
from ema_model.identification.search import slices, ways
from ema_model.quantities import amount
from ema_model.recordings import write_measurement
from ema_model.recordings.measurement import Sensors
from ema_model.recordings.read import read_measurement
from ema_model.simulation.run import Run, simulate_reference
from emaviz.figures import identification
from emaviz.figures.identification import Row, table
from emaviz.page.identify import at_iteration, telling
from emaviz.recording.read import read
from emaviz.session.explore import Session
from emaviz.session.identify import MOST_FRAMES, Track, ends
from emaviz.session.settings import Settings

CHART = """(title) => {
  const charts = Object.values(window.__viserTestpoints.uplots).map(u => u.chart);
  const chart = charts.find(c => c.root.querySelector('.u-title')?.textContent.startsWith(title));
  return chart ? Array.from(chart.data, a => Array.from(a)) : null;
}"""


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    session = Session(load_actuator(), tmp_path_factory.mktemp("recordings"))
    session.start()
    assert session.ready.wait(120.0)
    yield session
    session.close()


def raced(session, algorithms, seconds=120.0):
    session.settings.set("algorithms", algorithms)
    done, races = threading.Event(), []

    def keep(race):
        races.append(race)
        done.set()

    session.identifying.identified.connect(keep)
    try:
        assert session.identify()
        assert done.wait(seconds)
    finally:
        session.identifying.identified.disconnect(keep)
    wait_until(lambda: not session.identifying.job.running)
    return races[0]


# --- without a browser ------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_race_gives_each_optimiser_the_answer_that_it_finds_alone(session):
    session.settings.restore(Settings().saved())
    session.settings.set_fault(0, 0.3)
    session.settings.set("iterations", 40)
    race = raced(session, ["hba", "do"])
    assert list(race.tracks) == ["do", "hba"] and len(race.answers) == 2
    for name in ("do", "hba"):
        alone = raced(session, [name]).answers[0]
        together = race.tracks[name].answer
        assert np.array_equal(alone.k, together.k) and alone.evaluations == together.evaluations
        assert len(race.tracks[name].rmse) == 41
        assert np.array_equal(race.tracks[name].rmse, together.rmse_history)
    errors = [answer.error_percent for answer in race.answers]
    times = [answer.elapsed_s for answer in race.answers]
    assert list(race.performance().values()) == pytest.approx(performance_coefficient(errors, times))


def test_the_starred_answer_has_the_least_error_wherever_one_is_shown(session):
    """Where the simplified model's own error hides the difference, which a search without a fit follows."""
    session.settings.restore(Settings().saved())
    session.settings.set_fault(2, 0.2)
    session.settings.set("iterations", 60)
    race = raced(session, ["robust", "do"])
    best, (other,) = race.best, [one for one in race.tracks.values() if one is not race.best]
    assert best.algorithm == "robust" and best.answer.rmse > other.answer.rmse, "uncorrected it would be the worse one"
    assert best.answer.error_percent < other.answer.error_percent

    def ordered(errors):
        assert errors["robust"] < errors["do"]

    found = {track.algorithm: track.answer.corrected_rmse for track in race.tracks.values()}
    ordered(found)
    ordered({name: race.errors_of(track)[-1] for name, track in race.tracks.items()})
    assert all(len(track.answer.corrected_history) == len(track.rmse) for track in race.tracks.values())
    assert race.error(best.answer.k)[0] == pytest.approx(found["robust"])
    assert race.error(other.answer.k)[0] == pytest.approx(found["do"])

    told = ways(race.error, ends(race), best.answer.k)
    assert told["robust"].answer_A == pytest.approx(found["robust"])
    assert told["do"].error_A == pytest.approx(found["do"])
    assert "has the answer" in way_sentences(told, "robust")[0], "the answer has converged"
    through = next(slices(race.error, best.answer.k, 2, 5, (best.answer.k[2], 1.0), (best.answer.k[5], 1.0), points=5))
    assert through.error_A[0, 0] == pytest.approx(found["robust"]), "the map has the answer's own error"

    for name, answer in ((track.algorithm, track.answer) for track in race.tracks.values()):
        assert f"corrected error {amount(found[name], 'A')}" in facts(answer) and "rmse" not in " ".join(facts(answer))
    assert "least corrected error" in why_best(best.answer, [other.answer])
    kept = read(race.path)
    ordered({name: one["corrected_rmse_A"] for name, one in kept.properties["found"].items()})
    ordered({name: trace.corrected[-1] for name, trace in kept.identification.items()})
    assert kept.properties["best"] == "robust"
    for name, text in ((name, trace.result) for name, trace in kept.identification.items()):
        assert amount(found[name], "A") in text and "rmse" not in text


def test_the_overlay_is_the_answers_own_current(session):
    session.settings.set("iterations", 30)
    race = raced(session, ["do"])
    track = race.tracks["do"]
    assert track.current_A.shape == race.measured_A.shape == race.time_s.shape
    left = np.sqrt(np.mean((track.current_A - race.measured_A) ** 2))
    assert left == pytest.approx(track.answer.rmse, rel=1e-6)
    assert race.time_s[-1] == pytest.approx(session.settings.duration_s, abs=1e-3)


def test_a_pause_stops_the_search_while_sliders_are_answered(session):
    session.settings.set("iterations", 400)
    session.settings.set("algorithms", ["hba"])
    races, drawn = [], []
    session.identifying.progressed.connect(races.append)
    session.events.simulated.connect(drawn.append)
    try:
        assert session.identify()
        wait_until(lambda: races)
        session.identifying.job.pause(True)
        time.sleep(0.4)
        at, seen = len(races), len(drawn)
        session.refresh()
        wait_until(lambda: len(drawn) > seen)
        assert len(races) == at and session.worker.busy and session.identifying.job.paused
        session.identifying.job.pause(False)
        wait_until(lambda: len(races) > at)
        session.identifying.job.pause(True)
        session.identifying.job.stop()  # also ends one that rests
        wait_until(lambda: not session.identifying.job.running)
        assert races[0].answers[0].stopped
    finally:
        session.identifying.progressed.disconnect(races.append)
        session.events.simulated.disconnect(drawn.append)


@pytest.mark.long
def test_a_file_is_identified_without_a_truth(session, tmp_path):
    plant = simulate_reference(Run(command("chirp", {}), 0.5, 10_000.0), load_actuator(), vector({"k1": 0.4}))
    path = tmp_path / "bench.csv"
    write_measurement(Sensors(0.05, 0).record(plant, 1), path)
    session.open_file = lambda name: read_measurement(tmp_path / name)
    session.settings.restore(Settings().saved())
    session.settings.set("source", "bench.csv")
    monitor = session.settings.monitor
    race = raced(session, ["robust"])
    answer = race.best.answer
    assert race.truth is None and answer.error_percent is None and race.source == "bench.csv"
    assert answer.k[0] == pytest.approx(0.4, abs=0.05)
    assert session.settings.monitor == monitor, "a file's faults are not those of the sliders' plant"
    session.settings.set("source", "")


def test_what_cannot_be_chosen_is_refused():
    settings = Settings()
    for value in ([], ["none"], "hba", None, [7]):
        with pytest.raises(InputError):
            settings.set("algorithms", value)
    assert settings.algorithms == Settings().algorithms
    settings.set("algorithms", list(ALGORITHMS)[::-1])
    assert settings.algorithms == tuple(ALGORITHMS)


def progress(iteration, n=5):
    rng = np.random.default_rng(iteration)
    return Progress("do", iteration, 10_000, 1.0, rng.random(8), rng.random((n, 8)), np.ones(n), 1, 0.0)


def test_a_long_search_keeps_few_frames_from_its_first_to_its_last():
    track = Track("do", 10_000)
    for iteration in range(5001):
        track.add(progress(iteration))
    kept = [frame.iteration for frame in track.frames]
    assert len(kept) <= MOST_FRAMES and kept[0] == 0 and kept[-1] > 4900
    assert len(set(np.diff(kept))) == 1
    assert at_iteration(track, 1000).iteration <= 1000 < at_iteration(track, 1000).iteration + track.stride
    assert at_iteration(track, 5000).iteration == 5000 and at_iteration(Track("do", 5), 3) is None


def test_the_errors_that_are_drawn_end_at_the_one_that_the_answer_says():
    track = Track("robust", 5)
    track.add(progress(0))
    assert track.rmse == [1.0] and track.corrected == []
    track.answer = SimpleNamespace(polished=True, corrected_rmse=0.5, corrected_history=np.array([0.9]))
    assert track.corrected == [0.9, 0.5] and track.rmse == [1.0]
    track.answer = SimpleNamespace(polished=False, corrected_rmse=0.9, corrected_history=np.array([0.9]))
    assert track.corrected == [0.9], "what the search ended with is there"


def test_the_axes_are_those_on_which_the_faults_stand():
    assert set(telling(vector({"k3": 0.4, "k8": 0.9}))) == {2, 7}
    assert telling(vector({"k2": 0.4}))[0] == 1 and telling(vector({"k6": 0.4}))[0] == 5
    assert telling(vector({"k7": 0.9})) != (6, 5), "a phase of no eccentricity is nothing to look at"


def test_a_swarm_is_drawn_where_it_is():
    one = identification.Swarm("do", "#1098ad", np.array([[0.0] * 8, [1.0] * 8]), np.full(8, 0.5))
    plane = identification.plane([one], 0, 1, np.full(8, 0.25), [np.array([[0.0] * 8, [0.5] * 8])])
    assert "M44.0 536.0h0M446.0 10.0h0" in plane and 'cx="245.0" cy="273.0"' in plane and "<polyline" in plane
    lines = identification.lines([one], np.full(8, 0.25))
    assert lines.count("<path") == 8 + 3 and "M44 528.0" in lines


def test_the_table_escapes_names_and_shows_what_is_unknown():
    row = Row(1, "<b>x</b>.csv", "hba", 50, 150, "filtered", 0, None, 0.5, 7500, 2.0, None, True)
    shown = table([row])
    assert "<b>x</b>" not in shown and "&lt;b&gt;x" in shown and "(stopped)" in shown and "–" in shown
    assert "Nothing" in table([])


# --- in the browser ---------------------------------------------------------------------------------------------------

pictures = """() => Array.from(document.querySelectorAll('svg'))
  .filter(s => s.textContent.includes('friction') || s.textContent.includes('k1')).map(s => s.outerHTML)"""


@pytest.mark.long
@pytest.mark.browser
def test_a_race_is_watched_paused_and_looked_back_at(page, app):
    settings = app.session.settings
    settings.set_fault(0, 0.25)
    settings.set_fault(5, 0.3)
    page.get_by_role("tab", name="Identify").click()
    page.get_by_role("tab", name="Landscape").click()
    page.get_by_text("No landscape yet").wait_for()  # and how to get there, in place of controls that do nothing
    assert not page.get_by_role("button", name="Draw the landscape").count()
    page.get_by_role("tab", name="Search").click()
    page.get_by_label("Robust", exact=True).click()
    page.get_by_text("no algorithm is chosen").wait_for(timeout=10_000)
    assert settings.algorithms == ("robust",)
    page.get_by_label("Dandelion", exact=True).click()
    page.get_by_label("Honey Badger", exact=True).click()
    wait_until(lambda: settings.algorithms == ("robust", "do", "hba"))
    for label, name, value in (("Population", "population", 30), ("Iterations", "iterations", 60), ("Seed", "seed", 3)):
        page.get_by_label(label, exact=True).fill(str(value))
        page.get_by_label(label, exact=True).press("Enter")
        wait_until(lambda: getattr(settings, name) == value)  # noqa: B023
    page.get_by_role("button", name="Identify", exact=True).click()
    page.get_by_text("of 60").first.wait_for(timeout=60_000)
    page.get_by_role("button", name="Pause the search").click()
    wait_until(lambda: app.session.identifying.job.paused)
    page.wait_for_timeout(600)
    before = page.evaluate(CHART, "Convergence")
    page.wait_for_timeout(600)
    assert page.evaluate(CHART, "Convergence") == before, "it rests"
    page.get_by_role("button", name="Resume the search").click()
    page.get_by_role("link", name="in Rerun").wait_for(timeout=180_000)
    wait_until(lambda: np.array(page.evaluate(CHART, "Convergence")).shape == (4, 61))
    curves = np.array(page.evaluate(CHART, "Convergence"))
    # Searches rank by another error than the corrected one, which may rise on the way.
    best = app.session.identifying.answer
    assert np.all(curves[1:] > 0.0) and np.min(curves[1:, -1]) == pytest.approx(best.corrected_rmse)
    assert np.all(curves[1:, -1] <= 1.001 * curves[1:, 0])

    page.locator("[role=tab][aria-selected=true]", has_text="Answer").wait_for(timeout=30_000)
    page.get_by_role("tab", name="Search", exact=True).click()
    last = page.evaluate(pictures)
    box = page.locator('label:text-is("Iteration")')
    box = box.locator("xpath=ancestor::div[contains(@class,'mantine-Flex-root')][1]").locator(
        "input:not([type=hidden])"
    )
    box.first.fill("0")
    box.first.press("Enter")
    wait_until(lambda: page.evaluate(pictures) != last)
    page.get_by_label("Population view", exact=True).click()
    page.get_by_role("option", name="lines across all k").click()
    page.get_by_text("backlash", exact=True).first.wait_for()

    page.get_by_role("tab", name="Answer").click()
    wait_until(lambda: np.array(page.evaluate(CHART, "Monitor − measured")).shape[0] == 4)
    left = np.array(page.evaluate(CHART, "Monitor − measured"))[1:]
    assert np.all(np.isfinite(left)) and np.abs(left).max() < 5.0
    page.get_by_role("tab", name="History").click()
    page.get_by_text("population 30, 60 iterations, filtered, seed 3").wait_for()
    page.get_by_role("button", name="Clear the table").click()
    page.get_by_text("Nothing has been identified yet").wait_for()


@pytest.mark.browser
def test_the_answer_is_said_once_and_comes_forward(shared_page, app):
    page, settings = shared_page, app.session.settings
    settings.restore({**Settings().saved(), "k": list(vector({"k2": 0.7}))})
    page.get_by_role("tab", name="Identify", exact=True).click()
    page.get_by_role("tab", name="Search", exact=True).wait_for()
    page.get_by_role("button", name="Identify", exact=True).click()
    page.get_by_text("Not healthy: backlash 70").wait_for(timeout=120_000)
    page.locator("[role=tab][aria-selected=true]", has_text="Answer").wait_for(timeout=20_000)
    left = page.locator("[data-dock-region=left]").inner_text()
    assert left.count("ot healthy") == 1 and left.count("simulations in") == 1 and "done in" not in left, left
    row = page.locator("tr[title*='90 % interval 0.']", has_text="k2 Backlash")
    row.wait_for(timeout=20_000)  # the interval comes after the value
    assert "healthy 0" in row.get_attribute("title")
    assert "µrad" in row.inner_text() and "·10" not in row.inner_text()
    assert "–" in page.locator("tr", has_text="k7 Eccentricity phase").inner_text()
    assert [one.fault for one in app.playback.reels["identify"].motion.callouts] == ["k2"], (
        "an eccentricity that is not seen has no direction"
    )
    settings.restore(Settings().saved())


@pytest.mark.long
@pytest.mark.browser
def test_the_answers_of_a_race_are_seen_above_the_actuator(shared_page, app):
    page, settings = shared_page, app.session.settings
    settings.restore({**Settings().saved(), "algorithms": list(ALGORITHMS), "population": 20, "iterations": 5})
    page.get_by_role("tab", name="Identify", exact=True).click()
    page.get_by_role("button", name="Identify", exact=True).click()
    page.get_by_text("why it is the best").wait_for(timeout=120_000)
    page.get_by_role("link", name="in Rerun").wait_for()
    left = page.locator("[data-dock-region=left]")
    ends = left.bounding_box()["y"] + left.bounding_box()["height"]  # where the actuator begins
    for title in ALGORITHMS.values():
        one = left.locator("b", has_text=title).bounding_box()
        assert one["y"] + one["height"] < ends, title
    to_rerun = left.get_by_role("link", name="in Rerun")
    link = to_rerun.bounding_box()
    assert link["y"] + link["height"] < ends, "nothing of the answer is to be scrolled to"
    for dark, theme in ((True, "dark"), (False, "light")):
        app.strip._dark.value = dark
        page.wait_for_function(f"document.documentElement.dataset.mantineColorScheme === '{theme}'")
        to_rerun.dispatch_event("pointerdown")
        assert f"&theme={theme}" in to_rerun.get_attribute("href"), "not as the system is, but as the page is"
    settings.restore(Settings().saved())
