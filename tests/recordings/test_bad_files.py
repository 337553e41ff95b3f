"""Every kind of bad file, of every format: one line that has the file's name, what is wrong and what to do."""

from __future__ import annotations

import gzip
import io
import json
import struct
import zipfile
import zlib

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat
from scipy.sparse import csc_matrix

from ema_model.errors import InputError
from ema_model.recordings import read_columns
from ema_model.recordings.read import read_measurement

N = 120
LIMIT = 10_000_000  # bytes
k = np.arange(float(N))
GOOD = {"time_s": k / 1e3, "current_A": k}
ADVICE = (
    "expected record check correct export save split store write name map rename remove sort cut choose fill add take "
    "leave must widen pack".split()
)


def but(at, value, values=k):
    """The values with another one at an index."""
    changed = np.array(values, float)
    changed[at] = value
    return changed


def text(header="time_s,current_A", **lines):
    rows = [header, *(f"{i / 1000},{i}" for i in range(N))]
    for number, line in lines.items():
        rows[int(number.removeprefix("line_")) - 1] = line
    return ("\n".join(rows) + "\n").encode()


def npz(**arrays):
    file = io.BytesIO()
    np.savez(file, allow_pickle=True, **GOOD | arrays)
    return file.getvalue()


def zipped(compression=zipfile.ZIP_STORED, **members):
    """An archive with these members, given as bytes, beside the good ones."""
    good = {f"{name}.npy": npy(values) for name, values in GOOD.items()}
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", compression) as archive:
        for name, content in (good | members).items():
            archive.writestr(name, content)
    return file.getvalue()


def npy(values):
    file = io.BytesIO()
    np.save(file, values)
    return file.getvalue()


def declared(shape, descr="'<f8'"):
    """An array's header without its numbers."""
    header = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}".encode().ljust(117) + b"\n"
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(header)) + header


def twice(name):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive, pytest.warns(UserWarning, match="Duplicate name"):
        for values in (*GOOD.values(), k):
            archive.writestr(name, npy(values))
    return file.getvalue()


def encrypted(content):
    """The archive with the flag of encryption set on all members."""
    raw = bytearray(content)
    for signature, offset in ((b"PK\3\4", 6), (b"PK\1\2", 8)):
        at = raw.find(signature)
        while at >= 0:
            raw[at + offset] |= 1
            at = raw.find(signature, at + 4)
    return bytes(raw)


def parquet(**columns):
    file = io.BytesIO()
    pq.write_table(pa.table(GOOD | columns), file)
    return file.getvalue()


def mat(packed=False, **arrays):
    file = io.BytesIO()
    savemat(file, GOOD | arrays, do_compression=packed)
    return file.getvalue()


def records(**columns):
    return json.dumps({name: list(values) for name, values in (GOOD | columns).items()}).encode()


def lines_of_json(**columns):
    rows = zip(*(GOOD | columns).values())
    return "\n".join(json.dumps(dict(zip(GOOD, row))) for row in rows).encode()


def mat_header():
    return b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM"


def packed_zeros(size):
    """A packed .mat element that unpacks to so many bytes."""
    content = zlib.compress(bytes(size), 9)
    return mat_header() + struct.pack("<II", 15, len(content)) + content


def nested(depth):
    structs = k
    for _ in range(depth):
        structs = {"x": structs}
    return structs


