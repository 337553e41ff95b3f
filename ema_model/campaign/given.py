"""What a task works on: its actuator and its recordings, read or simulated."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.file import parse_actuator
from ema_model.campaign.task import Excitation, File, Simulated, Task
from ema_model.commands import command
from ema_model.effects import find
from ema_model.effects.user.entries import kind_of, read_entries
from ema_model.errors import InputError
from ema_model.faults import vector
from ema_model.files.user_file import open_user_file
from ema_model.recordings import Measurement, find_side_file, read
from ema_model.recordings.recording_set import check_held_out
from ema_model.simulation.plant import simulate
from ema_model.simulation.run import Run
from ema_model.simulation.sensors import Sensors

_PIECE = 1 << 20
_NEXT_NOISE = 7  # from one recording's seed to the next one's


@dataclass(frozen=True)
class Given:
    """What a kind of task gets."""

    actuator: Actuator  # as its file says: what is fitted
    fitted: list[Measurement]
    held: list[Measurement]
    truth: NDArray[Any] | None = None  # (8,), of a simulated plant
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)  # hidden in it


def given(task: Task) -> Given:
    """Reads or simulates; InputError and FloatingPointError as those do."""
    actuator = _actuator(task.actuator)
    if task.recorded is not None:
        fitted, held = (
            [_read(file, actuator, task.recorded.mapping) for file in files]
            for files in (task.recorded.files, task.recorded.holdout)
        )
        check_held_out(fitted, held)
        return Given(actuator, fitted, held)
    if task.simulated is None:
        return Given(actuator, [], [])
    source = task.simulated
    fitted, held = (recorded(source, runs, actuator) for runs in (source.runs, source.holdout))
    check_held_out(fitted, held)
    return Given(actuator, fitted, held, vector(source.faults), effects_of(source.effects))


def recorded(source: Simulated, runs: Sequence[Excitation], actuator: Actuator) -> list[Measurement]:
    """Recordings of the plant; every one of a list has noise of its own."""
    plant = actuator.with_values(source.values)
    sensors, effects = Sensors(source.noise_A, source.encoder_bits), effects_of(source.effects)
    found = []
    for i, one in enumerate(runs):
        clean = simulate(run_of(one, source.load_torque_Nm), plant, vector(source.faults), effects)
        if not source.load_recorded:
            clean = replace(clean, signals={n: y for n, y in clean.signals.items() if n != "load_torque_Nm"})
        found.append(sensors.record(clean, source.noise_seed + _NEXT_NOISE * i))
    return found


def run_of(one: Excitation, load_torque_Nm: float) -> Run:
    """The run as the simulation takes it; InputError for names and values that it does not."""
    return Run(command(one.command, one.settings), one.duration_s, one.sample_rate_Hz, load_torque_Nm)


def effects_of(tables: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, float]]:
    """Settings by effect; a user's own are registered.  InputError for names and values that there are not."""
    effects = {}
    for name, table in tables.items():
        kind = kind_of(name)
        effect, numbers = (find(name), dict(table)) if kind is None else read_entries(kind, table)
        effects[effect.name] = effect.settings(numbers)
    return effects


def digest(path: str) -> str:
    """Of a recording and its side file; InputError where one is no file."""
    whole = hashlib.sha256()
    for one in filter(None, (path, find_side_file(path))):
        with open_user_file(one, "the file of a measurement") as file:
            while piece := file.read(_PIECE):
                whole.update(piece)
    return whole.hexdigest()[:16]


def _read(file: File, actuator: Actuator, mapping: Sequence[str]) -> Measurement:
    if digest(file.path) != file.digest:
        raise InputError(f"{file.path}: has changed since the campaign was planned; run it again into a new folder")
    return read(file.path, actuator, mapping)


@lru_cache(maxsize=16)
def _actuator(text: str) -> Actuator:
    return parse_actuator(text, "the campaign's actuator")
