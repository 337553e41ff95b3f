"""Parquet files, and LeRobot's datasets of them."""

from __future__ import annotations

import itertools
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.compute
import pyarrow.parquet as pq

from ema_model.errors import quoted
from ema_model.files.opened import COLUMNS, megabytes, refusal, shown
from ema_model.recordings.formats.arrow import as_numpy
from ema_model.recordings.formats.channels import MOST_COLUMNS
from ema_model.recordings.formats.format import Array, Columns, Format, check_size

# --- LeRobot's datasets, versions 2 and 3: files of episodes below `data`, and what they hold in meta/info.json -------
# A row has all joints' positions in one field; the joints' names stand in `features`. Version 2 has a file for each
# episode, version 3 several episodes in one, told apart by `episode_index` (huggingface.co/docs/lerobot; the layout is
# `DEFAULT_DATA_PATH` and `DEFAULT_FEATURES` of lerobot/datasets/utils.py).

EPISODE = "episode_index"
_INFO = os.path.join("meta", "info.json")
_FOLDERS_UP = 3  # data/chunk-000/episode_000000.parquet
_MOST_BYTES = 1_000_000


def files_in(folder: str) -> list[str]:
    """The files of a dataset's episodes, in their order; of any other folder nothing."""
    if not os.path.isfile(os.path.join(folder, _INFO)):
        return []
    return sorted(str(path) for path in Path(folder).glob("data/*/*.parquet") if path.is_file())


def has_episodes(path: str) -> bool:
    """Whether it is a file of a dataset's episodes, of one or of several."""
    return path.lower().endswith(".parquet") and EPISODE in _features(path)


def episode(index: float) -> str:
    """What a dataset calls an episode."""
    return f"episode_{int(index):06d}"


def names_of_parts(path: str) -> dict[str, list[str]]:
    """By field: what its numbers are called, of an episode of a dataset; of any other file nothing."""
    return {
        name: names
        for name, told in _features(path).items()
        if isinstance(told, dict) and (names := _flat(told.get("names")) or _counted(told.get("shape")))
    }


def _features(path: str) -> dict[str, Any]:
    folder = os.path.dirname(os.path.realpath(path))
    for _ in range(_FOLDERS_UP):
        info = os.path.join(folder, _INFO)
        if os.path.isfile(info):
            return _told(info)
        folder = os.path.dirname(folder)
    return {}


def _told(info: str) -> dict[str, Any]:
    try:
        if os.path.getsize(info) > _MOST_BYTES:
            return {}
        with open(info, "rb") as file:
            features = msgspec.json.decode(file.read())["features"]
    except (OSError, msgspec.DecodeError, RecursionError, KeyError, TypeError):
        return {}
    return features if isinstance(features, dict) else {}


def _flat(names: Any) -> list[str]:
    """Version 2.0 has them under the kind of what they name: {"motors": [...]}."""
    if isinstance(names, dict):
        names = list(itertools.chain.from_iterable(one for one in names.values() if isinstance(one, list)))
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names) or len(set(names)) < len(names):
        return []
    return names


def _counted(shape: Any) -> list[str]:
    """Numbers for parts without names, of which there are several."""
    is_row = isinstance(shape, list) and len(shape) == 1 and isinstance(shape[0], int)
    return [f"{i}" for i in range(shape[0])] if is_row and 1 < shape[0] <= MOST_COLUMNS else []


# --- what the columns of a Parquet file unpack to, by its list of contents and by each page's own header --------------
# Its library makes room for whatever a page's header says, whatever the list of contents says, so that a page of 200
# kB fills gigabytes. It also ends the whole process when asked for a damaged list's details; so both are read here.

_MOST_PAGES = 200_000  # of all columns: of 8 kB, the smallest that is usual, 1.6 GB
_HEADER_BYTES = (256, 65_536)  # to read: nearly always enough, and surely
_DEEPEST = 12
# Numbers of the fields: of the file, a row group, a column; of what is known of that; of a page's header.
_GROUPS, _COLUMNS, _ROWS, _KNOWN = 4, 1, 3, 3
_PATH, _VALUES, _PACKED, _DATA_AT, _DICTIONARY_AT = 3, 5, 7, 9, 11
_UNPACKED_SIZE, _PACKED_SIZE, _KINDS_OF_DATA, _VALUES_OF_PAGE = 2, 3, (5, 8), 1


class Damaged(Exception):
    """The list of contents, or a page's header, cannot be read."""


class TooMany(Exception):
    """There are more pages than can be looked at in seconds."""


def footer_size(file: BinaryIO) -> int:
    """Bytes of the list of contents, as the file's end says; 0 if it is not Parquet's."""
    file.seek(-min(8, file.seek(0, os.SEEK_END)), os.SEEK_END)
    end = file.read(8)
    return int.from_bytes(end[:4], "little") if end[4:] == b"PAR1" else 0


