"""Recordings of rigs that nobody here wrote, and what is true of them.

Their simulator lies in ../shared/rig, or where EMAVIZ_RIG points; it shares nothing with the app.
"""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
import sys
from collections.abc import Collection, Iterable, Sequence
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from ema_model.actuator import Actuator, load_actuator
from ema_model.recordings import Measurement, read

FITTED, HELD = ("chirp", "random"), ("multisine",)
RIGS = ("gearservo", "ballscrew", "hobby")
PROPORTIONAL = "proportional"  # a drive without integral action, and a file that says so
# Fixed before the method was tried on them; each at its clear strength.
HIDDEN = {
    "gearservo": "cogging spring asymmetric compliance saturation ripple stribeck viscous inertia load_friction",
    "ballscrew": "load_friction lead_error constant stribeck screw_friction cogging asymmetric inertia current_gain "
    "viscous",
    "hobby": "spring asymmetric stribeck delay warmup gravity viscous constant weak_magnet position_bias",
}


def simulator_folder() -> Path:
    """Where it is; whoever asks is skipped where there is none."""
    found = Path(os.environ.get("EMAVIZ_RIG", Path(__file__).parents[3] / "shared" / "rig"))
    if not (found / "rig.py").is_file():
        pytest.skip(f"no simulator of foreign rigs in {found}; EMAVIZ_RIG may name its folder")
    return found


def made(folder: Path, units: Iterable[int], hidden: int, units_hidden: Collection[int]) -> None:
    """Files of actuators, and recordings in GROUP/UNIT or GROUP/EFFECT-UNIT, where they are missing.

    hidden: so many effects of each rig's list, one at a time, in these units alone.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for rig in RIGS:
        shutil.copy(simulator_folder() / f"{rig}.toml", folder)
        without_integral(rig, folder / f"{rig}_{PROPORTIONAL}.toml")
        for unit in units:
            recorded(rig, unit, folder / f"{rig}_clean" / str(unit))
            if rig != "hobby":
                recorded(rig, unit, folder / f"{rig}_{PROPORTIONAL}" / str(unit), options=["--proportional"])
            for name in HIDDEN[rig].split()[:hidden] if unit in units_hidden else ():
                recorded(rig, unit, folder / f"{rig}_hidden" / f"{name}-{unit}", hide=[name])
            recorded(rig, unit, folder / f"{rig}_real" / str(unit), options=["--real"])


def recorded(
    rig: str,
    unit: int,
    folder: Path,
    hide: Sequence[str] = (),
    options: Sequence[str] = (),
    programmes: Sequence[str] = (*FITTED, *HELD),
) -> None:
    """One recording of each programme, with its truth beside it."""
    simulator = _simulator()
    hidden = [part for name in hide for part in ("--hide", name)]
    for seed, programme in enumerate(programmes):
        out = folder / programme
        if not out.with_suffix(".truth.json").exists():
            given = [rig, programme, "--unit", str(unit), "--seed", str(100 * unit + seed), "--out", str(out)]
            asked = simulator.arguments([*given, *hidden, *options])
            simulator.written(*simulator.recording(asked), asked.out)


def measured(folder: Path, actuator: Actuator, programmes: Sequence[str]) -> list[Measurement]:
    """What `recorded` wrote, as the model needs it."""
    return [read(folder / f"{programme}.csv", actuator) for programme in programmes]


def truth_of(recording: str) -> dict[str, Any]:
    """What the rig says of a recording."""
    return json.loads(Path(recording).with_suffix(".truth.json").read_text(encoding="utf-8"))


def actuator_of(rig: str) -> Actuator:
    """As its file describes it."""
    return load_actuator(simulator_folder() / f"{rig}.toml")


def without_integral(rig: str, path: Path) -> None:
    """Its file for a drive that runs without integral action."""
    text = (simulator_folder() / f"{rig}.toml").read_text(encoding="utf-8")
    path.write_text(re.sub(r"(?m)^(integral_gain_\w+) = .*$", r"\1 = 0.0", text), encoding="utf-8")


@cache
def _simulator() -> ModuleType:
    spec = importlib.util.spec_from_file_location("foreign_rig_simulator", simulator_folder() / "rig.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # numba looks a kernel's module up by its name
    spec.loader.exec_module(module)
    return module
