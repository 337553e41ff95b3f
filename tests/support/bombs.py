"""Files that are small, or large, and would take far more memory or time than a reader may; each for a given limit."""

from __future__ import annotations

import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ema_model.recordings import Measurement, write_measurement
from support import parquet_by_hand as by_hand

k = np.arange(120.0)
INDICES = bytes([8, 31]) + bytes(range(120))  # of a data page: 120 of 8 bits each


def npy(values: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, values)
    return file.getvalue()


def long_header(size: int) -> bytes:
    """An array whose header is so long."""
    return b"\x93NUMPY\2\0" + struct.pack("<I", size) + b" " * size


def zipped(path: Path, members: dict[str, bytes | int], way: int = zipfile.ZIP_DEFLATED) -> None:
    """A zip; a number is so many zeros, written piece by piece."""
    with zipfile.ZipFile(path, "w", way) as archive:
        for name, content in members.items():
            with archive.open(name, "w", force_zip64=True) as file:
                if isinstance(content, bytes):
                    file.write(content)
                else:
                    for _ in range(content >> 20):
                        file.write(bytes(1 << 20))


def npz(path: Path, numbers: int, way: int = zipfile.ZIP_DEFLATED) -> None:
    """Two arrays of so many zeros."""
    array = (
        npy(np.zeros(0)).replace(b"(0,),", b"(%d,)," % numbers).replace(b" " * (len(str(numbers)) - 1) + b"\n", b"\n")
    )
    with zipfile.ZipFile(path, "w", way) as archive:
        for name in ("time_s", "current_A"):
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                file.write(array)
                for _ in range(numbers >> 17):
                    file.write(bytes(1 << 20))


def shrunk(path: Path) -> None:
    """The zip with tiny sizes declared for its members."""
    raw = bytearray(path.read_bytes())
    at = raw.find(b"PK\1\2")
    while at >= 0:
        raw[at + 24 : at + 28] = struct.pack("<I", 500)
        at = raw.find(b"PK\1\2", at + 4)
    path.write_bytes(raw)


def shared(path: Path, members: int, size: int) -> None:
    """A zip whose members are all the same bytes, packed without any content, so that reading them gives nothing."""
    zipped(path, {"a.npy": bytes(8)}, zipfile.ZIP_STORED)
    empty = b"\0\0\0\xff\xff" * (size // 5)  # deflate's blocks of nothing
    local = struct.pack("<4sHHHHHIIIHH", b"PK\3\4", 20, 0, 8, 0, 33, 0, len(empty), 999, 5, 0)
    entry = b"".join(
        struct.pack("<4sHHHHHHIIIHHHHHII", b"PK\1\2", 20, 20, 0, 8, 0, 33, 0, len(empty), 999, 9, 0, 0, 0, 0, 0, 0)
        + b"%05d.npy" % i
        for i in range(members)
    )
    end = struct.pack("<4sHHHHIIH", b"PK\5\6", 0, 0, members, members, len(entry), len(local) + 5 + len(empty), 0)
    path.write_bytes(local + b"a.npy" + empty + entry + end)


def element(kind: int, content: bytes) -> bytes:
    return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)


def mat(path: Path, *parts: bytes) -> None:
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM" + b"".join(parts))


def packed(pieces: Iterable[bytes], after: int = 0) -> bytes:
    """A packed element, and so many bytes that belong to it after its end."""
    packer = zlib.compressobj(9)
    content = b"".join([*(packer.compress(piece) for piece in pieces), packer.flush()]) + bytes(after)
    return struct.pack("<II", 15, len(content)) + content


def matrix(name: bytes, rest: bytes, kind: int = 6, shape: bytes = struct.pack("<ii", 120, 1)) -> bytes:
    inside = element(6, struct.pack("<II", kind, 0)) + element(5, shape) + element(1, name) + rest
    return element(14, inside)


def struct_of(name: bytes, fields: int, field: bytes) -> bytes:
    """A struct of so many fields, each the same array."""
    names = element(5, struct.pack("<i", 4)) + element(1, b"abc\0" * fields)
    return matrix(name, names + field * fields, 2, struct.pack("<ii", 1, 1))


