"""A recording's side file, read and written."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any, Literal, cast

from ema_model.errors import InputError, quoted
from ema_model.files.opened import TEXT_BYTES, listed, open_user_file, reason, refusal, shown
from ema_model.files.written import change_file, inline, toml_of, toml_text
from ema_model.quantities import SIGNALS, of_name, without_unit
from ema_model.recordings.column_mapping import NUMBERS, ColumnMapping, MappedColumn, parse_mapping
from ema_model.recordings.formats.text_layout import Hints, known_encoding

# --- the side file NAME.toml beside a recording -----------------------------------------------------------------------
# The side file NAME.toml beside a recording: its actuator, mapping, sensors, sampling, window, kind and text layout.
#
# One named recordings.toml serves the recordings of its folder that have none of their own.

Kind = Literal["run", "map"]
Sampling = Literal["mean", "instantaneous"]

OF_A_FOLDER = "recordings.toml"
_KEYS = ("schema", "actuator", "kind", "sampling", "segments", "window", "rate_Hz", "text", "mapping", "sensors")
_LARGEST = 2**53  # up to which whole numbers are exact as floats
_COLUMN_KEYS = ("column", "unit", *NUMBERS)


def stated(name: str, what: str) -> str:
    """The name of a signal's accuracy: motor_speed_rad_s and noise give motor_speed_noise_rad_s."""
    unit = of_name(name)
    return "_".join([without_unit(name), what, *([unit.ending] if unit else [])])


_MEASURED = [name for name, signal in SIGNALS.items() if signal.kind not in ("time", "state")]
# What can be said of the sensors: noise (rms, white), step, and accuracy (rms, slow) of each signal, and these.
SENSOR_KEYS = (
    *(stated(name, what) for what in ("noise", "step", "accuracy") for name in _MEASURED),
    *("encoder_bits", "current_limit_A"),
)


@dataclass(frozen=True)
class SideFile:
    """What is known of a recording besides its columns; everything may be left open."""

    actuator: str | None = None  # the actuator file, as written
    kind: Kind = "run"
    sampling: Sampling | None = None  # each sample is the mean over its period, or an instant's value
    mapping: ColumnMapping | None = None
    sensors: dict[str, float] = field(default_factory=dict)  # of SENSOR_KEYS
    window_s: tuple[float, float] | None = None
    segments: tuple[int, ...] | None = None  # those to use
    text: Hints = field(default_factory=Hints)  # how the file is laid out, where another layout is found by itself
    path: str | None = None

    @property
    def actuator_path(self) -> str | None:
        """The actuator file, sought from the side file's folder."""
        if self.actuator is None or self.path is None:
            return self.actuator
        return str(Path(self.path).parent / self.actuator)


def side_path(path: str | os.PathLike[str]) -> Path:
    """Where the side file of a recording's own stands: run.csv has run.toml."""
    return Path(path).with_suffix(".toml")


def find_side_file(path: str | os.PathLike[str]) -> Path | None:
    """The side file that a recording uses: its own, else its folder's `recordings.toml`, else none."""
    own = side_path(path)
    # Whatever else has the name, a pipe as well, is for `read_side_file` to refuse.
    return next((side for side in (own, own.with_name(OF_A_FOLDER)) if side.exists() and not side.is_dir()), None)


def check_one_actuator(paths: Iterable[str | os.PathLike[str]], why: str) -> None:
    """InputError for recordings whose side files name different actuators; why: what they have in common."""
    known = list(actuators_of(paths).items())
    if len(known) > 1:
        (one, first), (other, second) = known[:2]
        raise InputError(
            f"{quoted(second.name)}: is of the actuator {quoted(other)}, and {quoted(first.name)} of {quoted(one)}; "
            f"{why}"
        )


def actuators_of(paths: Iterable[str | os.PathLike[str]]) -> dict[str, Path]:
    """The actuators that recordings' side files name, with the first recording of each, in their order."""
    found: dict[str, Path] = {}
    for path in paths:
        beside = find_side_file(path)
        actuator = read_side_file(beside).actuator if beside else None
        if actuator is not None:
            found.setdefault(actuator, Path(path))
    return found


def read_side_file(path: str | os.PathLike[str]) -> SideFile:
    """The side file itself; raises InputError, one line, for whatever is wrong in it."""
    path = os.fspath(path)
    try:
        with open_user_file(path, "the side file of a recording", TEXT_BYTES) as file:
            text = file.read().decode("utf-8")
    except InputError:
        raise
    except UnicodeDecodeError:
        raise refusal(path, "is not text in UTF-8; save it as UTF-8") from None
    except OSError as error:
        raise refusal(path, f"cannot be read ({reason(error)}); check the name and the permissions") from None
    return parse_side_file(text, path)


