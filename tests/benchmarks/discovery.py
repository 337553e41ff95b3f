"""How long a discovery takes, first use and after compilation: python tests/benchmarks/discovery.py

Run it on an idle machine.  The whole library is looked through; cogging is hidden in the three-phase model's data.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))  # a script finds what tests share

REPEATS = 3
HIDDEN = {"cogging_torque": {"amplitude_Nm": 0.012, "phase_rad": 0.7}}


def record(folder: Path) -> None:
    """Recordings as a rig leaves them: files, so that what makes them is not counted."""
    from support.hidden_effects import SINE, recorded

    from ema_model.recordings.read import write_measurement

    commands = [SINE, ("chirp", {}, 0.5), ("step", {"final_rad": 0.005}, 0.5)]
    unseen = [("sine", {"amplitude_rad": 0.02, "frequency_Hz": 5}, 0.5)]
    fitted, held = (recorded(31, commands=which, effects=HIDDEN) for which in (commands, unseen))
    for name, measurement in zip(("0", "1", "2", "held"), [*fitted, *held]):
        write_measurement(measurement, folder / f"{name}.npz")


def times(folder: Path) -> None:
    """Prints the first use of this process, then the best of some repeats, for one and for three recordings."""
    started = time.perf_counter()
    import ema_model as em

    fitted, held = ([em.read(folder / f"{name}.npz") for name in names] for names in ("012", ["held"]))
    for chosen in (fitted[:1], fitted):
        for _ in range(REPEATS + 1):
            found = em.discover(chosen, holdout=held)
            assert [one.name for one in found.effects] == ["cogging_torque"]
            print(f"  {len(chosen)} recording(s): {time.perf_counter() - started:5.1f} s", flush=True)
            started = time.perf_counter()


if __name__ == "__main__":
    if len(sys.argv) > 1:
        times(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as folder:
            record(Path(folder))
            for title in (
                "with an empty cache, imports and reading included first",
                "with the kernels of an earlier run",
            ):
                print(title, flush=True)
                command = [sys.executable, __file__, folder]
                subprocess.run(command, check=True, env={**os.environ, "EMAVIZ_CACHE_DIR": f"{folder}/cache"})