def numbers_and_bytes(file: BinaryIO, names: Sequence[str]) -> tuple[int, int]:
    """How many numbers these columns have, and how many bytes their pages unpack to."""
    numbers = unpacked = pages = 0
    for rows, column in _columns(file, {name.encode() for name in names}):
        values = _count(column, _VALUES)
        numbers += max(rows, values)
        place = _count(column, _DATA_AT)
        if _DICTIONARY_AT in column:
            place = min(place, _count(column, _DICTIONARY_AT) or place)  # some writers say 0 for none
        end = place + _count(column, _PACKED)
        while place < end and values > 0:
            pages += 1
            if pages > _MOST_PAGES:
                raise TooMany
            header, length = _page_header(file, place)
            unpacked += _count(header, _UNPACKED_SIZE)
            place += length + _count(header, _PACKED_SIZE)
            for kind in _KINDS_OF_DATA:
                if kind in header:
                    values -= _count(header[kind], _VALUES_OF_PAGE)
    return numbers, unpacked


def _columns(file: BinaryIO, asked: set[bytes]) -> Iterator[tuple[int, dict[int, Any]]]:
    """Each part of the columns: the rows of its row group, and what is known of it."""
    size = footer_size(file)
    file.seek(-min(8 + size, file.seek(0, os.SEEK_END)), os.SEEK_END)
    try:
        contents, _ = _fields(file.read(size), 0, 0)
        for group in contents.get(_GROUPS, ()):
            for column in group.get(_COLUMNS, ()):
                known = column.get(_KNOWN, {})
                if known.get(_PATH, ()) and known[_PATH][0] in asked:
                    yield _count(group, _ROWS), known
    except (IndexError, AttributeError, TypeError):
        raise Damaged from None


def _count(fields: Any, number: int) -> int:
    found = fields.get(number) if isinstance(fields, dict) else None
    if not isinstance(found, int) or found < 0:
        raise Damaged
    return found


def _page_header(file: BinaryIO, place: int) -> tuple[dict[int, Any], int]:
    """A page's header, and its length."""
    for size in _HEADER_BYTES:
        file.seek(place)
        try:
            return _fields(file.read(size), 0, 0)
        except IndexError:  # it goes on
            continue
    raise Damaged


def _fields(raw: bytes, at: int, depth: int) -> tuple[dict[int, Any], int]:
    """A struct of Thrift's compact protocol: its fields by number, and where it ends.  IndexError if that is beyond."""
    fields: dict[int, Any] = {}
    number = 0
    while tag := raw[at]:
        step, kind = tag >> 4, tag & 0xF
        at += 1
        if step:
            number += step
        else:
            number, at = _number(raw, at)
        if kind <= 2:
            fields[number] = kind == 1  # true and false have no further bytes
        else:
            fields[number], at = _value(raw, at, kind, depth)
    return fields, at + 1


def _value(raw: bytes, at: int, kind: int, depth: int) -> tuple[Any, int]:
    if depth > _DEEPEST:
        raise Damaged
    if kind == 3:
        return raw[at], at + 1
    if kind in (4, 5, 6):
        return _number(raw, at)
    if kind == 7:
        return None, _within(raw, at + 8)
    if kind == 8:
        size, at = _varint(raw, at)
        return raw[at : at + size], _within(raw, at + size)
    if kind == 9:
        return _list(raw, at, depth)
    if kind == 12:
        return _fields(raw, at, depth + 1)
    raise Damaged  # there are no sets and no maps


def _list(raw: bytes, at: int, depth: int) -> tuple[list[Any], int]:
    size, kind = raw[at] >> 4, raw[at] & 0xF
    at += 1
    if size == 15:
        size, at = _varint(raw, at)
    items = []
    for _ in range(size):
        item, at = _value(raw, at, 3 if kind <= 2 else kind, depth + 1)  # true and false take a byte here
        items.append(item)
    return items, at


def _within(raw: bytes, at: int) -> int:
    if at > len(raw):
        raise IndexError
    return at


def _number(raw: bytes, at: int) -> tuple[int, int]:
    value, at = _varint(raw, at)
    return (value >> 1) ^ -(value & 1), at


