"""How long a million samples of eight channels take to read, of each format: `python tests/benchmarks/formats.py [N]`.

Prints a line for each: the file's size, seconds of reading it as a measurement, by the clock and of computing.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np
import psutil

sys.path.insert(0, str(Path(__file__).parents[1]))

from support.foreign_files import FILES

import emaviz
from ema_model.files import apart
from ema_model.recordings import Measurement, write_measurement
from ema_model.recordings.file import read_measurement
from ema_model.recordings.formats import WRITTEN

assert emaviz  # which adds formats
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
    alive = apart.process_id()
    return sum(os.times()[:4]) + (sum(psutil.Process(alive).cpu_times()[:2]) if alive else 0.0)


def main(samples: int, kinds: list[str]) -> None:
    """Writes, reads and prints each format."""
    columns = signals(samples)
    writers = {suffix: (suffix, lambda path, c: write_measurement(Measurement(dict(c)), path)) for suffix in WRITTEN}
    for kind, (ending, write) in (writers | FILES).items():
        if kinds and kind not in kinds:
            continue
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"run{ending}"
            write(path, columns)
            before, began = _computing(), perf_counter()
            measurement = read_measurement(path)
            seconds, computing = perf_counter() - began, _computing() - before
            size = path.stat().st_size / 1e6
            told = "" if computing <= MOST_SECONDS else f"  over {MOST_SECONDS:g} s"
            assert measurement.samples == samples and len(measurement.signals) == len(columns)
            print(f"{kind:14} {size:7.1f} MB  {seconds:6.2f} s ({computing:5.2f} s of computing){told}", flush=True)


if __name__ == "__main__":
    main(int(float(sys.argv[1])) if len(sys.argv) > 1 else 1_000_000, sys.argv[2:])
