"""What a kind's file declares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pyarrow as pa

from ema_model.campaign.plan_axes import TaskInputs

TEXT, NUMBER, FLAG = pa.string(), pa.float64(), pa.bool_()
TEXTS, NUMBERS = pa.list_(pa.string()), pa.list_(pa.float64())

COMMON = pa.schema(
    [
        ("name", TEXT),  # of the task
        ("group", TEXT),
        ("case", TEXT),
        ("seed", pa.int64()),
        ("error", TEXT),  # null where the task has its answer; the kind's columns are null beside one
        ("k_true", NUMBERS),  # (8,), of a simulated plant
        ("hidden", TEXTS),  # effects of the plant that the model lacks
        ("files", TEXTS),  # the recordings that were fitted
        ("task", TEXT),  # all of it, so that it can be computed again
    ]
)
HOW = pa.schema(  # how a row came about, which is another each time: in the parts, not in the tables
    [
        ("elapsed_s", NUMBER),
        ("answer_s", NUMBER),  # of an identification itself, without compiling and without making its recordings
        ("worker", TEXT),
        ("memory_MB", NUMBER),
        ("finished_s", NUMBER),
    ]
)


@dataclass(frozen=True)
class Kind:
    """A kind of task.

    run(inputs, settings, seed) gives a value for each of `columns`, which depends on its arguments only, and of `HOW`
    what it knows; it raises InputError or FloatingPointError for what cannot be computed.
    """

    title: str
    settings: type[Any]  # a frozen dataclass: each field is an option of a plan's group, and may be an axis
    columns: pa.Schema
    run: Callable[[TaskInputs, Any, int], dict[str, Any]]
    seconds: Callable[[Any], float]  # about how long one takes on one core, from its settings
    told: Callable[[list[dict[str, Any]]], dict[str, Any]]  # what rows without errors say together, by its title
    from_recordings: bool = True  # else it makes all that it needs from its settings and the seed
    name: str = ""  # of the file; `KINDS` fills it in

    @property
    def schema(self) -> pa.Schema:
        """Of its table."""
        return pa.schema([*COMMON, *self.columns])
