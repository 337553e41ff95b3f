"""The session's part of Discover without a browser: steps, stops, refusals, what stays."""

from __future__ import annotations

import copy
import time
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.on_page import wait_until
from support.rig import Rig

from ema_model.actuator import load_actuator
from ema_model.discovery.words import tracks
from ema_model.effects.user import user_torque
from ema_model.errors import InputError
from ema_model.faults import HEALTHY
from emaviz.page import discover_candidate
from emaviz.page.discover import STEPS, step
from emaviz.page.discover_result import _SHOWN, as_csv, run_of
from emaviz.recording.read import read
from emaviz.scene.playback import motion
from emaviz.session.discovery_entries import KEPT, WHOLE, Entries
from emaviz.session.discovery_source import agrees, document_of

EASY = "first_bench_run"


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """An app without a screen."""
    rig = Rig(tmp_path_factory.mktemp("data"))
    yield rig
    rig.close()


@pytest.fixture(scope="module")
def discovering(rig):
    """With the easy challenge calibrated, and nothing added."""
    made = rig.discovering
    with pytest.raises(InputError, match="no measurement to fit is chosen"):
        made.start()
    made.source.choose(EASY)
    assert made.start()
    wait_until(lambda: not made.running)
    return made


@pytest.fixture(scope="module")
def calibrated(discovering):
    """What is seen before anything is added."""
    return first(discovering).look


def first(discovering, steps=1):
    """Takes back what an earlier test has added after so many steps."""
    while discovering.look.steps > steps:
        discovering.undo()
        wait_until(lambda: not discovering.running)
    return discovering


@pytest.fixture
def fresh(discovering):
    """The same, without what an earlier test has added."""
    return first(discovering)


@pytest.fixture
def added(discovering, calibrated):
    """With what is hidden added, and nothing else; an earlier test may have done so."""
    if [one.name for one in first(discovering, 2).look.added] != ["cogging_torque"]:
        assert first(discovering).add("cogging_torque")
        wait_until(lambda: not discovering.running)
    return discovering


def test_the_first_card_is_what_is_hidden(calibrated):
    look = calibrated
    best = look.promising[0]
    assert best.name == "cogging_torque" and best.settings["order"] == 14
    text = discover_candidate.label(look, best)
    assert "order 14" in text and "mN·m" in text and f"{100.0 * look.share(best):.0f} %" in text
    amplitude, half = best.settings["amplitude_Nm"], look.uncertainty(best)
    assert abs(amplitude - 0.02) < 2.0 * half < 0.005


def test_a_prediction_is_what_the_refit_gives(calibrated, added):
    best = calibrated.promising[0]
    assert [best.name] == [one.name for one in added.look.added]
    after = added.look.rmse
    assert calibrated.predicted_rmse(best) == pytest.approx(after, rel=0.25)
    assert after < 1.1 < calibrated.rmse
    assert added.look.found.ladder[-1].holdout_rmse < 1.1
    assert not added.look.promising, "nothing else is hidden"
    truth = added.source.reveal()
    assert agrees(truth, added.look.found, added.look.added)
    assert "Your answer agrees" in document_of(truth, added.look.found, added.look.added).text
    assert not agrees(truth, added.look.found, ())


def test_a_signature_is_beside_the_residual_that_it_explains(calibrated):
    look = calibrated
    signal = look.primary
    left = look.residuals.values[signal]
    right, wrong = (look.change(look.candidate(name), signal) for name in ("cogging_torque", "stribeck_friction"))
    assert right.shape == left.shape
    assert np.sum((left - right) ** 2) < 0.8 * np.sum(left**2)
    assert np.sum((left - right) ** 2) < np.sum((left - wrong) ** 2)


def test_a_stopped_step_leaves_the_model_as_it_was(added):
    before = added.look
    told = []
    added.job.ended.connect(told.append)
    assert added.add("stribeck_friction")
    with pytest.raises(InputError, match="a step is running"):
        added.undo()
    added.job.stop()
    wait_until(lambda: told)
    assert told[-1].startswith("Stopped") and not added.running
    assert added.look is before
    assert added.start(), "another step can begin"
    added.job.stop()
    wait_until(lambda: not added.running)


def test_an_effect_is_removed_as_a_step_of_its_own(calibrated, added):
    with pytest.raises(InputError, match="not in the model"):
        added.remove("hinge_moment")
    added.remove("cogging_torque")
    wait_until(lambda: not added.running)
    assert not added.look.added and added.look.steps == 3
    assert 0.95 * calibrated.rmse < added.look.rmse < 1.02 * calibrated.rmse, "as before, or in a deeper minimum"


