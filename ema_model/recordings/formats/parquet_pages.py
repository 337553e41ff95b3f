"""What the columns of a Parquet file unpack to, by its list of contents and by each page's own header.

Its library makes room for whatever a page's header says, whatever the list of contents says, so that a page of 200 kB
fills gigabytes.  It also ends the whole process when asked for a damaged list's details; so both are read here.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from typing import Any, BinaryIO

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
