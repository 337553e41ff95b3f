"""Which recordings are held out: by their own names, or as it is proposed and taken at a click."""

from __future__ import annotations

import numpy as np
import pytest
from support.on_page import wait_until
from support.rig import Rig

from ema_model.errors import InputError
from ema_model.recordings import Measurement, write_measurement
from emaviz.session.compare import HoldOut, called_held_out, proposed

TIME = np.arange(0.0, 0.2, 1e-3)


def recording(amplitude, name="r"):
    position = amplitude * np.sin(20.0 * TIME)
    signals = {"time_s": TIME, "command_rad": position, "user_position_rad": position, "current_A": 20.0 * position}
    return Measurement({**signals, "motor_position_rad": 500.0 * position}, name)


@pytest.mark.parametrize(
    ("names", "held"),
    [
        (["chirp.csv", "unseen.csv"], ["unseen.csv"]),
        (["a/run1.csv", "a/Test 2.csv", "a/held-out.csv"], ["a/Test 2.csv", "a/held-out.csv"]),
        (["step_holdout.mat", "step.mat"], ["step_holdout.mat"]),
        (["latest.csv", "protest.csv", "contested.csv", "withheld.csv"], []),
        (["test 1.csv", "test 2.csv"], []),  # all of them: then it says nothing
        (["unseen.csv"], []),
    ],
)
def test_a_name_says_that_a_file_is_not_to_be_fitted(names, held):
    assert called_held_out(names) == held


def test_of_several_one_is_proposed():
    small, large, larger = (recording(0.01 * i) for i in (1, 2, 3))
    assert proposed({"a": small, "b": large}) is None, "too few to spare one"
    assert proposed({"a": small, "b": large, "c": larger}) == HoldOut("c", "it is the last of 3")
    again = proposed({"x/a.csv": small, "b": recording(0.01), "c": larger})
    assert again == HoldOut("b", "it repeats the command of a.csv")


@pytest.fixture
def rig(tmp_path):
    made = Rig(tmp_path)
    yield made
    made.close()


def test_a_session_holds_out_what_says_so_and_takes_a_persons_word(rig):
    comparing = rig.comparing
    comparing.asking.ask = lambda by_hand: None  # nothing is to be computed
    for i, name in enumerate(("one", "two", "unseen"), 1):
        write_measurement(recording(0.01 * i), rig.folder.folder / f"{name}.csv")
        comparing.add(f"{name}.csv")
    wait_until(lambda: len(comparing.opened) == 3, 20.0)
    assert comparing.held_out == {"unseen.csv"} and comparing.proposal is None
    assert comparing.inputs().subject == "one.csv and two.csv"
    comparing.hold_out("unseen.csv", False)
    write_measurement(recording(0.05), rig.folder.folder / "validation.csv")
    comparing.add("validation.csv")
    wait_until(lambda: len(comparing.opened) == 4, 20.0)
    assert not comparing.held_out, "somebody has said what is held out"
    for name in comparing.opened:
        comparing.hold_out(name, True)
    with pytest.raises(InputError, match="all measurements are held out"):
        comparing.compare()
    comparing.remove("validation.csv")
    assert comparing.held_out == {"one.csv", "two.csv", "unseen.csv"}
