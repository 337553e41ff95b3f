"""Files with changed bytes: a measurement or one clear line comes out, in little memory and time, and nothing else."""

from __future__ import annotations

import io
import time
import zipfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from ema_model.errors import InputError
from ema_model.recordings import read_columns, read_measurement
from ema_model.recordings.health.card import health

N = 120
MOST_BYTES = 10_000_000  # that a file may take
MOST_MEMORY = 200e6  # bytes by which the process may grow at its peak
MOST_SECONDS = 5.0  # for one file, on a busy machine
FORMATS = ("csv", "parquet", "npz", "mat")

k = np.arange(float(N))
COLUMNS = {"time_s": k / 1e3, "current_A": np.sin(k / 9.0), "motor_position_rad": k / 7.0, "duty": np.cos(k / 5.0)}
TABLE = np.rec.fromarrays(list(COLUMNS.values()), names=list(COLUMNS))


def written(write, *args, **kw):
    """What `write(file, …)` writes."""
    file = io.BytesIO()
    write(file, *args, **kw)
    return file.getvalue()


def as_text(separator, decimal="."):
    rows = (separator.join(f"{value:.6g}" for value in row) for row in zip(*COLUMNS.values()))
    return "\n".join([separator.join(COLUMNS), *(row.replace(".", decimal) for row in rows)]).encode()


def as_parquet(**options):
    return written(lambda file: pq.write_table(pa.table(COLUMNS), file, **options))


def zipped(members):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return file.getvalue()


WHOLE = {
    "csv": [as_text(","), as_text(";", ","), b"\xef\xbb\xbf" + as_text("\t")],
    "parquet": [as_parquet(), as_parquet(compression="none", use_dictionary=False), as_parquet(data_page_size=64)],
    "npz": [
        written(np.savez, **COLUMNS),
        written(np.savez_compressed, **COLUMNS),
        written(np.savez, table=np.asarray(TABLE), label="x"),
    ],
    "mat": [
        written(savemat, COLUMNS),
        written(savemat, COLUMNS, do_compression=True),
        written(savemat, {"rig": {**COLUMNS, "label": "x", "inner": {"x": k}}, "cells": np.array([k, "a"], object)}),
    ],
}
CHANGES = ("put", "put", "insert", "cut", "drop", "repeat", "flip")
change = st.tuples(st.sampled_from(CHANGES), st.floats(0.0, 1.0), st.binary(min_size=1, max_size=8))


def changed(content, changes):
    """The content with each change made in it, at a place given as a share of its length."""
    for kind, place, piece in changes:
        at = int(place * len(content))
        end = at + len(piece)
        if kind == "put":
            content = content[:at] + piece + content[end:]
        elif kind == "insert":
            content = content[:at] + piece + content[at:]
        elif kind == "cut":
            content = content[:at]
        elif kind == "drop":
            content = content[:at] + content[end:]
        elif kind == "repeat":
            content = content[:at] + content[at:end] * (1 + piece[0]) + content[end:]
        else:
            content = content[:at] + bytes(byte ^ 1 << piece[0] % 8 for byte in content[at:end]) + content[end:]
    return content


def within_npz(changes):
    """An archive that is whole, its checksums too, with a changed array in it."""
    array = changed(written(np.save, COLUMNS["current_A"]), changes)
    return zipped({"time_s.npy": written(np.save, COLUMNS["time_s"]), "current_A.npy": array})


def peak_bytes(reset=False):
    """The most memory that the process has held since the last reset; None where the system does not tell."""
    try:
        if reset:
            Path("/proc/self/clear_refs").write_text("5")
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return None
    return next((1024.0 * int(line.split()[1]) for line in lines if line.startswith("VmHWM")), None)


def check(path, content):
    """Reads it as a measurement and as a table; whether a measurement came out."""
    path.write_bytes(content)
    began, before = time.perf_counter(), peak_bytes(reset=True)
    measurement = None
    for read in (read_measurement, read_columns):
        try:
            result = read(path, max_bytes=MOST_BYTES)
        except InputError as error:
            message = str(error)
            assert message.isprintable() and path.name in message and len(message) < 700 + len(str(path))
        else:
            measurement = result if read is read_measurement else measurement
    if measurement is not None:
        assert all(np.isfinite(values).all() for values in measurement.signals.values())
        assert health(measurement).findings
    after = peak_bytes()
    assert time.perf_counter() - began < MOST_SECONDS
    assert before is None or after is None or after - before < MOST_MEMORY
    return measurement is not None


def fuzzed(format_name, examples):
    """A test of so many changed files."""

    @settings(
        max_examples=examples,
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
    )
    @given(st.integers(0, len(WHOLE[format_name])), st.lists(change, min_size=1, max_size=4))
    def reads(folder, which, changes):
        inside = which == len(WHOLE[format_name])
        if inside and format_name == "npz":
            content = within_npz(changes)
        else:
            content = changed(WHOLE[format_name][which - inside], changes)
        outcomes.append(check(folder / f"a.{format_name}", content))

    outcomes: list[bool] = []
    return reads, outcomes


@pytest.mark.parametrize("format_name", FORMATS)
def test_whole_files_are_read(format_name, tmp_path):
    for content in WHOLE[format_name]:
        assert check(tmp_path / f"a.{format_name}", content)


@pytest.mark.parametrize("format_name", FORMATS)
def test_changed_bytes(format_name, tmp_path):
    reads, outcomes = fuzzed(format_name, 200)
    reads(tmp_path)
    assert len(outcomes) >= 200 and True in outcomes and False in outcomes


@pytest.mark.study
@pytest.mark.parametrize("format_name", FORMATS)
def test_ten_thousand_files(format_name, tmp_path):
    reads, outcomes = fuzzed(format_name, 2500)
    reads(tmp_path)
    print(f"{format_name}: {len(outcomes)} files, {sum(outcomes)} still read")
    assert len(outcomes) >= 2500
