"""A million samples of eight columns: read, checked, compared and drawn; time and peak memory.

python tests/benchmarks/million.py
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.comparison import compare
from ema_model.recordings import Measurement, write_measurement
from ema_model.recordings import read as read_recording
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_reference
from emaviz.views.report import export

KEPT = ("time_s", "command_rad", "user_position_rad", "motor_position_rad", "motor_speed_rad_s", "current_A")


def write(path: Path) -> None:
    """100 s at 10 kHz of the Reference Model with cogging, temperature and load."""
    run = Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 100.0, load_torque_Nm=1.0)
    true = simulate_reference(run, load_actuator(), effects={"cogging_torque": {"amplitude_Nm": 0.012}})
    noisy = Sensors(0.45, 12).record(true, seed=1)
    signals = {name: noisy[name] for name in (*KEPT, "load_torque_Nm")}
    write_measurement(Measurement(signals | {"temperature_C": 20.0 + 0.1 * noisy.time_s}), str(path))


def measure(path: Path) -> None:
    """One comparison in a process of its own, so that the peak is its own."""
    actuator = load_actuator()
    compare([_short()], actuator)  # compiles
    started = time.perf_counter()
    recording = read_recording(path, actuator)
    read = time.perf_counter()
    found = compare([recording], actuator)
    compared = time.perf_counter()
    export(found, path.with_suffix(".html"))
    drawn = time.perf_counter()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(
        f"{recording.samples:,} samples × {len(recording.signals)} columns, {path.stat().st_size / 1e6:.0f} MB of CSV"
    )
    print(f"read {read - started:.2f} s, checked and compared {compared - read:.2f} s, drawn {drawn - compared:.2f} s")
    print(f"together {drawn - started:.2f} s, peak {peak:.0f} MB")
    print(found.sentences[0])


def _short() -> Measurement:
    return simulate_reference(Run(), load_actuator())


if __name__ == "__main__":
    if len(sys.argv) > 1:
        measure(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "million.csv"
            write(path)
            subprocess.run([sys.executable, __file__, str(path)], check=True)