@pytest.mark.long
def test_an_expression_of_the_user_is_fitted(fresh):
    effect = user_torque("A*sin(14*theta) + B*cos(14*theta)")
    assert fresh.add_own(effect, {"A": 1e-3, "B": 1e-3})
    wait_until(lambda: not fresh.running)
    found = fresh.look.found.calibration.parameters
    a, b = (found[f"effects.{effect.name}.{name}"].value for name in "AB")
    assert np.hypot(a, b) == pytest.approx(0.02, rel=0.15)
    assert fresh.look.rmse < 1.1
    with pytest.raises(InputError, match="in the model already"):
        fresh.add_own(effect, {})


def test_a_recording_is_played_as_measured_and_as_each_model_has_it(added):
    track = tracks(added.look.found)[2]
    runs = [run_of(track, shown) for shown in _SHOWN]
    off = [np.sqrt(np.mean((run["current_A"] - runs[0]["current_A"]) ** 2)) for run in runs[1:]]
    assert 0.0 < off[1] < off[0], "with the effect, the actuator moves more like the measured one"
    for run in runs:
        shown = motion(run, HEALTHY, added.look.found.actuator)
        assert shown.duration_s == pytest.approx(1.0, abs=0.02) and np.ptp(shown.surface_rad) > 0.1
    with pytest.raises(InputError, match="current_A was not fitted"):
        run_of(replace(track, measured={}, models=[{}]), _SHOWN[0])


def previewed(discovering, text, values):
    """What the page is told with an expression's sliders at these values: a preview, or why there is none."""
    told = []
    events = discovering.events
    events.previewed.connect(told.append)
    events.unpreviewed.connect(told.append)
    try:
        discovering.preview_own(user_torque(text), values)
        wait_until(lambda: told)
    finally:
        events.previewed.disconnect(told.append)
        events.unpreviewed.disconnect(told.append)
    return told[0]


@pytest.mark.long
def test_a_torque_shows_what_its_values_would_change_before_it_is_fitted(fresh):
    look, text = fresh.look, "A*sin(14*theta) + B*cos(14*theta)"
    previewed(fresh, text, {"A": 0.0, "B": 0.0})  # compiled
    given = fresh.source.reveal().effects["cogging_torque"]
    size, phase = given["amplitude_Nm"], given["phase_rad"]
    took = []
    errors = {}
    for name, share in (("none", 0.0), ("half", 0.5), ("right", 1.0), ("wrong", -1.0)):
        began = time.perf_counter()
        values = {"A": share * size * np.cos(phase), "B": share * size * np.sin(phase)}
        found = previewed(fresh, text, values)
        took.append(time.perf_counter() - began)
        errors[name] = found.rmse
    assert errors["none"] == pytest.approx(look.rmse, rel=0.03)
    assert errors["right"] < 1.1 and errors["right"] < errors["half"] < errors["none"] < errors["wrong"]
    assert np.median(took) < 0.5, "0.2 s on a machine that does nothing else"
    fresh.add_own(user_torque(text), {"A": size * np.cos(phase), "B": size * np.sin(phase)})
    wait_until(lambda: not fresh.running)
    assert errors["right"] == pytest.approx(fresh.look.rmse, rel=0.1), "a preview is what a refit gives"


WITHOUT_VALUE = [
    "c/(theta - theta)",  # division by zero
    "exp(c*1e6)*1e308",  # overflow
    "sqrt(-1 - c**2)",  # NaN
]


@pytest.mark.long
@pytest.mark.parametrize("text", WITHOUT_VALUE)
def test_a_torque_without_value_fails_as_a_candidate_and_nothing_else(fresh, text):
    before, said = fresh.look, []

    def tell(title, line):
        said.append(line)

    fresh.session.events.told.connect(tell)
    line = previewed(fresh, text, {"c": 0.01})
    assert isinstance(line, str) and "has no value" in line and "\n" not in line
    assert fresh.add_own(user_torque(text), {"c": 0.01})
    wait_until(lambda: not fresh.running)
    fresh.session.events.told.disconnect(tell)
    assert fresh.look.steps == before.steps and fresh.look.rmse == before.rmse
    assert len(said) == 1 and "has no value" in said[0] and len(said[0]) < 200 and "\n" not in said[0]
    assert previewed(fresh, "c*omega", {"c": 0.0}).rmse == pytest.approx(before.rmse, rel=0.03), "the thread lives"


def test_what_is_kept_opens_again(added):
    kept = []
    added.events.kept.connect(kept.append)
    for suffix in (".html", ".rrd", ".toml"):
        added.keep(suffix)
        wait_until(lambda suffix=suffix: any(path.suffix == suffix for path in kept))
    told = []
    added.events.verified.connect(lambda path, text: told.append((path.suffix, text)))
    assert added.take_home()
    wait_until(lambda: not added.running)
    (home,) = (path for path in kept if path.suffix == ".zip")
    with zipfile.ZipFile(home) as archive:
        names = {Path(name).suffix for name in archive.namelist()}
        assert {".c", ".h", ".py", ".toml"} <= names and "cogging_torque_amplitude_Nm" in archive.read(
            "thesis_ema.h"
        ).decode()
        assert "replayed on" in archive.read("LOSS.txt").decode()
    assert next(text for suffix, text in told if suffix == ".zip").startswith("C as the model")
    report, recording, model = (next(p for p in kept if p.suffix == s) for s in (".html", ".rrd", ".toml"))
    assert "Cogging torque" in report.read_text(encoding="utf-8")
    assert read(recording) is not None
    assert load_actuator(model).effects["cogging_torque"]["order"] == 14
    assert added.folder.name_of(model) in added.folder.actuator_files()


