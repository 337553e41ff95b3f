"""Files with changed bytes, of every kind: something or one clear line comes out, in little memory and time."""

from __future__ import annotations

import random
import shutil
from collections import Counter

import pytest
from support.damaged import damage, whole
from support.foreign_files import FILES
from support.reading_process import READERS, ReadingProcess
from support.representative import first_of

MOST_BYTES = 10_000_000  # that a measurement may take
MOST_GROWN = 300e6  # bytes by which the process may grow at its peak; three times the page's limit would be 750e6
MOST_SECONDS = 20.0
ENDINGS = {name: ending.removeprefix(".") for name, (ending, _) in FILES.items()} | {
    "packed mat": "mat",
    "servo log": "json",
    "robot dataset": "json",
    "side file": "toml",
    "actuator": "toml",
    "user effects": "toml",
    "session": "emaviz",
    "listed rrd": "rrd",
}
BY_A_PROGRAM = "rrd", "listed rrd"  # each is looked at by a program of its own first


@pytest.fixture(scope="module")
def process():
    process = ReadingProcess()
    yield process
    process.close()


def fuzzed(process, reader, count, folder):
    """So many damaged files, read: how many ended in which way, and the longest and the largest of all."""
    rng = random.Random(f"{reader} 1")
    good = whole(reader, folder)
    path = folder / f"a.{ENDINGS.get(reader, reader)}"
    for content in good:
        path.write_bytes(content)
        found = process.read(reader, path, MOST_BYTES)
        assert found.kind == "read", found
    kinds, lines, slowest, largest = Counter(), Counter(), 0.0, 0.0
    for _ in range(count):
        path.write_bytes(damage(reader, rng.choice(good), rng, folder))
        found = process.read(reader, path, MOST_BYTES)
        kinds[found.kind] += 1
        slowest, largest = max(slowest, found.seconds), max(largest, found.grown_bytes)
        if found.kind not in ("read", "refused"):
            lines[found.line[:200]] += 1
            shutil.copy(path, folder / f"{found.kind}-{kinds[found.kind]}-{path.name}")
    bad = count - kinds["read"] - kinds["refused"]
    numbers = f"{kinds['read']:6} read {kinds['refused']:6} refused {bad:4} uncaught"
    print(f"{reader:12} {count:6} files {numbers}  slowest {slowest:5.2f} s  peak {largest / 1e6:6.1f} MB")
    for line, times in lines.most_common(10):
        print(f"    {times} × {line}")
    return kinds, bad, slowest, largest


@pytest.mark.parametrize("reader", [reader for reader in READERS if reader not in BY_A_PROGRAM])
def test_damaged_files(process, reader, tmp_path):
    kinds, bad, _, largest = fuzzed(process, reader, 70, tmp_path)
    assert not bad and largest < MOST_GROWN
    assert kinds["refused"] and (kinds["read"] or reader in ("packed mat", "gzip", "robot dataset"))


@pytest.mark.parametrize("reader", BY_A_PROGRAM)
def test_damaged_recordings(process, reader, tmp_path):
    """Fewer, since a program that reads them first takes its time."""
    _, bad, _, _ = fuzzed(process, reader, 8, tmp_path)
    assert not bad


@pytest.mark.parametrize("reader", [*first_of(BY_A_PROGRAM), "rerun"])
def test_a_name_with_a_nul_ends_no_process(process, reader, tmp_path):
    """Rerun's program finds no fault with it, and its native reader aborts."""
    [whole_one] = whole("rrd", tmp_path)
    path = tmp_path / "a.rrd"
    path.write_bytes(whole_one.replace(b"faults", b"fault\0"))
    found = process.read(reader, path, MOST_BYTES)
    assert found.kind == "refused" and "its contents cannot be decoded" in found.line


@pytest.mark.study
@pytest.mark.parametrize("reader", READERS)
def test_ten_thousand_damaged_files(process, reader, tmp_path):
    _, bad, slowest, largest = fuzzed(process, reader, 10_000, tmp_path)
    assert not bad and slowest < MOST_SECONDS and (largest < MOST_GROWN or reader in BY_A_PROGRAM)
