"""The contract of results: the JSON form, its schema and what is restored are all of a class's types."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import msgspec
import numpy as np
import pytest
from msgspec import Meta
from numpy.typing import NDArray

from ema_model.errors import InputError
from ema_model.result import FLAT, NAME, NULL, Result, as_named, json_type
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
