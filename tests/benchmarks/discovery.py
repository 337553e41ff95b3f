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


def times() -> None:
    """Prints the first use of this process, then the best of some repeats, for one and for three recordings."""
    started = time.perf_counter()
    from support.hidden_effects import SINE, recorded

    from ema_model.discovery import discover

    commands = [SINE, ("chirp", {}, 0.5), ("step", {"final_rad": 0.005}, 0.5)]
    unseen = [("sine", {"amplitude_rad": 0.02, "frequency_Hz": 5}, 0.5)]
    hidden = {"cogging_torque": {"amplitude_Nm": 0.012, "phase_rad": 0.7}}
    held = recorded(31, commands=unseen, effects=hidden)
    for chosen in (commands[:1], commands):
        fitted = recorded(31, commands=chosen, effects=hidden)
        for _ in range(REPEATS + 1):
            found = discover(fitted, holdout=held)
            assert [one.name for one in found.effects] == ["cogging_torque"]
            print(f"  {len(chosen)} recording(s): {time.perf_counter() - started:5.1f} s", flush=True)
            started = time.perf_counter()


if __name__ == "__main__":
    if len(sys.argv) > 1:
        times()
    else:
        with tempfile.TemporaryDirectory() as cache:
            for title in ("with an empty cache, imports included first", "with the kernels of an earlier run"):
                print(title, flush=True)
                command = [sys.executable, __file__, "inside"]
                subprocess.run(command, check=True, env={**os.environ, "EMAVIZ_CACHE_DIR": cache})