@pytest.mark.long
def test_the_next_test_is_between_the_two_best(fresh):
    before = fresh.look.promising[:2]
    assert fresh.suggest()
    wait_until(lambda: not fresh.running)
    found = fresh.experiment
    assert found is not None and set(found.separates) == {one.name for one in before}
    head, *rows = as_csv(found).decode().splitlines()
    assert head == "time_s,command_rad,load_torque_Nm"
    assert len(rows) == round(found.duration_s * 10_000)
    assert fresh.look.found.next_experiment is found


def test_the_guide_follows_the_story(calibrated, added):
    assert step(None, False, None, False)[0] == 1
    assert step(None, True, None, False)[0] == 2
    assert step(calibrated, False, None, False)[0] == 3
    assert step(calibrated, False, "cogging_torque", False)[0] == 4
    assert step(added.look, False, None, False)[0] == 5
    assert step(added.look, False, None, True)[0] == STEPS


def test_of_many_discoveries_the_last_ones_are_whole(discovering):
    """What one has scored takes 150 MB, and its steps some tens: of those long before there is but a line."""
    now, entries = discovering.entries.current, Entries(discovering.source)
    words = []
    for _ in range(KEPT + 2):
        told = copy.copy(now.told)
        entries.begin(told).look = now.look
        words.append(entries.current.words)
    assert [one.told is None for one in entries.all] == [True, True] + KEPT * [False]
    scored = [one.told is not None and one.told.refits is not None for one in entries.all]
    assert scored == (2 + KEPT - WHOLE) * [False] + WHOLE * [now.told.refits is not None]
    assert [one.words for one in entries.all] == words, "they are told as before"
    entries.show(entries.all[3])
    assert entries.all[3].told is not None and entries.all[2].told is not None


def test_a_session_that_is_loaded_where_it_was_saved_shows_it_at_once(rig, added):
    """With a torque of one's own beside what was hidden."""
    assert added.add_own(user_torque("c*omega"), {"c": 1e-5})
    wait_until(lambda: not added.running)
    path, before = rig.save(), added.look
    assert before.steps == 3
    count = len(added.entries.all)
    rig.load(path)
    assert added.look is before and not added.job.waiting
    assert len(added.entries.all) == count


def test_a_plant_of_explore_is_sealed_and_can_be_chosen(rig, discovering):
    for name, value in {"amplitude_Nm": 0.02, "order": 12.0, "phase_rad": 0.5}.items():
        rig.session.settings.set_effect("cogging_torque", name, value)
    sealed = []
    discovering.sealing.sealed.connect(sealed.append)
    with pytest.raises(InputError, match="no story yet"):
        discovering.sealing.seal("Mine", "  ")
    assert discovering.sealing.seal("../Mine & yours", "It hums.")
    wait_until(lambda: sealed)
    assert sealed[0].parent == rig.folder.challenges and sealed[0].suffix == ".challenge"
    (name,) = discovering.source.sealed
    discovering.source.choose(name)
    given = discovering.source.read(discovering.source.recipe())
    assert len(given.fitted) > 0 and len(given.held) > 0
    discovering.source.choose(EASY)


def test_a_step_back_is_at_once_and_shows_the_same_cards(calibrated, added):
    began = time.perf_counter()
    added.undo()
    assert time.perf_counter() - began < 1.0 and not added.running
    assert [one.name for one in added.look.promising] == [one.name for one in calibrated.promising]
    with pytest.raises(InputError, match="no step to take back"):
        added.undo()


def test_recordings_of_compare_can_be_held_out(discovering):
    source = discovering.source
    comparing = discovering.comparing
    paths = source.challenges[EASY].training[:2]
    for path in paths:
        copy = comparing.folder.take_in(path)
        comparing.add(comparing.folder.name_of(copy))
    wait_until(lambda: len(source.compared) == 2)
    source.choose("")
    names = list(source.compared)
    source.hold_out(names[0], True)
    given = source.read(source.recipe())
    assert [one.name for one in given.held] == [source.compared[names[0]].name] and len(given.fitted) == 1
    source.hold_out(names[1], True)
    assert not source.ready
    with pytest.raises(InputError, match="no measurement to fit"):
        source.recipe()
    for name in names:
        source.hold_out(name, False)
        comparing.remove(name)
    source.choose(EASY)
