"""What a session's file holds of Units: the whole answer, and what is refused of a damaged one."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.errors import InputError
from ema_model.fleet.result import Alone, Difference, Need, OfRecording, OfType, Transfer, UnitsCompared
from emaviz.session.fleet import read_saved, saved

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


def kept(found: UnitsCompared | None = FOUND):
    return json.loads(json.dumps(saved("fleet", "*unseen*", ACTUATOR.name, found)))


def test_the_answer_comes_back_whole():
    told, again = read_saved(kept())
    assert (told.folder, told.rule, told.actuator) == ("fleet", "*unseen*", ACTUATOR.name)
    assert again is not None and again.to_dict() == FOUND.to_dict() and str(again) == str(FOUND)
    assert again.type_actuator.value(PLAY) == 1.1e-5 and again.actuator.tolerances == ACTUATOR.tolerances
    assert read_saved(kept(None))[1] is None


@pytest.mark.parametrize(
    "damage",
    [
        {"units": ["a"]},
        {"units": ["a", "c"]},
        {"transfer": [[1.0, 2.0], [3.0]]},
        {"errors": [1.0, float("nan")]},
        {"alone": {PLAY: [[1.0, 2.0], [1.0, 2.0]]}},
        {"signal": "colour"},
        {"actuator": "no file"},
        {"of_type": {}},
        {"differences": [{"unit": "b"}]},
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(damage):
    given = kept()
    given["answer"] |= damage
    with pytest.raises(InputError, match="the session's") as told:
        read_saved(given)
    assert "\n" not in str(told.value)
