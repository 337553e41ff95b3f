"""What the package's functions state of their options: names, types, defaults, meaning; and that they hold to it."""

from __future__ import annotations

import inspect
import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import get_type_hints

import numpy as np
import pytest
from support import known_flights
from support.flights import flights

import ema_model as em
import emaviz
from ema_model import comparison, discovery
from ema_model.fleet.compare import compare_units
from ema_model.identification import run
from ema_model.recordings import Measurement
from ema_model.tracking.track import track

FUNCTIONS = [name for name in em.__all__ if inspect.isfunction(getattr(em, name))]
# Each with the functions that it hands its options to; what those take beside are recordings, or made of them.
BEHIND = {
    "compare": [comparison.compare],
    "compare_units": [compare_units],
    "discover": [discovery.discover],
    "identify": [run.steps, run.identify],
    "track": [track],
}
RECORDINGS = {"measurements", "units", "holdout", "objective", "flights", "options"}


@pytest.fixture(scope="module")
def recording():
    return em.simulate("chirp", duration_s=0.2, noise_A=0.1)


def options(*functions) -> dict[str, tuple[object, object]]:
    """Their defaults and types, by name."""
    return {
        name: (one.default, get_type_hints(function)[name])
        for function in functions
        for name, one in inspect.signature(function).parameters.items()
        if name not in RECORDINGS
    }


@pytest.mark.parametrize("name", BEHIND)
def test_options_are_those_of_the_function_behind(name):
    ours, behind = options(getattr(em, name)), options(*BEHIND[name])
    own = {"of", "actuator", *({"on_progress"} if name == "track" else ())}  # which the functions behind do without
    assert {option: ours[option] for option in ours.keys() - own} == {
        option: behind[option] for option in behind.keys() - own
    }


@pytest.mark.parametrize("name", FUNCTIONS)
def test_each_option_has_a_type_and_a_line_of_its_own(name):
    function = getattr(em, name)
    told = inspect.getdoc(function)
    for option, one in inspect.signature(function).parameters.items():
        assert one.annotation not in (inspect.Parameter.empty, "Any"), option
        assert re.search(rf"^{option}: \S", told, re.M), option


def test_units_stand_with_the_numbers_that_have_one():
    told = inspect.getdoc(em.simulate)
    for option, unit in {"load_torque_Nm": "N·m", "duration_s": "s", "sample_rate_Hz": "Hz", "noise_A": "A"}.items():
        assert re.search(rf"^{option}: .*\b{unit}\b", told, re.M), option


