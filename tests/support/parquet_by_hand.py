"""Parquet files that no library writes: their lists of contents say one thing, their pages hold another."""

from __future__ import annotations

import struct
import zlib

DATA_PAGE, DICTIONARY_PAGE = 0, 2
_GZIP, _PLAIN, _DICTIONARY = 2, 0, 8


def page(kind: int, content: bytes, values: int) -> bytes:
    """A page of doubles, packed; in a data page `content` are indices into the dictionary."""
    packer = zlib.compressobj(9, wbits=31)
    packed = packer.compress(content) + packer.flush()
    if kind == DICTIONARY_PAGE:
        own = _struct(4, _i32(1, values) + _i32(1, _PLAIN))
    else:
        own = _struct(2, _i32(1, values) + _i32(1, _DICTIONARY) + _i32(1, 3) + _i32(1, 3))
    return _i32(1, kind) + _i32(1, len(content)) + _i32(1, len(packed)) + own + b"\0" + packed


def parquet(pages: dict[str, list[bytes]], rows: int, told: int | None = None) -> bytes:
    """A file of one row group, each column a dictionary page and data pages; `told`: rows that the file declares."""
    body, columns = b"PAR1", []
    for name, (dictionary, *data) in pages.items():
        start, length = len(body), len(dictionary) + sum(map(len, data))
        body += dictionary + b"".join(data)
        meta = _i32(1, 5) + _list(1, 5, [_zigzag(_DICTIONARY)]) + _list(1, 8, [_text(name)]) + _i32(1, _GZIP)
        meta += _i64(1, rows) + _i64(1, 1000) + _i64(1, length) + _i64(2, start + len(dictionary)) + _i64(2, start)
        columns.append(_i64(2, start) + _struct(1, meta) + b"\0")
    group = _list(1, 12, columns) + _i64(1, 1000) + _i64(1, rows) + b"\0"
    schema = [_root(len(pages)), *(leaf(name) for name in pages)]
    return _file(body, schema, rows if told is None else told, [group])


def nested(depth: int) -> bytes:
    """A file of no rows whose one column lies so deep."""
    groups = [_i32(3, 1) + _string(1, "g") + _i32(1, 1) + b"\0"] * depth
    return _file(b"PAR1", [_root(1), *groups, leaf("time_s")], 0, [])


def wide(columns: int) -> bytes:
    """A file of no rows and so many columns."""
    return _file(b"PAR1", [_root(columns), *(leaf(f"c{i}") for i in range(columns))], 0, [])


def leaf(name: str) -> bytes:
    """A column of doubles in the schema."""
    return _i32(1, 5) + _i32(2, 0) + _string(1, name) + b"\0"


def _root(columns: int) -> bytes:
    return _string(4, "schema") + _i32(1, columns) + b"\0"


def _file(body: bytes, schema: list[bytes], rows: int, groups: list[bytes]) -> bytes:
    footer = _i32(1, 1) + _list(1, 12, schema) + _i64(1, rows) + _list(1, 12, groups) + b"\0"
    return body + footer + struct.pack("<I", len(footer)) + b"PAR1"


# --- Thrift's compact protocol: a field is its distance from the last one's number, its type, its value


def _varint(value: int) -> bytes:
    out = b""
    while value > 0x7F:
        out += bytes([value & 0x7F | 0x80])
        value >>= 7
    return out + bytes([value])


def _zigzag(value: int) -> bytes:
    return _varint(value << 1)


def _i32(step: int, value: int) -> bytes:
    return bytes([step << 4 | 5]) + _zigzag(value)


def _i64(step: int, value: int) -> bytes:
    return bytes([step << 4 | 6]) + _zigzag(value)


def _text(text: str) -> bytes:
    return _varint(len(text)) + text.encode()


def _string(step: int, text: str) -> bytes:
    return bytes([step << 4 | 8]) + _text(text)


def _struct(step: int, fields: bytes) -> bytes:
    return bytes([step << 4 | 12]) + fields + b"\0"


def _list(step: int, kind: int, items: list[bytes]) -> bytes:
    head = bytes([len(items) << 4 | kind]) if len(items) < 15 else bytes([0xF0 | kind]) + _varint(len(items))
    return bytes([step << 4 | 9]) + head + b"".join(items)