def _varint(raw: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = raw[at]
        at += 1
        value |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            return value, at
        if shift > 63:
            raise Damaged


# --- parquet: a column per signal, or one with several numbers a row --------------------------------------------------
# Parquet: a column per signal, or one with several numbers a row; ours say emaviz_schema = 1 in the metadata.

pc: Any = pyarrow.compute  # its functions are made when it is imported
_FOOTER_BYTES = 4_000_000
_BUFFER_BYTES = 1 << 20  # else a column's packed bytes are read at once
_MOST_PARTS = 2 * COLUMNS  # of any list in the footer: columns, row groups
_KEY, _VERSION = b"emaviz_schema", b"1"


def _header(path: str, max_bytes: int) -> list[str]:
    del max_bytes  # only the header is read
    with _opened(path) as file:
        version = (file.schema_arrow.metadata or {}).get(_KEY, _VERSION)
        if version != _VERSION:
            raise refusal(path, f"{_KEY.decode()} {shown(version.decode(errors='replace'))} is not known; expected 1")
        names = file.schema_arrow.names
        return list(_places(path, file.schema_arrow)) if len(set(names)) == len(names) else names


def _read(path: str, names: Sequence[str], max_bytes: int, strict: bool) -> Columns:
    with _opened(path) as file:
        schema = file.schema_arrow
        places = _places(path, schema)
        kinds = {name: _kind(schema, places[name]) for name in names}
        numeric = [name for name in names if _is_numeric(kinds[name])]
        if strict and len(numeric) < len(names):
            name = next(name for name in names if name not in numeric)
            raise refusal(
                path, f"column {quoted(name)!r} holds {shown(kinds[name])}; numbers are expected, store it as double"
            )
        fields = list(dict.fromkeys(places[name][0] for name in numeric))
        _check_contents(path, fields, file.metadata.num_rows, max_bytes)
        table = file.read(columns=fields)
    columns = dict(zip(fields, table.columns))
    del table  # each column goes when it is converted
    arrays = {}
    left = Counter(places[name][0] for name in numeric)
    for name in numeric:
        field, part = places[name]
        left[field] -= 1
        column = columns[field] if left[field] else columns.pop(field)
        if part is not None:
            column = _part(path, name, column, part)
        if not column.null_count:
            arrays[name] = as_numpy(column).astype(np.float64, copy=False)
        elif strict:
            row = np.flatnonzero(as_numpy(column.is_null()))[0]
            raise refusal(
                path, f"{_place(row)}, column {quoted(name)!r}: blank; a number is expected, fill or remove the row"
            )
    return Columns(arrays, _place)


def _places(path: str, schema: pa.Schema) -> dict[str, tuple[str, int | None]]:
    """Where each column stands: a field, or one of the numbers that a field has for each row."""
    places: dict[str, tuple[str, int | None]] = {}
    parts = names_of_parts(path)
    for field in schema:
        known = parts.get(field.name, [])
        size = len(known) if pa.types.is_list(field.type) else 0  # of another length than its rows say
        if pa.types.is_fixed_size_list(field.type):
            size = field.type.list_size
        if 0 < size <= MOST_COLUMNS:
            names = known if len(known) == size else [f"{i}" for i in range(size)]
            places |= {f"{field.name}.{name}": (field.name, i) for i, name in enumerate(names)}
        else:
            own = f".{known[0]}" if len(known) == 1 else ""
            places[f"{field.name}{own}"] = (field.name, None)
    return places


def _kind(schema: pa.Schema, place: tuple[str, int | None]) -> pa.DataType:
    kind = schema.field(place[0]).type
    return kind if place[1] is None else kind.value_type


def _part(path: str, name: str, rows: pa.ChunkedArray, part: int) -> pa.ChunkedArray:
    """One number of each row's list."""
    try:
        return pc.list_element(rows, part)
    except pa.ArrowInvalid:
        raise refusal(path, f"column {quoted(name)!r}: some rows have fewer numbers; export it again") from None


def _is_numeric(kind: pa.DataType) -> bool:
    return pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind)


def _check_contents(path: str, names: Sequence[str], rows: int, max_bytes: int) -> None:
    """Raises InputError if the columns take more than `max_bytes` in memory, or on the way there."""
    with open(path, "rb") as file:
        try:
            numbers, unpacked = numbers_and_bytes(file, names)
        except Damaged:
            raise refusal(path, "is not a whole Parquet file (its contents are damaged); export it again") from None
        except TooMany:
            raise refusal(path, "has far too many pages; export it again with pages of 1 MB") from None
    check_size(path, max(numbers, rows * len(names), unpacked / 8), max_bytes)


def _write(signals: Mapping[str, Array], path: str) -> None:
    table = pa.table(dict(signals)).replace_schema_metadata({_KEY: _VERSION})
    # An open file, so that a name with odd characters is never taken for an address.
    with open(path, "wb") as file:
        pq.write_table(table, file)


def _place(row: int) -> str:
    return f"row {row + 1}"


@contextmanager
def _opened(path: str) -> Iterator[pq.ParquetFile]:
    """The Parquet file; what its library cannot read becomes an InputError."""
    with open(path, "rb") as file:
        _check_footer(path, file)
        try:
            with pq.ParquetFile(
                file, pre_buffer=False, buffer_size=_BUFFER_BYTES, thrift_container_size_limit=_MOST_PARTS
            ) as parquet:
                yield parquet
        except (pa.ArrowException, OSError, UnicodeError) as error:
            if "size limit" in str(error):
                raise refusal(path, f"has over {COLUMNS} columns, or far too many parts; keep fewer columns") from None
            problem = f"is not a whole Parquet file ({shown(error, 80)}); export it again"
            raise refusal(path, problem) from None


def _check_footer(path: str, file: BinaryIO) -> None:
    """Raises InputError for a list of contents out of all proportion: in memory it takes many times its size."""
    size = footer_size(file)
    if size > _FOOTER_BYTES:
        found = f"lists its contents in {megabytes(size)}, over the limit of {megabytes(_FOOTER_BYTES)}"
        raise refusal(path, f"{found}; keep fewer columns, or write larger row groups")
    file.seek(0)


FORMAT = Format(".parquet", "Parquet", _header, _read, _write)