WRONG = {
    "of is a number": ("compare", lambda it: {"of": 3}, "em.compare: of must be a file's name"),
    "a number among files": ("discover", lambda it: {"of": ["a.csv", 3]}, "em.discover: of must be a file's name"),
    "a unit's file": ("compare_units", lambda it: {"units": {"a": 1}}, "em.compare_units: units must be recordings by"),
    "an actuator's file": ("compare", lambda it: {"of": it, "actuator": "a.toml"}, "em.load_actuator gives it"),
    "holdout": ("discover", lambda it: {"of": it, "holdout": 2.0}, "em.discover: holdout must be a file's name"),
    "one name for a list": ("compare", lambda it: {"of": it, "free": "k1"}, r"free must be a list of texts.*'k1'$"),
    "a list for a mapping": ("compare", lambda it: {"of": it, "effects": ["ripple"]}, "effects must be settings by"),
    "a text for a flag": ("compare", lambda it: {"of": it, "calibrate": "no"}, "must be True or False, not 'no'"),
    "a text for a whole number": ("discover", lambda it: {"of": it, "most_effects": "3"}, "must be a whole number"),
    "a negative seed": ("identify", lambda it: {"of": it, "seed": -1}, "em.identify: seed must be a whole number"),
    "a text for an iteration": ("identify", lambda it: {"of": it, "iterations": "many"}, "iterations must be a whole"),
    "a setting of the algorithm": ("identify", lambda it: {"of": it, "beta": "x"}, "beta must be a number, not"),
    "a text for a threshold": ("track", lambda it: {"of": [it], "thresholds": {"k2": "x"}}, "thresholds must be"),
    "k of text": ("compare", lambda it: {"of": it, "k": "fast"}, "k must be 8 numbers, k1 … k8, not 'fast'"),
    "k too short": ("compare", lambda it: {"of": it, "k": [0.1]}, "k must be 8 numbers"),
    "k beyond 1": ("compare", lambda it: {"of": it, "k": [2.0] + [0.0] * 7}, "k1 = 2 is outside 0 … 1"),
    "the truth": ("identify", lambda it: {"of": it, "truth": [[0.0]]}, "must be 8 numbers"),
    "a number to read": ("read", lambda it: {"path": 3}, "em.read: path must be a file's name, not 3"),
    "health of a number": ("health", lambda it: {"of": 3}, "em.health: of must be a file's name"),
    "a number for an actuator": ("load_actuator", lambda it: {"path": 3}, "path must be a file's name"),
    "a fault of text": ("simulate", lambda it: {"faults": {"k1": "x"}}, "faults must be numbers by name"),
    "no callable": ("compare", lambda it: {"of": it, "on_progress": 1}, "on_progress must be a function"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_type_is_one_line(name, recording):
    function, given, expected = WRONG[name]
    with pytest.raises(em.InputError, match=expected) as caught:
        getattr(em, function)(**given(recording))
    assert "\n" not in str(caught.value) and caught.value.__cause__ is None


def test_numbers_of_numpy_and_paths_are_taken(recording):
    found = em.compare((recording,), calibrate=np.bool_(False), k=np.zeros(8) + 0.5, free=("k1",))
    assert found.actuator.faults["k1"] == 0.5
    again = em.simulate(duration_s=np.float32(0.2), seed=np.int64(3), faults={"k2": np.float64(0.1)})
    assert isinstance(again, Measurement) and again.samples == recording.samples


def test_flights_are_tracked_from_a_folder_or_in_order(tmp_path, monkeypatch):
    known = flights(0.1 + 0.04 * np.arange(9))
    monkeypatch.setattr("ema_model.api.identified", known_flights.known(known, asked := []))
    known_flights.write_flights(tmp_path / "unit", len(known))
    told = []
    of_folder = em.track(tmp_path / "unit", thresholds={"k1": 0.6}, on_progress=told.append)
    files = sorted((tmp_path / "unit").iterdir())
    of_files = em.track([*files[:-1], em.read(files[-1])], thresholds={"k1": 0.6})
    assert (
        str(of_files) == str(of_folder) == str(track([replace(a, name=b) for a, b in zip(known, asked)], {"k1": 0.6}))
    )
    assert told[0] == "flight 1 of 9: flight_00" and len(asked) == 2 * len(known)
    for wrong, expected in ((files[:2], "2 flights tell no trend"), (files[::-1], "comes after")):
        with pytest.raises(em.InputError, match=expected):
            em.track(wrong)


PROGRAM = """
import ema_model as em
found = em.compare("rig.csv", calibrate=False)
reveal_type(found)
reveal_type(em.identify("rig.csv").rmse)
em.compare("rig.csv", calibrat=False)
em.discover("rig.csv", most_effects="3")
"""


def test_both_packages_say_that_they_are_typed():
    for package in (em, emaviz):
        assert Path(package.__path__[0], "py.typed").is_file()


@pytest.mark.long
def test_a_type_checker_sees_the_types(tmp_path):
    """From outside, as of an installed package: py.typed is what makes it look."""
    (tmp_path / "user.py").write_text(PROGRAM)
    (tmp_path / "pyrightconfig.json").write_text(
        json.dumps({"include": ["user.py"], "extraPaths": [str(Path(em.__path__[0]).parent)]})
    )
    command = [str(Path(sys.executable).with_name("pyright")), "--outputjson", "--pythonpath", sys.executable]
    told = json.loads(subprocess.run(command, cwd=tmp_path, capture_output=True, text=True).stdout)
    said = [(one["range"]["start"]["line"], one["message"]) for one in told["generalDiagnostics"]]
    assert [line for line, _ in said] == [3, 4, 5, 6], said
    assert "Comparison" in said[0][1] and "float" in said[1][1] and "calibrat" in said[2][1]
