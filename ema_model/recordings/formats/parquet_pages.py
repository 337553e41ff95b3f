"""What a Parquet file's pages unpack to, as each page's own header says, which is what its library makes room for.

The file's list of contents may say anything else, and the library asks for neither: a page of 200 kB fills gigabytes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, BinaryIO

import pyarrow.parquet as pq

_MOST_PAGES = 200_000  # of all columns: of 8 kB, the smallest that is usual, 1.6 GB
_HEADER_BYTES = (256, 65_536)  # to read: nearly always enough, and surely
_UNPACKED_SIZE, _PACKED_SIZE, _DATA, _DATA_2 = 2, 3, 5, 8  # numbers of a page header's fields
_VALUES = 1  # of the last two's
_DEEPEST = 8


class Damaged(Exception):
    """A page's header cannot be read."""


class TooMany(Exception):
    """There are more pages than can be looked at in seconds."""


def unpacked_bytes(file: BinaryIO, metadata: pq.FileMetaData, names: Sequence[str]) -> int:
    """Bytes to which the pages of these columns unpack."""
    asked, total, pages = set(names), 0, 0
    for i in range(metadata.num_row_groups):
        group = metadata.row_group(i)
        for chunk in (group.column(j) for j in range(group.num_columns)):
            if chunk.path_in_schema not in asked:
                continue
            place, values = chunk.data_page_offset, 0
            if chunk.has_dictionary_page and 0 < chunk.dictionary_page_offset < place:
                place = chunk.dictionary_page_offset
            end = place + chunk.total_compressed_size
            while 0 <= place < end and values < chunk.num_values:
                pages += 1
                if pages > _MOST_PAGES:
                    raise TooMany
                header, length = _header(file, place)
                total += _count(header, _UNPACKED_SIZE)
                place += length + _count(header, _PACKED_SIZE)
                for kind in (_DATA, _DATA_2):
                    if isinstance(header.get(kind), dict):
                        values += _count(header[kind], _VALUES)
    return total


def _count(fields: dict[int, Any], number: int) -> int:
    found = fields.get(number)
    if not isinstance(found, int) or found < 0:
        raise Damaged
    return found


def _header(file: BinaryIO, place: int) -> tuple[dict[int, Any], int]:
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
        return None, _within(raw, at + size)
    if kind == 12:
        return _fields(raw, at, depth + 1)
    raise Damaged  # lists, sets and maps are in no page's header


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
