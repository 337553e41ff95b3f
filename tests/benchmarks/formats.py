"""How long a million samples of eight channels take to read, of each format: `python tests/benchmarks/formats.py [N]`.

Prints a line for each: the file's size, seconds of reading it as a measurement, by the clock and of computing, and by
how much memory grows at most meanwhile, of this process and those that it starts.
"""

from __future__ import annotations

import os
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter

import numpy as np
import psutil

sys.path.insert(0, str(Path(__file__).parents[1]))

from support.foreign_files import FILES

import emaviz.formats
from ema_model.files import sandbox
from ema_model.recordings import Measurement, write_measurement
from ema_model.recordings.formats import WRITTEN
from ema_model.recordings.read import read_measurement

assert emaviz.formats  # which join the others
NAMES = "command_rad user_position_rad motor_position_rad motor_speed_rad_s current_A bus_voltage_V temperature_C"
MOST_SECONDS = 10.0


def signals(samples: int) -> dict[str, np.ndarray]:
    """Time and seven more; (samples,) each."""
    time = np.arange(samples) / 10_000.0
    rng = np.random.default_rng(13)
    rest = {
        name: np.round(np.sin((1.0 + i) * time) + 0.01 * rng.normal(size=samples), 6)
        for i, name in enumerate(NAMES.split())
    }
    return {"time_s": time, **rest}


def _computing() -> float:
    """Seconds that this process has computed, and those that read logs, the one that lives and those before it."""
    alive = sandbox.process_id()
    return sum(os.times()[:4]) + (sum(psutil.Process(alive).cpu_times()[:2]) if alive else 0.0)


def _memory() -> int:
    """Bytes in use, of this process and of those that it has started."""
    here = psutil.Process()
    total = here.memory_info().rss
    for one in here.children(recursive=True):
        with suppress(psutil.Error):  # it may have ended since
            total += one.memory_info().rss
    return total


@contextmanager
def _peak() -> Iterator[list[int]]:
    """Looks at the memory twenty times a second; at the end the list holds by how much it has grown at most."""
    seen, before, done = [0], _memory(), threading.Event()

    def look() -> None:
        while not done.wait(0.05):
            seen[0] = max(seen[0], _memory() - before)

    looking = threading.Thread(target=look, daemon=True)
    looking.start()
    yield seen
    done.set()
    looking.join()


def _ending(kind: str) -> str:
    return kind if kind in WRITTEN else FILES[kind][0]


def _write(kind: str, path: Path, samples: int) -> None:
    columns = signals(samples)
    if kind in WRITTEN:
        write_measurement(Measurement(columns), path)
    else:
        FILES[kind][1](path, columns)


def main(samples: int, kinds: list[str]) -> None:
    """Writes, reads and prints each format."""
    for kind in kinds or [*WRITTEN, *FILES]:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"run{_ending(kind)}"
            # Apart, so that no memory is left from it.
            writing = get_context("spawn").Process(target=_write, args=(kind, path, samples))
            writing.start()
            writing.join()
            before, began = _computing(), perf_counter()
            with _peak() as peak:
                measurement = read_measurement(path)
            seconds, computing = perf_counter() - began, _computing() - before
            size, told = path.stat().st_size / 1e6, "" if seconds <= MOST_SECONDS else f"  over {MOST_SECONDS:g} s"
            assert measurement.samples == samples and len(measurement.signals) == 1 + len(NAMES.split())
            memory = f"{peak[0] / 1e6:6.0f} MB of memory"
            print(
                f"{kind:14} {size:7.1f} MB  {seconds:6.2f} s ({computing:5.2f} s of computing) {memory}{told}",
                flush=True,
            )


if __name__ == "__main__":
    main(int(float(sys.argv[1])) if len(sys.argv) > 1 else 1_000_000, sys.argv[2:])
