"""A task: everything that one computation depends on, and the name that follows from it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import msgspec

_NAME_DIGITS = 24  # of the hash: two of a million tasks share a name once in 1e17 campaigns


@dataclass(frozen=True)
class Excitation:
    """What a simulated recording is made with: a command of the library, at rest at its start."""

    command: str
    settings: dict[str, Any] = field(default_factory=dict)
    duration_s: float = 0.5
    sample_rate_Hz: float = 10_000.0


@dataclass(frozen=True)
class Simulated:
    """A plant, drawn already, and the sensors that record it."""

    runs: tuple[Excitation, ...]
    holdout: tuple[Excitation, ...] = ()
    faults: dict[str, float] = field(default_factory=dict)
    values: dict[str, float] = field(default_factory=dict)  # base parameters in which it differs from its file
    effects: dict[str, dict[str, Any]] = field(default_factory=dict)  # as an actuator file has them
    load_torque_Nm: float = 0.0
    load_recorded: bool = True
    noise_A: float = 0.0
    encoder_bits: int = 0
    noise_seed: int = 0


@dataclass(frozen=True)
class File:
    """A recording as it was when the task was made."""

    path: str
    digest: str  # of its content, and its side file's


@dataclass(frozen=True)
class Recorded:
    """Recordings of one actuator."""

    files: tuple[File, ...]
    holdout: tuple[File, ...] = ()
    mapping: tuple[str, ...] = ()


@dataclass(frozen=True)
class Task:
    """One computation.  What it gives depends on nothing else, but for the version of the program."""

    kind: str  # of `ema_model.campaign.kinds`
    group: str
    case: str  # what tells it from the others of its group, but for the seed
    seed: int
    actuator: str  # the text of the file
    settings: dict[str, Any]  # of the kind
    simulated: Simulated | None = None
    recorded: Recorded | None = None

    @cached_property
    def name(self) -> str:
        """A hash of all of it."""
        return hashlib.sha256(msgspec.json.encode(self, order="sorted")).hexdigest()[:_NAME_DIGITS]

    def as_json(self) -> str:
        """All of it, but of the actuator's file only the hash under which the campaign keeps it."""
        return msgspec.json.encode(replace(self, actuator=text_hash(self.actuator)), order="sorted").decode()


def text_hash(text: str) -> str:
    """The name under which a campaign keeps an actuator's file."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def from_json(text: str, actuators: dict[str, str]) -> Task:
    """The inverse of `Task.as_json`; actuators: the files' texts by their hash."""
    task = msgspec.json.decode(text, type=Task)
    return replace(task, actuator=actuators[task.actuator])
