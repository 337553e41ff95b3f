"""A discovery that comes back: sealed in Explore and solved, and as it was from a session's file."""

from __future__ import annotations

import copy
import shutil

import numpy as np
import pytest
from support.on_page import wait_until
from support.rig import Rig
from support.unknown_drive import drive_of, logged

from ema_model.actuator import load_actuator
from ema_model.discovery import begun
from ema_model.discovery.result import Experiment
from ema_model.effects.user import user_torque
from ema_model.errors import InputError
from emaviz.page import discover_candidate
from emaviz.page.discover_result import answer
from emaviz.session import session_file
from emaviz.session.data_folder import DataFolder
from emaviz.session.discovery_entries import StoredStory, Telling
from emaviz.session.discovery_source import Recipe, agrees, document_of, sensors_of, truth_of
from emaviz.session.session_file import Part
from emaviz.session.settings import Settings

EASY = "first_bench_run"
HIDDEN = {"amplitude_Nm": 0.02, "order": 12.0, "phase_rad": 0.5}


@pytest.fixture(scope="module")
def rigs(tmp_path_factory):
    """One where something is discovered, and one to which it is taken."""
    made = [Rig(tmp_path_factory.mktemp(name)) for name in ("here", "there")]
    yield made
    for one in made:
        one.close()


@pytest.fixture(scope="module")
def solved(rigs):
    """A plant with cogging, sealed by the first rig, with what is found in it: cogging, and a torque of one's own."""
    here = rigs[0]
    settings = here.session.settings
    for name, value in HIDDEN.items():
        settings.set_effect("cogging_torque", name, value)
    settings.set_fault(0, 0.0)
    sealed = []
    here.discovering.sealing.sealed.connect(sealed.append)
    with pytest.raises(InputError, match="no story yet"):
        here.discovering.sealing.seal("Mine", "  ")
    assert here.discovering.sealing.seal("../Mine & yours", "It hums.")
    wait_until(lambda: sealed)
    assert sealed[0].parent == here.folder.challenges and sealed[0].suffix == ".challenge"
    (name,) = here.discovering.source.sealed
    here.discovering.choose(name)
    assert here.discovering.start()
    here.done()
    assert here.discovering.look.promising[0].name == "cogging_torque"
    here.discovering.add("cogging_torque")
    here.done()
    here.discovering.add_own(user_torque("c*omega"), {"c": 1e-5})
    here.done()
    return here


def ladder(rig):
    return [(one.change, one.rmse, one.holdout_rmse) for one in rig.discovering.look.found.ladder]


@pytest.mark.long
def test_what_was_sealed_in_explore_is_found_and_revealed(solved):
    found, added = solved.discovering.look.found, solved.discovering.look.added
    truth = solved.discovering.source.reveal()
    assert truth.effects == {"cogging_torque": HIDDEN} and not truth.faults
    assert "cogging torque of order 12" in truth.answer
    assert agrees(truth, found, added[:1])
    assert "Your answer agrees" in document_of(truth, found, added[:1]).text
    assert found.ladder[1].rmse < 1.1 < found.ladder[0].rmse
    amplitude = added[0].parameters["amplitude_Nm"].value
    assert amplitude == pytest.approx(0.02, rel=0.1)


EXPERIMENT = Experiment("sine", {"frequency_Hz": 2.0}, 1.0, 5.0, None, ("cogging_torque", "torque_ripple"), 80.0)


def drawn(discovering):
    """All that the page draws of a discovery: texts, figures and marks."""
    look = discovering.look
    best = look.promising[0] if look.promising else None
    return [
        look.found.to_dict(),
        look.found.document.text,
        answer(look),
        [figure.to_json() for figure in look.found.figures()],
        look.removable,
        [(one.name, look.predicted_rmse(one), look.uncertainty(one), look.probability(one)) for one in look.promising],
        None if best is None else discover_candidate.fall(look, best) + discover_candidate.chance(look, best),
        [one.to_dict() if hasattr(one, "to_dict") else repr(one.sentence) for one in look.explained_before],
        None if look.assessment is None else sorted(look.assessment.alike.items()),
        discovering.experiment,
        discovering.source.revealed,
        [one.words for one in discovering.entries.all],
    ]


@pytest.mark.long
def test_a_session_shows_a_discovery_as_it_was_and_computes_nothing(rigs, solved, computed):
    there = rigs[1]
    solved.discovering._shown.told.experiment = EXPERIMENT
    solved.discovering.source.reveal()
    path = solved.save()
    before = drawn(solved.discovering)
    computed.clear()
    begun = []
    there.discovering.job.began.connect(begun.append)
    there.load(path)
    after = drawn(there.discovering)
    assert not computed and not begun and not there.told and not there.discovering.running
    assert after == before
    assert (there.folder.folder / there.discovering.source.chosen).is_file(), "the sealed file came with it"
    assert there.discovering.provenance.line() == ""
    there.load(path)
    assert len(there.discovering.entries.all) == len(solved.discovering.entries.all), "it is here already"
    steps = there.discovering._shown.told.story.steps
    for at in range(len(steps) - 1, 0, -1):
        for one in (solved, there):
            one.discovering.undo()
            assert not one.discovering.running and one.discovering.look.steps == at
        assert drawn(there.discovering) == drawn(solved.discovering)
    assert not computed, "each step was stored"


