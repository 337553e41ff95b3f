"""The contract of results: the JSON form, its schema and what is restored are all of a class's types."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import msgspec
import numpy as np
import pytest
from msgspec import Meta
from numpy.typing import NDArray

from ema_model.errors import InputError
from ema_model.result import FLAT, NAME, NULL, Result, as_named, json_type, restored, stored
from ema_model.text import Document, Lines


@dataclass(frozen=True)
class Sure:
    """How sure it is."""

    band: Annotated[tuple[float, float], as_named("interval90", "its ends", **NULL)]
    why: Annotated[str, Meta(description="in words")] = ""


@dataclass(frozen=True)
class Found:
    """What one signal says."""

    rms: Annotated[float, Meta(description="in its unit", extra=NULL)]
    sure: Annotated[Sure, Meta(extra=FLAT)]


@dataclass(frozen=True, eq=False, repr=False)
class Answer(Result):
    """Everything."""

    by_signal: Annotated[Mapping[str, Found], as_named("signals", "by name", **NAME)]
    pairs: Annotated[tuple[tuple[str, str], ...], Meta(description="of names", extra=NAME)]
    curve: Annotated[NDArray[np.float64], Meta(description="rows", extra={"dimensions": 2})]
    first: Annotated[str | None, Meta(description="a name, or none", extra=NAME)] = None
    parts: Annotated[Sequence[Sure], Meta(description="several")] = field(default_factory=list)
    series: tuple[float, ...] = ()  # not told

    def name_in_files(self, name: str) -> str:
        return name.upper()

    @property
    def count(self) -> Annotated[int, Meta(description="of the signals")]:
        return len(self.by_signal)


def document_of(answer: Answer) -> Document:
    """A line for each signal."""
    return Document([Lines([f"{name}: {one.rms:.1f}" for name, one in answer.by_signal.items()])])


ANSWER = Answer(
    {"a": Found(1.0, Sure((0.5, math.nan))), "b": Found(math.inf, Sure((1.0, 2.0), "noise"))},
    (("a", "b"),),
    np.array([[1.0, math.nan]]),
    parts=[Sure((3.0, 4.0))],
    series=(1.0,),
)
TOLD = {
    "signals": {
        "A": {"rms": 1.0, "interval90": [0.5, None], "why": ""},
        "B": {"rms": None, "interval90": [1.0, 2.0], "why": "noise"},
    },
    "pairs": [["A", "B"]],
    "curve": [[1.0, None]],
    "first": None,
    "parts": [{"interval90": [3.0, 4.0], "why": ""}],
    "count": 2,
}


def test_the_json_form_has_what_is_described_and_nothing_else():
    assert ANSWER.to_dict() == json.loads(json.dumps(TOLD, allow_nan=False))
    assert ANSWER.lines == ["a: 1.0", "b: inf"]


def test_the_form_fits_its_own_type_and_no_other_does():
    kind = json_type(Answer)
    assert msgspec.convert(TOLD, kind, strict=True) == TOLD
    for wrong in ({"signals": {"A": {"rms": "1"}}}, {"pairs": [["A"]]}, {"first": 1}, {"curve": [1.0]}):
        with pytest.raises(msgspec.ValidationError):
            msgspec.convert(TOLD | wrong, kind, strict=True)
    schema = msgspec.json.schema(kind)
    fields = schema["$defs"]["Found"]["properties"]
    assert fields.keys() == {"rms", "interval90", "why"}
    assert {"type": "null"} in fields["rms"]["anyOf"] and fields["rms"]["description"] == "in its unit"


def test_what_is_told_is_restored_by_the_names_that_files_have():
    again = Answer.from_dict(TOLD)
    assert again.to_dict() == TOLD and again.series == () and math.isnan(again.by_signal["A"].sure.band[1])
    assert isinstance(again.curve, np.ndarray) and again.curve.shape == (1, 2)
    for wrong in ({"pairs": 1}, {"parts": [{"why": ""}]}, {"curve": "none"}):
        with pytest.raises(InputError, match="compute it anew") as error:
            Answer.from_dict(TOLD | wrong)
        assert "\n" not in str(error.value)


# --- stored whole -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Parts:
    """Of which a machine is made."""

    values: NDArray[np.float64]
    stretches: Sequence[list[slice] | None] | None

    def made(self) -> Machine:
        return Machine(self.values, self.stretches)


class Machine:
    """What holds more than can be stored."""

    def __init__(self, values, stretches):
        self.values, self.stretches, self.handle = values, stretches, threading.Lock()

    def made_of(self) -> Parts:
        """As it is stored."""
        return Parts(self.values, self.stretches)


@dataclass(frozen=True, eq=False)
class Step:
    """One of several that share a machine."""

    machine: Machine
    before: Step | None = None
    known: dict[Sure, int] = field(default_factory=dict)


def steps():
    machine = Machine(np.arange(3.0), [[slice(0, 5), slice(7, 9, 2)], None])
    first = Step(machine, None, {Sure((0.0, math.inf)): 1})
    return Step(machine, first), first


def test_an_object_is_stored_by_its_parts_once_and_made_again():
    last, first = steps()
    again = restored(stored(last), Step)
    assert again.machine is again.before.machine and again.machine is not last.machine
    assert np.array_equal(again.machine.values, np.arange(3.0))
    assert again.machine.stretches == [[slice(0, 5), slice(7, 9, 2)], None]
    assert again.before.known == first.known and again.before.before is None
    with pytest.raises(InputError, match="a lock is not stored"):
        stored(Sure((0.0, 1.0), threading.Lock()))


@pytest.mark.parametrize(
    "path",
    [
        ("class",),
        ("fields", "machine"),
        ("fields", "machine", "class"),
        ("fields", "machine", "fields", "values"),
        ("fields", "machine", "fields", "stretches", 0, 0),
        ("fields", "before", "fields", "machine", "same"),
        ("fields", "known"),
    ],
)
@pytest.mark.parametrize("bad", ["os.system", 99999, -1, [7], {"class": "Lock", "fields": {}}, None])
def test_what_is_not_as_its_type_says_is_never_made(path, bad):
    given = stored(steps()[0])
    at = given
    for one in path[:-1]:
        at = at[one]
    at[path[-1]] = bad
    if path == ("fields", "before", "fields", "machine", "same") and bad == -1:
        return  # counted from the end, it is a machine again, or refused
    with pytest.raises(InputError, match="was stored by another version, or is damaged") as told:
        restored(given, Step)
    assert "\n" not in str(told.value)


def test_what_cannot_be_told_of_a_result_is_damaged():
    answer = Answer({"a": Found(1.0, Sure((0.0, 1.0)))}, (("a", "b"),), np.zeros((1, 2)))
    assert Answer.restored(answer.stored()).to_dict() == answer.to_dict()
    given = answer.stored()
    given["fields"]["by_signal"][0][1]["fields"]["rms"] = "many"
    with pytest.raises(InputError, match="is damaged"):
        Answer.restored(given)
