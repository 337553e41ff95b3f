"""What a session's file holds of Units: the whole answer, and what is refused of a damaged one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.fleet.result import Alone, Difference, Need, OfRecording, OfType, Transfer, UnitsCompared
from emaviz.session import session_file
from emaviz.session.data_folder import DataFolder
from emaviz.session.explore import Session
from emaviz.session.fleet import ComparingUnits
from emaviz.session.jobs import Worker
from emaviz.session.session_file import Part, results_part

ACTUATOR = load_actuator()
PLAY, GAIN = "transmission.backlash_rad", "controller.speed_gain_Nms_rad"
DIFFERENCE = Difference("b", PLAY, (GAIN,), -1e-5, (-2e-5, -1e-6), -0.3, (-0.5, -0.1), 25.0, None)
FOUND = UnitsCompared(
    actuator=ACTUATOR,
    units=("a", "b"),
    recordings=(("chirp", "step"), ("chirp",)),
    held_out=(("unseen",), ()),
    differences=(DIFFERENCE,),
    dropped=(replace(DIFFERENCE, parameter=GAIN, alike=(), held_out=-12.5, share=None, share90=None),),
    of_recordings=(OfRecording("a", "chirp", "current_zero", 0.1, (0.05, 0.15), "A", True),),
    of_type={path: OfType(1e-5, (0.9e-5, 1.1e-5), 0.0, 1e-6, "rad", True) for path in (PLAY, GAIN)},
    alone={path: Alone(np.array([1e-5, 0.1]), np.array([1e-6, 2e-6])) for path in (PLAY, GAIN)},
    transfer=Transfer("current_A", np.array([[0.1, 0.2], [0.3, 0.4]]), np.array([0.1, 0.1]), np.full((2, 2), 1.5)),
    needs=(Need("b", GAIN, "step"),),
    errors=np.array([1.0, 1.1]),
    type_actuator=ACTUATOR.with_values({PLAY: 1.1e-5}),
    warnings=("one warning",),
)


class Chosen:
    """A session with units that were compared."""

    def __init__(self, folder):
        self.folder = DataFolder(folder)
        self.session = Session(ACTUATOR, self.folder.recordings)
        self.files = Worker("test-files", lambda error: pytest.fail(str(error)))
        self.units = ComparingUnits(self.session, self.folder, self.files)
        results = results_part(lambda: {"units": self.units.provenance})
        self.parts = {"units": Part(self.units.saved, self.units.restore, self.units.files), "results": results}
        self.shown, self.begun = [], []
        self.units.events.compared.connect(self.shown.append)
        self.units.job.began.connect(self.begun.append)

    def save(self):
        path = session_file.free_path(self.folder, "kept")
        session_file.write_session(path, self.parts, self.folder, [])
        return path

    def load(self, path):
        session_file.read_session(path, self.parts, self.folder)

    def close(self):
        self.files.close()
        self.session.close()


@pytest.fixture
def sessions(tmp_path):
    made = [Chosen(tmp_path / name) for name in ("here", "there")]
    yield made
    for one in made:
        one.close()


def compared(one):
    one.units.chosen, one.units.found = "fleet", FOUND
    one.units.provenance.take()
    return one


def drawn(found):
    """All that the page draws."""
    return [found.to_dict(), found.document.text, [figure.to_json() for figure in found.figures()], str(found)]


def test_the_answer_comes_back_whole(sessions, computed):
    here, there = sessions
    there.load(compared(here).save())
    (again,) = there.shown
    assert drawn(again) == drawn(FOUND) and again is there.units.found and not there.begun and not computed
    assert (there.units.chosen, there.units.rule, there.units.actuator_name) == ("fleet", "*unseen*", ACTUATOR.name)
    assert again.type_actuator.value(PLAY) == 1.1e-5 and again.actuator.tolerances == ACTUATOR.tolerances
    assert there.units.provenance.line() == "", "its folder is not here, so that nothing is known of it"
    here.units.found = None
    here.units.provenance.clear()
    there.load(here.save())
    assert there.units.found is None and there.units.provenance.line() == ""


@pytest.mark.parametrize(
    "damage",
    [
        {"units": ["a"]},
        {"transfer": 7},
        {"errors": "many"},
        {"alone": []},
        {"actuator": "no file"},
        {"of_type": 7},
        {"differences": [{"unit": "b"}]},
        {"more": 1},
    ],
)
def test_what_makes_no_sense_is_to_be_computed_again(sessions, damage):
    here, there = sessions
    saved = {name: part.save() for name, part in compared(here).parts.items()}
    saved["results"]["units"]["whole"]["fields"] |= damage
    for name, part in there.parts.items():
        part.restore(saved[name], {})
    line = there.units.provenance.line()
    assert line.startswith("To be computed again: the comparison of fleet, which this session was saved with (")
    assert line.endswith("); press Compare units.") and "\n" not in line and there.units.found is None


def test_a_session_of_before_says_what_is_to_be_computed_again(sessions):
    here, there = sessions
    saved = {name: part.save() for name, part in compared(here).parts.items()}
    del saved["results"]["units"]["whole"]
    saved["units"]["answer"] = {"units": ["a", "b"]}
    for name, part in there.parts.items():
        part.restore(saved[name], {})
    assert there.units.provenance.line() == (
        "To be computed again: the comparison of fleet, which this session was saved with; press Compare units."
    )
