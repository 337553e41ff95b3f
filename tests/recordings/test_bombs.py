"""Files that mean to fill the memory, or to take minutes: refused in one line, or read, within what is documented."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from support.bombs import BOMBS, SLOW
from support.foreign_files import FILES
from support.reading_process import ReadingProcess

from ema_model.errors import InputError
from ema_model.files.opened import CHALLENGE_BYTES, COLUMNS, FILE_BYTES, PAGE_BYTES
from ema_model.recordings import read_columns, read_header

ENDINGS = {"packed mat": ".mat", "side file": ".toml", "actuator": ".toml", "session": ".emaviz"}
SMALL = 20_000_000  # bytes that a measurement may take here, so that the plain suite stays quick
THREE = np.arange(3.0)
GROUND = 50e6  # bytes that any reading may take: libraries' buffers, and their modules at first use
MOST_SECONDS = 20.0


@pytest.fixture(scope="module")
def process():
    process = ReadingProcess()
    yield process
    process.close()


def most_grown(reader, limit):
    """Three times the limit of what is read."""
    own = {"session": PAGE_BYTES, "challenge": CHALLENGE_BYTES, "side file": 0, "actuator": 0}
    return 3.0 * own.get(reader, limit) + GROUND


def outcome(process, name, folder, limit):
    """What comes of a bomb, which must be as it should but for the time."""
    reader, write, says = BOMBS[name]
    path = folder / f"bomb{ENDINGS.get(reader, f'.{reader}')}"
    write(path, limit)
    size = path.stat().st_size
    found = process.read(reader, path, limit)
    path.unlink()
    print(f"{name:36} {size / 1e6:8.3f} MB {found.kind:8} {found.seconds:6.2f} s {found.grown_bytes / 1e6:7.1f} MB")
    assert found.kind in ("refused", "read"), found
    assert found.kind == "refused" or not says, "it is read"
    assert "as large" not in name or found.kind == "read", found.line
    assert says in found.line
    assert found.grown_bytes < most_grown(reader, limit), f"it took {found.grown_bytes / 1e6:.0f} MB"
    return found


@pytest.mark.parametrize("name", [name for name in BOMBS if name not in SLOW])
def test_a_bomb_takes_little_memory(process, name, tmp_path):
    outcome(process, name, tmp_path, SMALL)


@pytest.mark.study
@pytest.mark.parametrize("limit", [PAGE_BYTES, FILE_BYTES], ids=["page", "command line"])
@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_of_the_real_size(name, limit, tmp_path):
    process = ReadingProcess()
    try:
        assert outcome(process, name, tmp_path, limit).seconds < MOST_SECONDS
    finally:
        process.close()


@pytest.mark.parametrize("kind", ["hdf5", "mdf"])
def test_a_packed_log_that_unpacks_to_more_than_a_measurement_may_is_refused(kind, tmp_path):
    """Of a few kilobytes; its names are read all the same."""
    zeros = np.zeros(200_000)
    if kind == "hdf5":
        path = tmp_path / "a.h5"
        with h5py.File(path, "w") as file:
            for name in ("time_s", "current_A"):
                file.create_dataset(name, data=zeros, compression="gzip")
    else:
        from asammdf import MDF, Signal

        path = tmp_path / "a.mf4"
        with MDF(version="4.10") as file:
            file.append([Signal(zeros, zeros, name="current_A")])
            file.save(path, overwrite=True, compression=2)
    assert path.stat().st_size < 100_000
    assert set(read_header(str(path), 1_000_000)) == {"time_s", "current_A"}
    with pytest.raises(
        InputError, match=r"unpacks to 3\.2 MB, over the limit of 1 MB; split it, or keep fewer columns"
    ):
        read_columns(path, max_bytes=1_000_000)


@pytest.mark.parametrize("kind", ["tdms", "ulog"])
def test_a_log_of_more_channels_than_a_measurement_may_have_is_refused(kind, tmp_path):
    ending, write = FILES[kind]
    path = tmp_path / f"a{ending}"
    write(path, {"time_s": THREE, **{f"c{i}": THREE for i in range(COLUMNS + 1)}})
    with pytest.raises(InputError, match=f"has {COLUMNS + 1} channels, over the limit of {COLUMNS}; keep fewer"):
        read_columns(path)
