"""What a session's file holds of Units: what is chosen, and the answer as it was found: nothing is run again."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np

from ema_model.actuator import parse_actuator
from ema_model.actuator.write import as_toml
from ema_model.errors import InputError
from ema_model.estimation.problem import SIGNALS
from ema_model.units.result import Alone, Difference, Need, OfRecording, OfType, Transfer, UnitsCompared
from emaviz.session.described import taken

_PART = "part of Units"
_Rows = tuple[tuple[float, ...], ...]


class SavedAnswer(msgspec.Struct, frozen=True):
    """`UnitsCompared` in what JSON can hold; actuators as their files' text."""

    actuator: str
    type_actuator: str
    units: tuple[str, ...]
    recordings: tuple[tuple[str, ...], ...]
    held_out: tuple[tuple[str, ...], ...]
    differences: tuple[Difference, ...]
    dropped: tuple[Difference, ...]
    of_type: dict[str, OfType]
    alone: dict[str, _Rows]  # values and their σ, of each unit
    signal: str
    transfer: _Rows
    transfer_floors: _Rows
    floor: tuple[float, ...]
    needs: tuple[Need, ...]
    errors: tuple[float, ...]
    warnings: tuple[str, ...]
    of_recordings: tuple[OfRecording, ...] = ()


class SavedUnits(msgspec.Struct, frozen=True):
    """What is chosen, and the answer if there is one."""

    folder: str
    rule: str
    actuator: str  # its name in the list
    answer: SavedAnswer | None = None


def saved(folder: str, rule: str, actuator: str, found: UnitsCompared | None) -> dict[str, Any]:
    """In what JSON can hold."""
    return msgspec.to_builtins(SavedUnits(folder, rule, actuator, None if found is None else _answer(found)))


def read(given: Any) -> tuple[SavedUnits, UnitsCompared | None]:
    """What `saved` gave; InputError for what makes no sense."""
    told: SavedUnits = taken(SavedUnits, given, _PART)
    return told, None if told.answer is None else _found(told.answer)


def _answer(found: UnitsCompared) -> SavedAnswer:
    return SavedAnswer(
        actuator=as_toml(found.actuator),
        type_actuator=as_toml(found.type_actuator),
        units=found.units,
        recordings=found.recordings,
        held_out=found.held_out,
        differences=found.differences,
        dropped=found.dropped,
        of_recordings=found.of_recordings,
        of_type=found.of_type,
        alone={path: (_row(one.value), _row(one.sigma)) for path, one in found.alone.items()},
        signal=found.transfer.signal,
        transfer=_rows(found.transfer.error),
        transfer_floors=_rows(found.transfer.floors),
        floor=_row(found.transfer.floor),
        needs=found.needs,
        errors=_row(found.errors),
        warnings=found.warnings,
    )


def _found(one: SavedAnswer) -> UnitsCompared:
    actuator, count = parse_actuator(one.actuator, "the session's actuator"), len(one.units)
    named = {path for path in (*one.of_type, *one.alone)}
    told = [*one.differences, *one.dropped]
    fits = (
        count > 1
        and len(one.recordings) == len(one.held_out) == count
        and named == {*one.of_type} == {*one.alone} <= {*actuator.tolerances}
        and {path for each in told for path in each.together} | {each.parameter for each in one.needs} <= named
        and {each.unit for each in (*told, *one.needs, *one.of_recordings)} <= {*one.units}
        and one.signal in SIGNALS
    )
    if not fits:
        raise InputError(f"the session's {_PART} is damaged (its parts do not fit each other); save it anew")
    alone = {path: Alone(*_array(rows, (2, count))) for path, rows in one.alone.items()}
    square = (count, count)
    return UnitsCompared(
        actuator=actuator,
        units=one.units,
        recordings=one.recordings,
        held_out=one.held_out,
        differences=one.differences,
        dropped=one.dropped,
        of_recordings=one.of_recordings,
        of_type=one.of_type,
        alone=alone,
        transfer=Transfer(
            one.signal,
            _array(one.transfer, square),
            _array(one.floor, (count,)),
            _array(one.transfer_floors, square),
        ),
        needs=one.needs,
        errors=_array(one.errors, (count,)),
        type_actuator=parse_actuator(one.type_actuator, "the session's type"),
        warnings=one.warnings,
    )


def _array(rows: Any, shape: tuple[int, ...]) -> np.ndarray:
    try:
        found = np.array(rows, dtype=float)
    except ValueError:
        found = np.zeros(0)
    if found.shape != shape or not np.all(np.isfinite(found)):
        raise InputError(f"the session's {_PART} is damaged (numbers lack in it); save it anew")
    return found


def _row(values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(one) for one in values)


def _rows(values: np.ndarray) -> _Rows:
    return tuple(_row(one) for one in values)