def parse_side_file(text: str, path: str) -> SideFile:
    """The side file of a text, which stands at the path; InputError, one line, for whatever is wrong in it."""
    try:
        return _parsed(path, toml_of(text))
    except InputError:
        raise
    except ValueError as error:
        raise refusal(path, f"is not valid TOML: {shown(error, 120)}; correct it") from None


def _parsed(path: str, document: dict[str, Any]) -> SideFile:
    _check_keys(path, "", document, _KEYS)
    if document.get("schema", 1) != 1:
        raise refusal(path, f"schema {shown(document['schema'])} is not known; write schema = 1")
    actuator = document.get("actuator")
    if actuator is not None:
        _check_actuator(path, actuator)
    kind = _one_of(path, "kind", document.get("kind", "run"), ("run", "map"))
    sampling = document.get("sampling")
    if sampling is not None:
        sampling = _one_of(path, "sampling", sampling, ("mean", "instantaneous"))
    sensors = _table(path, document, "sensors")
    _check_keys(path, "[sensors] ", sensors, SENSOR_KEYS)
    accuracy = {name: _number(path, f"[sensors] {name}", value, least=0.0) for name, value in sensors.items()}
    return SideFile(
        actuator,
        cast(Kind, kind),
        cast("Sampling | None", sampling),
        _mapping(path, _table(path, document, "mapping")),
        accuracy,
        _window(path, document),
        _segments(path, document),
        replace(_text(path, _table(path, document, "text")), rate_Hz=_rate(path, document)),
        path,
    )


def _check_actuator(path: str, given: object) -> None:
    """A side file comes with data from elsewhere: it may name actuator files near it, and no other files at all."""
    if not isinstance(given, str) or not given.isprintable() or not given.endswith(".toml"):
        raise refusal(path, f"actuator must be the name of an actuator file (.toml), not {shown(given)!r}")
    if PurePosixPath(given).is_absolute() or PureWindowsPath(given).drive:
        raise refusal(path, f"actuator {shown(given, 100)!r} must be given from the side file's folder")


def _mapping(path: str, table: dict[str, Any]) -> ColumnMapping | None:
    entries = tuple(_entry(path, signal, given) for signal, given in table.items())
    return ColumnMapping(entries) if entries else None


def _entry(path: str, signal: str, given: object) -> MappedColumn:
    """`signal = "column[unit]"`, or a table with the column and what else is to be said of it."""
    where = f"[mapping] {shown(signal)}"
    fields: dict[str, Any] = {}
    if isinstance(given, dict):
        _check_keys(path, f"{where}: ", given, _COLUMN_KEYS)
        fields = {name: _number(path, f"{where} {name}", given[name]) for name in NUMBERS if name in given}
        for name in ("column", "unit"):
            fields[name] = given.get(name, "")
            if not isinstance(fields[name], str):
                raise refusal(path, f"{where}: {name} must be text, not {shown(fields[name])}")
    elif not isinstance(given, str):
        raise refusal(path, f"{where}: a column's name or a table is expected, not {shown(given)}")
    if fields.get("sign") in (1.0, -1.0):
        fields["sign"] = int(fields["sign"])
    try:
        return MappedColumn(signal, **fields) if fields else parse_mapping([f"{signal}={given}"]).entries[0]
    except InputError as error:
        raise refusal(path, str(error)) from None


def _window(path: str, document: dict[str, Any]) -> tuple[float, float] | None:
    table = _table(path, document, "window")
    if not table:
        return None
    _check_keys(path, "[window] ", table, ("from_s", "to_s"))
    start = _number(path, "[window] from_s", table.get("from_s", -math.inf), endless=True)
    stop = _number(path, "[window] to_s", table.get("to_s", math.inf), endless=True)
    if not start < stop:
        raise refusal(path, f"[window] from_s ({start:g}) must be before to_s ({stop:g})")
    return start, stop


def _segments(path: str, document: dict[str, Any]) -> tuple[int, ...] | None:
    given = document.get("segments")
    if given is None:
        return None
    if (
        not isinstance(given, list)
        or not given
        or any(type(number) is not int or abs(number) > _LARGEST for number in given)
    ):
        raise refusal(path, f"segments must be a list of whole numbers, e.g. [0, 1, 4], not {shown(given)}")
    return tuple(given)


def _rate(path: str, document: dict[str, Any]) -> float | None:
    given = document.get("rate_Hz")
    rate = None if given is None else _number(path, "rate_Hz", given, least=0.0)
    if rate == 0.0:
        raise refusal(path, "rate_Hz must be a number above 0")
    return rate