def lines(path: Path, header: str, row: str, size: int, last: str = "") -> None:
    """A CSV of one row over and over."""
    block = row.encode() * (1_000_000 // len(row))
    with path.open("wb") as file:
        file.write(header.encode() + b"\n")
        for _ in range(size // len(block)):
            file.write(block)
        file.write(last.encode())


def by_library(path: Path, **columns: object) -> None:
    pq.write_table(pa.table(columns), path, row_group_size=1 << 26)


def dictionary(values: np.ndarray = k, more: int = 0, after: int = 0) -> list[bytes]:
    """A column's pages: `more` bytes of dictionary that nothing uses, `after` bytes that follow its indices."""
    kept = values.tobytes() + bytes(more)
    first = by_hand.page(by_hand.DICTIONARY_PAGE, kept, len(kept) // 8)
    return [first, by_hand.page(by_hand.DATA_PAGE, INDICES + bytes(after), 120)]


def parquet(path: Path, rows: int = 120, told: int | None = None, **more: int) -> None:
    columns = {"time_s": dictionary(k / 1e3), "current_A": dictionary(**more)}
    path.write_bytes(by_hand.parquet(columns, rows, told))


def other_schema(path: Path) -> None:
    """A column that may be blank in the pages, and may not in the schema: one bit."""
    by_library(path, time_s=k, current_A=k)
    content = path.read_bytes()
    changed = content.replace(b"\x25\x02\x18\x09current_A", b"\x25\x00\x18\x09current_A", 1)
    assert changed != content
    path.write_bytes(changed)


def largest(path: Path, limit: int) -> None:
    """A whole measurement, of two columns, as large as may be."""
    time = np.arange(limit // 17) / 1e3
    write_measurement(Measurement({"time_s": time, "current_A": np.round(np.sin(time), 3)}), path)


def largest_csv(path: Path, limit: int) -> None:
    """The same in text, whose numbers take four fifths of it."""
    with path.open("wb") as file:
        file.write(b"time_s,current_A\n")
        for start in range(0, limit // 22, 10_000):
            file.write(b"".join(b"%010d,%.6f\n" % (i, i / 1e9) for i in range(start, start + 10_000)))


def session(path: Path, document: bytes, members: dict[str, bytes | int], way: int = zipfile.ZIP_DEFLATED) -> None:
    zipped(path, {"session.json": document, **members}, way)


LISTED = json.dumps({"schema": 1, "files": [f"uploads/{i}.csv" for i in range(9)]}).encode()
ROW = "0.0010000000,1.2345678901\n"
Write = Callable[[Path, int], object]  # the file, the limit in bytes

# name: the reader, how it is written, and what the refusal must say; "" where it is read
BOMBS: dict[str, tuple[str, Write, str]] = {
    "csv of a wrong last row": ("csv", lambda p, n: lines(p, "time_s,current_A", ROW, n * 9 // 10, "1,x\n"), "line "),
    "csv of a late NaN": ("csv", lambda p, n: lines(p, "time_s,current_A", ROW, n * 9 // 10, "1,nan\n"), "NaN"),
    "csv of one line": ("csv", lambda p, n: lines(p, "time_s,current_A", "1", n * 9 // 10), "line 2 is over 1 MB long"),
    "csv of one line of cells": ("csv", lambda p, n: lines(p, "time_s,current_A", "1,", n * 9 // 10), "line 2 is over"),
    "csv of short cells": ("csv", lambda p, n: lines(p, "time_s,current_A", "1,2\n", n * 9 // 10), "unpacks to"),
    "csv of blank cells": ("csv", lambda p, n: lines(p, "time_s,current_A", ",\r", n * 9 // 10), "unpacks to"),
    "csv of blank lines": ("csv", lambda p, n: lines(p, "time_s,current_A", "\n", n // 9), "0 samples"),
    "csv of words": (
        "csv",
        lambda p, n: lines(p, ",".join(f"c{i}" for i in range(500)), "0123456789," * 499 + "x\n", n // 2),
        "time_s",
    ),
    "csv of a million columns": (
        "csv",
        lambda p, n: Path.write_bytes(p, b",".join(b"c%d" % i for i in range(10**6))),
        "over 64 kB",
    ),
    "csv of many columns": (
        "csv",
        lambda p, n: Path.write_bytes(p, b",".join(b"c%x" % i for i in range(9_000)) + b"\n1"),
        "limit of 2000",
    ),
    "csv of runs": (
        "csv",
        lambda p, n: lines(p, "time_s,segment", "000000.001,0000001\n000000.002,0000002\n", n // 2),
        "runs apart",
    ),
    "parquet of zeros": (
        "parquet",
        lambda p, n: by_library(p, time_s=np.zeros(n // 8), duty=np.zeros(n // 8)),
        "unpacks to",
    ),
    "parquet of lists": (
        "parquet",
        lambda p, n: by_library(p, time_s=k, duty=[[0.0] * (n // 8000)] * 120),
        "holds list",
    ),
    "parquet of one word": (
        "parquet",
        lambda p, n: by_library(p, time_s=k, duty=["x" * (n // 9)] * 120),
        "holds string",
    ),
    "parquet of many columns": (
        "parquet",
        lambda p, n: by_library(p, **{f"c{i}": k for i in range(20_000)}),
        "over 2000 columns",
    ),
    "parquet of deep columns": (
        "parquet",
        lambda p, n: Path.write_bytes(p, by_hand.nested(3_000)),
        "too deeply nested",
    ),
    "parquet of deepest columns": ("parquet", lambda p, n: Path.write_bytes(p, by_hand.nested(1_000_000)), ""),
    "parquet of rows only declared": ("parquet", lambda p, n: parquet(p, n), "unpacks to"),
    "parquet of rows declared elsewhere": ("parquet", lambda p, n: parquet(p, n, 120), "unpacks to"),
    "parquet of a vast dictionary": ("parquet", lambda p, n: parquet(p, more=3 * n), "unpacks to"),
    "parquet of a vast page": ("parquet", lambda p, n: parquet(p, after=3 * n), "unpacks to"),
    "parquet of a schema unlike its pages": ("parquet", lambda p, n: other_schema(p), "not a whole Parquet file"),
    "npz by bzip2": ("npz", lambda p, n: npz(p, n // 4, zipfile.ZIP_BZIP2), "packed by bzip2"),
    "npz by LZMA": ("npz", lambda p, n: npz(p, n // 4, zipfile.ZIP_LZMA), "packed by LZMA"),
    "npz of zeros": ("npz", lambda p, n: npz(p, n // 4), "unpacks to"),
    "npz of zeros, told small": ("npz", lambda p, n: (npz(p, n // 4), shrunk(p)), "Bad CRC-32"),
    "npz of a vast shape": (
        "npz",
        lambda p, n: zipped(p, {"time_s.npy": npy(k).replace(b"(120,), }" + b" " * 8, b"(90000000000,), }")}),
        "unpacks to",
    ),
    "npz of objects": (
        "npz",
        lambda p, n: zipped(p, {"time_s.npy": npy(k).replace(b"'<f8'", b"'|O' ")}),
        "holds objects",
    ),
    "npz of digits": (
        "npz",
        lambda p, n: zipped(p, {"time_s.npy": npy(k).replace(b"(120,), }" + b" " * 50, b"(" + b"9" * 53 + b",), }")}),
        "not a whole",
    ),
    "npz of a long header": ("npz", lambda p, n: zipped(p, {"time_s.npy": long_header(2 * n)}), "not a whole"),
    "npz of many arrays": (
        "npz",
        lambda p, n: zipped(p, {f"{i}.npy": b"" for i in range(20_000)}),
        "over the limit of 10000",
    ),
    "npz of a vast directory": (
        "npz",
        lambda p, n: zipped(p, {f"{i:0200}.npy": b"" for i in range(20_000)}),
        "directory is too large",
    ),
    "npz of shared bytes": ("npz", lambda p, n: shared(p, 9_000, n // 2), "overlap"),
    "mat of zeros": ("packed mat", lambda p, n: mat(p, packed([bytes(1 << 20)] * (2 * n >> 20))), "unpacks to over"),
    "mat of many elements": ("mat", lambda p, n: mat(p, element(1, b"") * (n // 16)), "over 10000 arrays"),
    "mat of many fields": (
        "packed mat",
        lambda p, n: mat(p, packed([struct_of(b"x", n // 40, element(14, b""))])),
        "over 10000 arrays",
    ),
    "mat of empty structs": (
        "packed mat",
        lambda p, n: mat(p, packed([struct_of(b"x", n // 200, struct_of(b"", 0, b""))])),
        "over 10000 arrays",
    ),
    "mat of many dimensions": (
        "packed mat",
        lambda p, n: mat(p, packed([matrix(b"x", b"", 6, bytes(n // 4 * 3))])),
        "no shape",
    ),
    "mat of a long name": (
        "packed mat",
        lambda p, n: mat(p, packed([matrix(b"x" * (n // 2), element(9, k.tobytes()))])),
        "name is too long",
    ),
    "mat of a long end": (
        "packed mat",
        lambda p, n: mat(p, packed([matrix(b"time_s", element(9, k.tobytes()))], n // 2)),
        "",
    ),
    "csv as large as may be": ("csv", largest_csv, ""),
    "parquet as large as may be": ("parquet", largest, ""),
    "npz as large as may be": ("npz", largest, ""),
    "mat as large as may be": ("mat", largest, ""),
    "side file of deep keys": (
        "side file",
        lambda p, n: Path.write_bytes(p, b"a" + b".a" * 49_000 + b"=1"),
        "more than 30 parts",
    ),
    "side file of deep lists": (
        "side file",
        lambda p, n: Path.write_bytes(p, b"x=" + b"[" * 50_000),
        "nested too deeply",
    ),
    "side file of digits": ("side file", lambda p, n: Path.write_bytes(p, b"x=" + b"1" * 90_000), "too many digits"),
    "side file, large": ("side file", lambda p, n: Path.write_bytes(p, b"# x\n" * (n // 8)), "limit of 0.1 MB"),
    "actuator of deep keys": (
        "actuator",
        lambda p, n: Path.write_bytes(p, b"a" + b".a" * 49_000 + b"=1"),
        "more than 30 parts",
    ),
    "actuator of digits": ("actuator", lambda p, n: Path.write_bytes(p, b"x=" + b"1" * 90_000), "too many digits"),
    "actuator of hexadecimal digits": (
        "actuator",
        lambda p, n: Path.write_bytes(p, b"schema=0x" + b"f" * 90_000),
        "too many digits",
    ),
    "actuator, large": ("actuator", lambda p, n: Path.write_bytes(p, b"# x\n" * (n // 8)), "limit of 0.1 MB"),
    "session by bzip2": (
        "session",
        lambda p, n: session(p, LISTED, {"files/uploads/0.csv": 4 * n}, zipfile.ZIP_BZIP2),
        "packed by bzip2",
    ),
    "session of zeros": (
        "session",
        lambda p, n: session(p, LISTED, {f"files/uploads/{i}.csv": 120_000_000 for i in range(9)}),
        "unpacks to over 500 MB",
    ),
    "session of settings": ("session", lambda p, n: zipped(p, {"session.json": 20_000_000}), "over 8 MB"),
    "session of lists": (
        "session",
        lambda p, n: session(p, b'{"schema": 1, "settings": [' + b"[]," * 2_500_000 + b"0]}", {}),
        "settings",
    ),
    "session of deep lists": ("session", lambda p, n: session(p, b"[" * 5_000_000, {}), "no session"),
    "session of many files": (
        "session",
        lambda p, n: session(p, LISTED, {f"{i}": b"" for i in range(2_000)}),
        "limit of 200",
    ),
    "challenge by bzip2": (
        "challenge",
        lambda p, n: zipped(p, {"hidden": 4 * n}, zipfile.ZIP_BZIP2),
        "packed by bzip2",
    ),
    "challenge of zeros": ("challenge", lambda p, n: zipped(p, {"hidden": 64_000_000}), "unpacks to over 32 MB"),
    "challenge of deep lists": ("challenge", lambda p, n: zipped(p, {"seal.json": b"[" * 5_000_000}), "RecursionError"),
}

# Those that take a second and more to make or to refuse.
SLOW = {
    "session of zeros",
    "session of lists",
    "csv of a wrong last row",
    "csv of a late NaN",
    "parquet of many columns",
}
