"""A worn actuator in Discover: its faults are told from missing physics, revealed, and kept by a session."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.on_page import wait_until
from support.rig import Rig

from ema_model.actuator import load_actuator
from ema_model.challenges.truth import Truth
from ema_model.comparison.thresholds import BAND
from ema_model.discovery.result import Change
from ema_model.discovery.thresholds import WORTH_A_LOOK
from ema_model.discovery.words import faults, headline, sentences
from ema_model.errors import InputError
from emaviz.figures import discovery
from emaviz.figures.discovery import equation
from emaviz.page import discover_candidate
from emaviz.page.discover_candidate import about_fault
from emaviz.page.discover_result import answer
from emaviz.session.discovery_source import agrees, document_of
from emaviz.text.verdicts import MEANINGS

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """A plant with twenty times the backlash, sealed in Explore and opened in Discover."""
    rig = Rig(tmp_path_factory.mktemp("worn"))
    rig.session.settings.set_fault(1, 0.2)
    sealed = []
    rig.discovering.sealing.sealed.connect(sealed.append)
    assert rig.discovering.sealing.seal("Worn", "It rattles.")
    wait_until(lambda: sealed)
    (name,) = rig.discovering.source.sealed
    rig.discovering.choose(name)
    assert rig.discovering.start()
    rig.done()
    rig.offered = rig.discovering.look
    assert rig.discovering.add("k2")
    rig.done()
    yield rig
    rig.close()


@pytest.fixture
def worn(rig):
    return rig.discovering


def test_start_offers_the_fault_beside_the_effects(rig):
    look = rig.offered
    assert not look.found.faults and look.steps == 1, "a person decides"
    best = look.promising[0]
    assert best.name == "k2" and look.share(best) > 0.5
    text = discover_candidate.label(look, best)
    assert text.startswith("Backlash (fault k2)\nerror ") and "backlash " in text and "µrad, k2 ≈ 0." in text
    assert "% probable" in text
    assert "Next: backlash (fault k2), " in answer(look)
    shown = discovery.signature(look, best)
    assert len(shown.data) == 2 and "backlash (fault k2) would change" in shown.data[1].name
    about = about_fault("k2", look.found.actuator)
    assert "99" in about and "Mistaken for" in about and "k2 0.25 to 0.75" in about


def test_what_was_tried_in_vain_is_told_with_its_reason(rig):
    """All that is missing was looked for, and what would pay was refused."""
    why = {"asymmetric_friction": "the recordings ask for another ratio each: 0.0922 and 0.210"}
    found = replace(rig.offered.found, not_claimed=why)
    told = answer(replace(rig.offered, found=found))
    assert headline(found) in told and "Asymmetric friction is not claimed: the recordings ask" in told
    assert "Physics is missing" not in told


def test_it_is_added_by_its_name(worn):
    look = worn.look
    assert list(look.found.faults) == ["k2"] and not look.added
    assert all(one.predicted_drop < 2.0 * WORTH_A_LOOK for one in look.promising), "what is left asks for no effect"
    assert [rung.change for rung in look.found.ladder] == [Change(), Change("fault", ("k2",))]
    assert look.rmse < BAND < look.found.ladder[0].rmse
    assert headline(look.found) == "No physics is missing: the actuator has the fault k2 backlash."
    assert "k2 backlash" in faults(look.found)["k2"] and "µrad" in faults(look.found)["k2"]
    assert any("k2 backlash" in text for text in sentences(look.found))
    assert MEANINGS["found"] in answer(look), "at the floor, and not as it should be"
    assert "Backlash (fault k2):" in equation(look.found, look.added) and look.removable == ["k2"]
    assert worn.entries.current.result.startswith("1 added")
    told = answer(replace(look, assessment=None))
    assert "So far: the fault k2 backlash.<" in told and "With it the error falls" in told


def test_before_a_verdict_nothing_is_said_to_be_found(rig):
    told = answer(replace(rig.offered, assessment=None))
    assert "The calibrated model" in told and "So far" not in told and "Analysing the residual" in told


@pytest.mark.long
def test_the_improved_model_is_kept_with_its_fault_and_verified(worn):
    told = []
    worn.events.verified.connect(lambda path, text: told.append((path, text)))
    worn.keep(".toml")
    wait_until(lambda: told)
    [(path, text)] = told
    assert load_actuator(path).faults == {"k2": worn.look.found.faults["k2"].value}
    assert text.startswith("verified: ") and "× the floor" in text and "worse" not in text


@pytest.mark.long
def test_reveal_holds_the_faults_against_the_truth(worn):
    truth = worn.source.reveal()
    assert truth.faults == {"k2": 0.2}
    assert agrees(truth, worn.look.found, ())
    told = document_of(truth, worn.look.found, ()).text
    assert "Your answer agrees" in told and "k2 0.2 in truth" in told
    nothing = Truth("", 0, "nothing")
    assert (
        not agrees(nothing, worn.look.found, ()) and "not hidden here" in document_of(nothing, worn.look.found, ()).text
    )
    shorted = Truth("", 0, "a short", faults={"k3": 0.4})
    assert not agrees(shorted, worn.look.found, ()) and "not found" in document_of(shorted, worn.look.found, ()).text


@pytest.mark.long
def test_a_session_keeps_the_fault_and_undo_takes_it_back(rig, worn):
    path, before, entry = rig.save(), worn.look, worn.entries.current
    for entry in worn.entries.all:
        entry.number += 100  # so that none of them is taken for one of the file's
    rig.load(path)
    assert worn.look is not before and worn.look.found.to_dict() == before.found.to_dict() and not rig.ended
    assert "k2" in worn.look.found.faults and worn.look.removable == before.removable
    worn.undo()
    rig.done()
    again = worn.look
    worn.show(entry)
    worn.undo()
    rig.done()
    assert worn.look is not again and not worn.look.found.faults and worn.look.rmse == pytest.approx(again.rmse)


@pytest.mark.long
def test_a_fault_is_removed_as_a_step_of_its_own_and_found_again_by_find_all(rig, worn):
    rig.ended.clear()
    with pytest.raises(InputError, match="not in the model"):
        worn.remove("k2")
    for begin in (lambda: worn.add("k2"), lambda: worn.remove("k2")):
        assert begin()
        rig.done()
    look = worn.look
    assert not look.found.faults and look.removable == [] and look.promising[0].name == "k2"
    assert [rung.change.kind for rung in look.found.ladder] == ["calibrated", "fault", "removed"]
    path = rig.save()
    for entry in worn.entries.all:
        entry.number += 100
    rig.load(path)
    assert worn.look is not look and worn.look.found.to_dict() == look.found.to_dict()
    assert worn.find_all()
    rig.done()
    assert list(worn.look.found.faults) == ["k2"] and worn.look.rmse < 1.1
