"""A discovery that comes back: sealed in Explore and solved, and taken again from a session's file."""

from __future__ import annotations

import json
import shutil

import msgspec
import numpy as np
import pytest
from support.on_page import wait_until
from support.rig import Rig

from ema_model.actuator import load_actuator
from ema_model.discovery.result import Experiment
from ema_model.effects.user import user_torque
from ema_model.errors import InputError
from emaviz.session.discover.history import WHOLE, Entries
from emaviz.session.discover.source import agrees, document_of, sensors_of, truth_of
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


def test_of_many_discoveries_the_last_ones_are_whole(solved):
    """What one has scored takes 150 MB: of those before there are the steps, taken again when one is shown."""
    now, entries = solved.discovering.entries.current, Entries(solved.discovering.source)
    words = []
    for _ in range(WHOLE + 2):
        entries.begin(now.told).look = now.look
        words.append(entries.current.words)
    assert [one.told is None for one in entries.all] == [True, True] + WHOLE * [False]
    assert [one.words for one in entries.all] == words, "they are told as before"
    assert len(entries.all[0].saved().steps) == len(now.saved().steps) == 2
    brought = [entries.bring(one.saved()) for one in (entries.all[0], entries.all[-1])]
    assert len(entries.all) == WHOLE + 2 and set(brought) <= {*entries.all}, (
        "a session that is loaded where it was saved"
    )
    assert entries.bring(msgspec.structs.replace(now.saved(), says="another")) is entries.all.pop()
    entries.show(entries.all[2])
    entries.begin(now.told)
    assert [one.told is None for one in entries.all] == [True, True, False, True, False, False]


def test_a_session_that_is_loaded_where_it_was_saved_shows_it_at_once(solved):
    path, before = solved.save(), solved.discovering.look
    count = len(solved.discovering.entries.all)
    solved.load(path)
    assert solved.discovering.look is before and not solved.discovering.job.waiting
    assert len(solved.discovering.entries.all) == count


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


@pytest.mark.long
def test_a_session_keeps_the_ladder(rigs, solved):
    there = rigs[1]
    solved.discovering._shown.told.experiment = Experiment(
        "sine", {"frequency_Hz": 2.0}, 1.0, 5.0, None, ("cogging_torque", "torque_ripple"), 80.0
    )
    solved.discovering.source.reveal()
    path = solved.save()
    before = solved.discovering.look
    looks = []
    there.discovering.events.looked.connect(looks.append)
    there.load(path)
    kept = there.discovering.saved()
    there.done()
    assert not there.told
    then = solved.discovering.saved()
    assert kept["steps"] == then["steps"] and kept["revealed"]
    assert there.discovering.saved()["revealed"] and there.discovering._stories._again is None
    after = there.discovering.look
    for (label, rmse, held), (again, same, same_held) in zip(ladder(solved), ladder(there), strict=True):
        assert again == label
        assert same == pytest.approx(rmse, rel=0.01) and same_held == pytest.approx(held, rel=0.01)
    assert [one.key for one in after.added] == [one.key for one in before.added]
    for one, again in zip(before.added, after.added):
        assert again.same_as == one.same_as
        for name, value in one.parameters.items():
            half = 0.5 * (value.interval90[1] - value.interval90[0])
            assert abs(again.parameters[name].value - value.value) < max(0.2 * half, 1e-12)
    drops = {one.name: one.predicted_drop for one in before.assessment.candidates}
    assert {one.name: one.predicted_drop for one in after.assessment.candidates} == pytest.approx(drops, abs=0.5)
    assert {one.steps for one in looks if one} >= {1, 2, 3}, "the ladder grows as the steps are taken"
    assert there.discovering.source.revealed
    assert there.discovering.experiment == solved.discovering.experiment
    assert (there.folder.folder / there.discovering.source.chosen).is_file(), "the sealed file came with it"
    there.discovering.undo()
    assert there.discovering.look.rmse == pytest.approx(ladder(solved)[1][1], rel=0.01)
    there.done()  # the cards of that step are new here


@pytest.mark.long
def test_recordings_of_compare_are_taken_again_with_what_was_asked(rigs, tmp_path):
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
    here.discovering.remove("cogging_torque")
    here.done()
    here.comparing.window_s = None  # what is asked now is not what was asked then
    path = here.save()
    (there.folder.uploads / "chirp.parquet").write_bytes(b"another file of this name")
    there.load(path)
    for name in ("uploads/chirp-2.parquet", "uploads/unseen.parquet"):
        there.comparing.add(name)  # as Compare's own part of the session does
    there.done()
    assert not there.told
    for (label, rmse, held), (again, same, same_held) in zip(ladder(here), ladder(there), strict=True):
        assert again == label
        # The fit goes on from where it had ended: a little deeper, which moves what was not fitted more.
        assert same == pytest.approx(rmse, rel=0.01) and same_held == pytest.approx(held, rel=0.03)
    assert ladder(there)[2][0].kind == "removed"
    look = there.discovering.look
    assert look.reach == ("chirp-2",) and look.held == ("unseen",)
    assert "motor.inertia_kgm2" not in look.found.calibration.parameters
    assert max(window.time_s[-1] for window in look.found.plant.windows) < 0.31


@pytest.mark.long
def test_damaged_parts_are_told_in_one_line_and_change_nothing(rigs, solved):
    there = rigs[1]
    good = json.loads(json.dumps(solved.discovering.saved()))
    names = {name: name for name in solved.discovering.files()}
    before = there.discovering.look
    step = good["steps"][0] if good["steps"] else {"model": "", "starts": {}}
    damages = [
        7,
        {},
        {**good, "recipe": 7},
        {**good, "recipe": {"challenge": "../../etc/passwd"}},
        {**good, "recipe": {"challenge": "no_such"}},
        {**good, "recipe": {"challenge": "", "fitted": 7, "held": []}},
        {**good, "steps": 7},
        {**good, "steps": [7]},
        {**good, "steps": [{"model": 7, "starts": {}}]},
        {**good, "steps": [{"model": "", "starts": {"x": "evil"}}]},
        {**good, "steps": [{**step, "starts": {"x": 1e99}}]},
        {**good, "steps": [step] * 999},
        {**good, "experiment": {"command": "evil"}},
        {**good, "experiment": 7},
    ]
    for saved in damages:
        with pytest.raises(InputError) as told:
            there.discovering.restore(saved, names)
        assert "\n" not in str(told.value)
    assert there.discovering.look is before and not there.discovering.running


@pytest.mark.long
def test_a_step_whose_model_is_damaged_leaves_the_steps_before_it(rigs):
    there = rigs[1]
    saved = {"recipe": {"challenge": EASY}, "steps": [{"model": "evil", "starts": {}}], "experiment": None}
    there.discovering.restore(saved, {})
    there.done()
    assert len(there.told) == 1 and "\n" not in there.told[0][1] and "/tmp" not in there.told[0][1]
    there.told.clear()
    assert there.discovering.look.steps == 1


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