GARBAGE = bytes(range(256)) * 10
# suffix: what is wrong: content, and what the line must say
FILES = {
    ".csv": {
        "empty": (b"", "is empty"),
        "garbage": (GARBAGE, "is not text (neither UTF-8"),
        "other_encoding": ("Zeit,Störung\n1,2\n".encode("latin-1"), "not text in UTF-8"),
        "archive": (npz(), "is not text (neither UTF-8"),
        "header_only": (b"time_s,current_A\n", "0 samples"),
        "no_header": (b"\n".join(text().split(b"\n")[1:]), "add a header line"),
        "no_time": (text("x,current_A"), "no column time_s"),
        "time_falls": (text(line_9="0.001,7"), "line 9, column 'time_s': 0.001 follows 0.006"),
        "time_repeats": (text(line_9="0.006,7"), "line 9, column 'time_s'"),
        "nan": (text(line_9="0.007,nan"), "line 9, column 'current_A': NaN"),
        "infinite": (text(line_9="0.007,-inf"), "line 9, column 'current_A': an infinite value"),
        "marker_of_a_missing_value": (text(line_9="0.007,3.4e38"), "line 9, column 'current_A': 3.4e+38; no quantity"),
        "short": (b"\n".join(text().split(b"\n")[:90]), "89 samples; 100 or more"),
        "words": (text(line_9="0.007,off"), "line 9, column 'current_A': a number is expected, found 'off'"),
        "blank": (text(line_9="0.007,"), "line 9, column 'current_A': blank"),
        "ragged": (text(line_9="0.007"), "line 9: 1 cell where the header has 2"),
        "cut_short": (text()[:-6], "1 cell where the header has 2"),
        "open_quote": (text(line_9='"0.007,7'), "line 9"),
        "twice": (text("time_s,time_s"), "'time_s' stands twice"),
        "endless_line": (b"time_s,current_A\n" + b"1" * 200_000, "line 2: 1 cell"),
        "many_columns": (b",".join(b"c%d" % i for i in range(20_000)) + b"\n", "line 1 is over 64 kB long"),
    },
    ".parquet": {
        "empty": (b"", "is empty"),
        "garbage": (GARBAGE, "not a whole Parquet file"),
        "text": (text(), "not a whole Parquet file"),
        "truncated": (parquet()[:-50], "not a whole Parquet file"),
        "head_only": (parquet()[:100], "not a whole Parquet file"),
        "nan": (parquet(current_A=but(6, np.nan)), "row 7, column 'current_A': NaN"),
        "null": (parquet(current_A=pa.array([None, *k[1:]])), "row 1, column 'current_A': blank"),
        "words": (parquet(current_A=["off"] * N), "'current_A' holds string"),
        "dates": (parquet(time_s=pa.array(range(N), pa.timestamp("us"))), "'time_s' holds timestamp"),
        "lists": (parquet(current_A=[[1.0, 2.0]] * N), "'current_A' holds list"),
        "structs": (parquet(current_A=[{"x": 1.0}] * N), "'current_A' holds struct"),
        "decimals": (parquet(current_A=pa.array([1] * N, pa.decimal128(9, 2))), "'current_A' holds decimal"),
        "time_falls": (parquet(time_s=but(6, 0.0, k / 1e3)), "row 7, column 'time_s'"),
        "bomb": (parquet(**{name: np.zeros(1_000_000) for name in GOOD}), "unpacks to 16 MB, over the limit of 10 MB"),
    },
    ".npz": {
        "empty": (b"", "is empty"),
        "garbage": (GARBAGE, "not a whole .npz file"),
        "text": (text(), "not a whole .npz file"),
        "single_array": (npy(k), "not a whole .npz file"),
        "truncated": (npz()[:-30], "not a whole .npz file"),
        "no_arrays": (zipped()[:0] + b"PK\5\6" + bytes(18), "holds no rows of numbers"),
        "pickled": (npz(current_A=np.array([{"x": 1}] * N, object)), "'current_A' holds objects"),
        "complex": (npz(current_A=k + 1j), "'current_A' holds complex numbers"),
        "words": (npz(current_A=np.array(["off"] * N)), "'current_A' holds text"),
        "dates": (npz(time_s=np.arange(N).astype("M8[ms]")), "'time_s' holds dates"),
        "table": (npz(current_A=np.zeros((N, 3))), "'current_A' is 120×3; one vector"),
        "scalar": (npz(current_A=1.0), "'current_A' is a single value"),
        "no_values": (npz(current_A=np.zeros(0)), "'current_A' is empty"),
        "lengths": (npz(current_A=k[:-1]), "'current_A' has 119 values where 'time_s' has 120"),
        "nan": (npz(current_A=but(6, np.nan)), "sample 7, column 'current_A': NaN"),
        "huge": (zipped(**{"current_A.npy": declared("(1000000000000,)")}), "over the limit of 10 MB"),
        "huge_field": (
            zipped(**{"x.npy": declared("(200,)", "[('duty', '<f8'), ('y', '|V900000')]")}),
            "unpacks to 180.002 MB, over the limit of 10 MB",
        ),
        "fewer_numbers": (zipped(**{"current_A.npy": declared("(120,)")}), "not a whole .npz file"),
        "negative": (zipped(**{"current_A.npy": declared("(-120,)")}), "'current_A' is"),
        "code": (zipped(**{"current_A.npy": declared("__import__('os').abort()")}), "not a whole .npz file"),
        "bomb": (
            zipped(zipfile.ZIP_DEFLATED, **{f"{name}.npy": npy(np.zeros(1_000_000)) for name in GOOD}),
            "unpacks to 16 MB, over the limit of 10 MB",
        ),
        "encrypted": (encrypted(npz()), "is encrypted; save it again"),
        "wrong_checksum": (npz().replace(k.tobytes()[80:88], b"\0\0\0\0\0\0\0A", 1), "not a whole .npz file"),
    },
    ".mat": {
        "empty": (b"", "is empty"),
        "garbage": (GARBAGE, "not a MATLAB file of version 5 to 7"),
        "text": (text(), "not a MATLAB file"),
        "header_only": (mat_header(), "holds no rows of numbers"),
        "truncated": (mat()[:-30], "not a whole .mat file (it is cut short)"),
        "truncated_packed": (mat(True)[:-30], "not a whole .mat file"),
        "newer": (b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM" + bytes(400), "is not"),
        "cells": (mat(current_A=np.array([1, "a"], object)), "'current_A' holds objects"),
        "complex": (mat(current_A=k + 1j), "'current_A' holds complex numbers"),
        "words": (mat(current_A="off"), "'current_A' holds text"),
        "sparse": (mat(current_A=csc_matrix(k[:, None])), "'current_A' holds objects"),
        "struct_array": (mat(current_A=np.array([(1.0,), (2.0,)], [("x", "f8")])), "'current_A' holds objects"),
        "table": (mat(current_A=np.zeros((N, 3))), "'current_A' is 120×3"),
        "no_values": (mat(current_A=np.zeros((0, 0))), "'current_A' is empty"),
        "lengths": (mat(current_A=k[:-1]), "'current_A' has 119 values"),
        "nan": (mat(current_A=but(6, np.nan)), "sample 7, column 'current_A': NaN"),
        "huge": (mat() + struct.pack("<II", 14, 0xFFFFFFF0) + bytes(64), "it is cut short"),
        "twice": (mat() + mat()[128:], "stands twice"),
        "bomb": (packed_zeros(20_000_000), "unpacks to over 10 MB"),
        "other_checksum": (mat(True)[:150] + b"\xff" + mat(True)[151:], "does not unpack"),
    },
    ".json": {
        "nan": (records(current_A=but(6, np.nan)), "sample 7, column 'current_A': NaN"),
        "infinite": (records(current_A=but(6, -np.inf)), "sample 7, column 'current_A': an infinite value"),
        "nan_in_lines": (lines_of_json(current_A=but(6, np.nan)), "sample 7, column 'current_A': NaN"),
        "nan_alone": (b"NaN", "holds no rows of numbers"),
        "not_whole_with_nan": (records(current_A=but(6, np.nan))[:-9], "not a whole JSON file"),
    },
    ".csv.gz": {
        "empty": (b"", "is empty"),
        "text": (text(), "not a whole gzip file"),
        "cut_short": (gzip.compress(text())[:-20], "not a whole gzip file"),
        "cut_before_its_checksum": (gzip.compress(text())[:-4], "not a whole gzip file"),
        "other_bytes_behind": (gzip.compress(text()) + bytes(20) + b"more", "not a whole gzip file"),
        "zeros_alone": (bytes(512), "not a whole gzip file"),
    },
}
KINDS = [(suffix, kind) for suffix, kinds in FILES.items() for kind in kinds]


def refused(path, name, **options):
    """The line, which must have the file's name and advice."""
    with pytest.raises(InputError) as caught:
        read_measurement(path, max_bytes=LIMIT, **options)
    message = str(caught.value)
    assert message.isprintable() and name in message and len(message) < 600 + len(str(path))
    assert caught.value.__cause__ is None
    assert any(word in message for word in ADVICE), message
    return message


@pytest.mark.parametrize(("suffix", "kind"), KINDS)
def test_refused(suffix, kind, tmp_path):
    content, fact = FILES[suffix][kind]
    path = tmp_path / f"{kind}{suffix}"
    path.write_bytes(content)
    assert fact in refused(path, path.name)
    try:
        read_columns(path, max_bytes=LIMIT)
    except InputError as error:
        assert path.name in str(error) and str(error).isprintable()


def test_there_are_kinds_enough():
    assert len(KINDS) >= 70 and {suffix for suffix, _ in KINDS} == set(FILES)


@pytest.mark.parametrize("suffix", FILES)
def test_no_regular_file(suffix, tmp_path):
    path = tmp_path / f"a{suffix}"
    assert "no such file" in refused(path, path.name)
    path.mkdir()
    assert "is a folder" in refused(path, path.name)
    (tmp_path / f"big{suffix}").write_bytes(bytes(LIMIT + 1))
    assert "over the limit of 10 MB" in refused(tmp_path / f"big{suffix}", "big")


def test_an_array_that_stands_twice(tmp_path):
    (tmp_path / "a.npz").write_bytes(twice("current_A.npy"))
    assert "holds 'current_A.npy' twice; save it again" in refused(tmp_path / "a.npz", "a.npz")


def test_columns_that_stand_twice_are_no_table_either(tmp_path):
    (tmp_path / "a.csv").write_bytes(text("time_s,time_s"))
    with pytest.raises(InputError, match=r"a\.csv: column 'time_s' stands twice"):
        read_columns(tmp_path / "a.csv")


def test_structs_too_deep_are_left_aside(tmp_path):
    (tmp_path / "a.mat").write_bytes(mat(x=nested(20)))
    assert sorted(read_measurement(tmp_path / "a.mat")) == sorted(GOOD)