@pytest.mark.long
def test_a_discovery_goes_on_from_where_a_session_left_it(rigs, solved):
    here, there = rigs
    assert here.discovering.look.steps == there.discovering.look.steps == 1
    for one in rigs:
        assert one.discovering.add("cogging_torque")
        one.done()
    # the fit of the candidate is known here, and made anew there: alike, but for where a fit ends
    for (change, rmse, held), (its, same, same_held) in zip(ladder(here), ladder(there), strict=True):
        assert its == change and same == pytest.approx(rmse, rel=0.01) and same_held == pytest.approx(held, rel=0.01)
    for one in rigs:
        assert one.discovering.remove("cogging_torque")
        one.done()
    assert ladder(there)[-1][0] == ladder(here)[-1][0] and ladder(there)[-1][0].kind == "removed"
    assert there.discovering.look.promising[0].name == here.discovering.look.promising[0].name
    assert not there.told


@pytest.mark.long
def test_recordings_of_compare_are_shown_again_with_what_was_asked(rigs, tmp_path):
    here, there = rigs
    files = here.discovering.source.challenges[EASY]
    for path in (*files.training[:1], *files.holdout):
        shutil.copy(path, here.folder.uploads / path.name)
        here.comparing.add(f"uploads/{path.name}")
    wait_until(lambda: len(here.discovering.source.compared) == 2)
    here.discovering.choose("")
    here.discovering.source.hold_out("uploads/unseen.parquet", True)
    here.comparing.set_window(0.0, 0.3)
    here.comparing.set_free("motor.inertia_kgm2", False)
    assert here.discovering.start()
    here.done()
    here.discovering.add("cogging_torque")
    here.done()
    path = here.save()
    (there.folder.uploads / "chirp.parquet").write_bytes(b"another file of this name")
    there.load(path)
    assert there.discovering.look.found.to_dict() == here.discovering.look.found.to_dict() and not there.told
    look = there.discovering.look
    assert look.reach == ("chirp",) and look.held == ("unseen",)
    assert "motor.inertia_kgm2" not in look.found.calibration.parameters
    assert max(window.time_s[-1] for window in look.found.plant.windows) < 0.31
    line = there.discovering.provenance.line()
    assert line.startswith("Out of date: chirp-2.parquet and unseen.parquet were removed") and line.endswith("Start.")
    assert "\n" not in line, "what it is of is not chosen here"
    there.comparing.add("uploads/chirp-2.parquet")
    there.comparing.add("uploads/unseen.parquet")
    wait_until(lambda: len(there.discovering.source.compared) == 2)
    there.comparing.take_held_out(["uploads/unseen.parquet"])
    there.comparing.set_window(0.0, 0.3)
    there.comparing.set_free("motor.inertia_kgm2", False)
    assert there.discovering.provenance.line() == "", "the same files, by what is in them, and the same asked of them"
    assert not [one for one in there.discovering.entries.all if one.look is None], "the others came whole, too"
    now, other = there.discovering.entries.current, there.discovering.entries.all[0]
    there.discovering.show(other)
    assert other is not now and there.discovering.look is other.look and not there.discovering.running
    there.discovering.show(now)
    here.comparing.window_s = None


@pytest.mark.long
def test_damaged_parts_are_told_in_one_line_and_change_nothing(rigs, solved):
    there = rigs[1]
    good = {**solved.discovering.saved(), "others": [], "number": 90}
    names = {name: name for name in solved.discovering.files()}
    before = there.discovering.look
    damages = [
        7,
        {},
        {**good, "recipe": 7},
        {**good, "recipe": {"challenge": "../../etc/passwd"}},
        {**good, "recipe": {"challenge": "no_such"}},
        {**good, "recipe": {"challenge": "", "fitted": 7, "held": []}},
        {**good, "says": "x" * 999},
        {**good, "number": -1},
        {**good, "at": "evil"},
        {**good, "others": 7},
    ]
    for saved in damages:
        with pytest.raises(InputError) as told:
            there.discovering.restore(saved, names)
        assert "\n" not in str(told.value)
    assert there.discovering.look is before and not there.discovering.running