def _text(path: str, table: dict[str, Any]) -> Hints:
    _check_keys(path, "[text] ", table, ("header_line", "encoding"))
    line, encoding = table.get("header_line"), table.get("encoding")
    if line is not None and (type(line) is not int or not 0 < line <= _LARGEST):
        raise refusal(path, f"[text] header_line must be the number of a line, from 1 on, not {shown(line)}")
    if encoding is not None:
        try:
            encoding = known_encoding(encoding)
        except (TypeError, ValueError):
            raise refusal(path, f"[text] encoding {shown(encoding)!r} is none; write utf-8, cp1252 or utf-16") from None
    return Hints(line, encoding)


def _table(path: str, document: dict[str, Any], name: str) -> dict[str, Any]:
    table = document.get(name, {})
    if not isinstance(table, dict):
        raise refusal(path, f"{name} must be a table; write [{name}] above its entries")
    return table


def _check_keys(path: str, where: str, given: dict[str, Any], known: tuple[str, ...]) -> None:
    for key in given:
        if key not in known:
            raise refusal(path, f"{where}unknown entry {shown(key)!r}; correct or remove it (known: {listed(known)})")


def _one_of(path: str, name: str, value: object, known: tuple[str, ...]) -> str:
    if not isinstance(value, str) or value not in known:
        raise refusal(path, f"{name} must be {' or '.join(json.dumps(word) for word in known)}, not {shown(value)!r}")
    return value


def _number(path: str, name: str, value: object, least: float = -math.inf, endless: bool = False) -> float:
    if isinstance(value, int) and abs(value) > _LARGEST:
        raise refusal(path, f"{name} must be below 2⁵³ in size, or written with a decimal point")
    if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value) or value < least:
        raise refusal(path, f"{name} must be a number{' of 0 or more' * (least == 0.0)}, not {shown(value)!r}")
    if math.isinf(value) and not endless:
        raise refusal(path, f"{name} must be finite; leave it out if it is not known")
    return float(value)


# --- writes a side file, over the one that is there: comments and order stay ------------------------------------------


def write_side_file(side: SideFile, path: str | os.PathLike[str]) -> None:
    """Writes the side file, whole or not at all, in place of an older one.  Raises InputError if it cannot."""

    def changed(text: str) -> str:
        try:
            return _over(text, side, parse_side_file(text, os.fspath(path)))
        except InputError:  # what it replaces is none
            return _over("", side, SideFile())

    _change(path, changed)


def change_side_file(path: str | os.PathLike[str], otherwise: SideFile, **said: Any) -> None:
    """Writes what is said now into the side file as it is now, which another may have changed in the meantime.

    otherwise: what it says besides where there is none yet.  Raises InputError if it cannot, or the file is none.
    """

    def changed(text: str) -> str:
        known = parse_side_file(text, os.fspath(path))
        return _over(text, replace(known if text else otherwise, **said), known)

    _change(path, changed)


def _change(path: str | os.PathLike[str], change: Callable[[str], str]) -> None:
    try:
        change_file(path, change, TEXT_BYTES)
    except OSError as error:
        raise refusal(path, f"cannot be written ({reason(error)}); check the disk and the permissions") from None


def _over(text: str, side: SideFile, known: SideFile) -> str:
    """The file's text; `known`, which the older text says, keeps its spelling."""
    window = dict(zip(("from_s", "to_s"), side.window_s or ()))
    spelt = toml_of(text).get("mapping", {})
    same = known.mapping.entries if known.mapping else ()
    entries = side.mapping.entries if side.mapping else ()
    tables = {
        "window": {name: value for name, value in window.items() if math.isfinite(value)},
        "text": _given(header_line=side.text.header_line, encoding=side.text.encoding),
        "sensors": side.sensors,
        "mapping": {one.signal: inline(spelt[one.signal]) if one in same else _column(one) for one in entries},
    }
    document = {
        **_given(schema=1, kind=side.kind, actuator=side.actuator, sampling=side.sampling),
        **_given(segments=None if side.segments is None else list(side.segments), rate_Hz=side.text.rate_Hz),
        **{name: table for name, table in tables.items() if table},
    }
    return toml_text(document, text)


def _given(**said: Any) -> dict[str, Any]:
    return {name: inline(value) for name, value in said.items() if value is not None}


def _column(entry: MappedColumn) -> Any:
    """One entry on a line, in which any column's name can stand."""
    unit = {"unit": entry.unit} if entry.unit else {}
    return inline({"column": entry.column, **unit, **entry.numbers})
