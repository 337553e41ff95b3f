"""How far exports are from the monitor model, and what MuJoCo loses: python tests/benchmarks/export.py [WHAT …]

WHAT is shipped (the four actuators, on runs made for them), challenges (the six that end in one model: discovered, then
exported on their own recordings), effects (each of the library on two actuators), xl330 (real recordings of one, beside
which the model is improved; they lie in the folder that XL330_DATA names).  Without one the first three.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import ema_model as em
from ema_model.actuator import Actuator
from ema_model.actuator.file import cannot_represent
from ema_model.effects import CATALOGUE
from ema_model.exports.export import at_hand
from ema_model.exports.replay import Export
from ema_model.recordings import Measurement

ASSETS = Path(__file__).parents[2] / "assets"
CHALLENGES = (
    "acceptance_test", "after_the_overhaul", "first_bench_run", "prototype", "quiet_complaint", "two_suspects",
)  # fmt: skip
HEAD = "| model | " + " | ".join(
    ("C", "FMU", "Python", "C: 1 s in", "MJCF: error over ours", "MuJoCo cannot hold", "s")
)


def exported(
    actuator: Actuator, recordings: Sequence[Measurement] = (), to: Sequence[str] = ()
) -> tuple[Export, float]:
    """What is exported to every target that is there, or to some; and how long that took."""
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        result = em.export(actuator, Path(folder) / "home", list(to) or at_hand()[0], recordings)
    return result, time.perf_counter() - began


def row(name: str, result: Export, took: float) -> str:
    """A line of the table."""
    found = {one.target: one for one in result.targets}
    cells = [f"{found[one].difference:.1e}" if one in found else "–" for one in ("c", "fmu", "python")]
    cells.append(f"{1e3 / found['c'].real_time:.1f} ms")
    lost, held = "–", "–"
    if "mjcf" in found:
        ratios = [s.rmse / s.rmse_ours for s in found["mjcf"].signals.values() if s.rmse_ours > 0.0]
        lost = f"{max(ratios):.3f}" if ratios and not result.simulated else f"within {found['mjcf'].difference:.1e}"
        held = ", ".join(f"{one.what} {100 * one.share:.2g} %" for one in found["mjcf"].cannot_hold) or "nothing"
    return f"| {name} | {' | '.join([*cells, lost, held, f'{took:.0f}'])} |"


def shipped() -> None:
    """The four actuators."""
    for name in ("thesis", "ball_screw", "xl330", "odrive"):
        print(row(name, *exported(em.load_actuator(ASSETS / "actuators" / f"{name}.toml"))), flush=True)


def challenges() -> None:
    """Improved models on their own recordings, held out and fitted."""
    for name in CHALLENGES:
        actuator = em.load_actuator()
        files = sorted((ASSETS / "challenges" / name).glob("*.parquet"))
        recordings = [em.read(file, actuator) for file in files]
        fitted = [one for one in recordings if one.name != "unseen"]
        found = em.discover(fitted, actuator, holdout=[one for one in recordings if one.name == "unseen"])
        added = ", ".join(found.actuator.effects) or "no effect"
        print(row(f"{name}: {added}", *exported(found.actuator, recordings)), flush=True)


def effects() -> None:
    """C and Python of each effect."""
    for name in ("thesis", "xl330"):
        actuator = em.load_actuator(ASSETS / "actuators" / f"{name}.toml")
        worst, count = 0.0, 0
        for effect in CATALOGUE:
            if not cannot_represent(actuator, effect):
                settings = CATALOGUE[effect].on(actuator.axes).at_severity(1)
                with_it = replace(actuator, effects={**actuator.effects, effect: settings})
                result, _ = exported(with_it, to=("c", "fmu"))
                found = max(one.difference for one in result.targets)
                worst, count = max(worst, found), count + 1
                if found > 1e-12:
                    print(f"{name} with {effect}: {found:.1e}", flush=True)
        print(f"{name}: {count} effects one by one, C and FMU differ by {worst:.1e} at most", flush=True)


def xl330() -> None:
    """Improved on logs of gain 400, one of another gain held out; exported on the first."""
    actuator = em.load_actuator(ASSETS / "actuators" / "xl330.toml")
    files = sorted(Path(os.environ["XL330_DATA"]).glob("xl330_kp400_*.csv"))
    recordings = [em.read(file, actuator) for file in files]
    print(row("XL330 as in the file", *exported(actuator, recordings)), flush=True)
    found = em.discover(recordings, actuator, holdout=em.read(files[0].with_name("xl330_kp100_sin_sin.csv"), actuator))
    result, took = exported(found.actuator, recordings)
    print(row(f"XL330 improved: {', '.join(found.actuator.effects)}", result, took), flush=True)
    print(result)


if __name__ == "__main__":
    print(f"{HEAD} |\n|---|---|---|---|---|---|---|---|")
    for what in sys.argv[1:] or ("shipped", "challenges", "effects"):
        {"shipped": shipped, "challenges": challenges, "effects": effects, "xl330": xl330}[what]()