@pytest.mark.long
@pytest.mark.parametrize("kind", ["unknown", "open"])
def test_a_story_without_a_controller_is_stored_as_well(folder_of, tmp_path, kind):
    """By inverse dynamics, and in an open loop, whose windows and models are others."""
    actuator = drive_of(tmp_path, kind == "unknown", kind)
    recordings = [
        logged(seed, hidden=lambda angle, _: 0.01 * np.sin(7.0 * angle), name=f"{seed}") for seed in (1, 2, 3)
    ]
    story = begun(recordings[:2], actuator, recordings[2:], None, lambda _: None)
    told = Telling(story, Recipe())
    told.assess()
    told.add(told.trials.of(story, told.look().promising[0], lambda _: None), (), lambda _: None)
    told.assess()
    look, back = told.look(), []
    path = session_file.free_path(folder_of, kind)
    session_file.write_session(path, {"d": Part(lambda: told.stored(look), lambda *_: None)}, folder_of, [])
    session_file.read_session(path, {"d": Part(dict, lambda given, _: back.append(given))}, folder_of)
    found = StoredStory.of(back[0])
    again = found.told(Recipe()).look()  # made anew of its steps
    for one in (found.look, again):
        assert one.found.to_dict() == look.found.to_dict() and str(one.found) == str(look.found)
        assert [str(figure.to_json()) for figure in one.found.figures()] == [
            str(figure.to_json()) for figure in look.found.figures()
        ]
    assert type(found.look.found.plant) is type(look.found.plant) and found.look.found.plant is not look.found.plant
    assert [one.name for one in found.look.promising] == [one.name for one in look.promising]


@pytest.fixture
def folder_of(tmp_path):
    return DataFolder(tmp_path / "data")


def every(stored, kind):
    """The stored objects of a class, at any depth."""
    if isinstance(stored, dict):
        if stored.get("class") == kind:
            yield stored
        stored = list(stored.values())
    if isinstance(stored, list):
        for one in stored:
            yield from every(one, kind)


def damaged(story):
    """Stories that were tampered with, by what is wrong with them."""

    def changed(path, value):
        made = copy.deepcopy(story)
        at = made
        for one in path[:-1]:
            at = at[one]
        at[path[-1]] = value
        return made

    steps = ("fields", "story", "fields", "steps")
    yield "no story", 7
    yield "another class", {**story, "class": "Path"}
    yield "a class of another place", changed((*steps, 0, "class"), "Discovery")
    yield "no steps", changed(steps, [])
    yield "fewer steps than are shown", changed(steps, copy.deepcopy(story)["fields"]["story"]["fields"]["steps"][:-1])
    yield "a reference to nothing", changed((*steps, 0, "fields", "fit"), {"same": 99999})
    yield "a reference to another kind", changed((*steps, 0, "fields", "fit"), {"same": 0})
    yield "text for numbers", changed(("fields", "look", "fields", "chi2"), "many")
    yield "an array of another length", changed(("fields", "look", "fields", "counts"), np.zeros(3))
    yield "another field", changed(("fields", "look", "fields", "more"), 1)
    endless = copy.deepcopy(story)
    for one in every(endless, "Actuator"):
        one["fields"]["step_s"] = 1e-15
    yield "a model that would fill the memory", endless
    deep = []
    for _ in range(100_000):
        deep = [deep]
    yield "too deep", changed(("fields", "known"), deep)


@pytest.mark.long
def test_a_damaged_story_is_to_be_computed_again_and_the_rest_is_shown(rigs, solved):
    there = rigs[1]
    good = solved.discovering.saved()
    names = {name: name for name in solved.discovering.files()}
    for number, (what, story) in enumerate(damaged(good["story"]), 200):
        there.discovering.restore({**good, "others": [], "number": number, "story": story}, names)
        line = there.discovering.provenance.line()
        assert there.discovering.look is None and not there.discovering.running, what
        assert line.startswith("To be computed again: the discovery of ") and line.endswith("; press Start."), line
        assert "\n" not in line and len(line) < 300
    assert there.discovering.start()
    there.done()
    assert there.discovering.look.steps == 1 and there.discovering.entries.current.number == number


def test_a_session_of_before_stories_were_stored_says_what_is_to_be_computed_again(tmp_path):
    rig = Rig(tmp_path)
    try:
        old = {"recipe": {"challenge": EASY}, "steps": [{"model": "x", "starts": {}}], "says": "1 added, 1.02 × floor"}
        rig.discovering.restore({**old, "others": [old], "experiment": None}, {})
        assert rig.discovering.provenance.line() == (
            "To be computed again: the discovery of First bench run (its steps are not in this session); press Start."
        )
        assert len(rig.discovering.entries.all) == 2 and not rig.ended and not rig.told
        assert all("1 added, 1.02 × floor" in one.words for one in rig.discovering.entries.all)
        assert rig.discovering.source.challenge is not None and not rig.discovering.running
    finally:
        rig.close()


def test_faults_are_part_of_what_is_hidden():
    settings = Settings()
    settings.set_fault(1, 0.25)
    settings.set_fault(2, 0.1)
    truth = truth_of(settings, load_actuator(), 3)
    assert truth.faults == {"k2": 0.25, "k3": 0.1} and np.allclose(truth.k, settings.k)
    assert "backlash" in truth.answer and "phase A" in truth.answer
    assert sensors_of(settings).current_noise_A == 0.45, "no rig is perfect"
    settings.set("current_noise_A", 0.1)
    assert sensors_of(settings).current_noise_A == 0.1 and sensors_of(settings).encoder_bits == 12
    assert "Nothing is hidden" in truth_of(Settings(), load_actuator(), 3).answer
