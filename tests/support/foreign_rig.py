"""Recordings of a rig that nobody here wrote, where its simulator is: in ../shared/rig, or where EMAVIZ_RIG points."""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from ema_model.actuator import Actuator, load_actuator
from ema_model.recordings import Measurement, read

_PROJECT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Case:
    """A unit of a rig with what is hidden in it, and the motions that are fitted and held out."""

    rig: str
    unit: int = 1
    hide: tuple[tuple[str, float], ...] = ()  # effects with their strengths
    options: tuple[str, ...] = ()  # of the simulator, besides
    fitted: tuple[str, ...] = ("chirp", "random")
    held: tuple[str, ...] = ("multisine",)

    @property
    def key(self) -> str:
        """'ballscrew/2/spring=1'."""
        hidden = "+".join(f"{name}={strength:g}" for name, strength in self.hide) or "clean"
        motions = "" if self.fitted == Case.fitted else f" {'+'.join(self.fitted)}"
        return f"{self.rig}{''.join(self.options)}/{self.unit}/{hidden}{motions}"


@dataclass(frozen=True, eq=False)
class Recorded:
    """What a case's rig recorded, its actuator file as it is shipped with it, and the truth of the first recording."""

    actuator: Actuator
    fitted: Sequence[Measurement]
    held: Sequence[Measurement]
    truth: dict[str, Any] = field(default_factory=dict)


def folder() -> Path:
    """The simulator's folder; whoever asks is skipped where there is none."""
    found = Path(os.environ.get("EMAVIZ_RIG", _PROJECT.parent / "shared" / "rig"))
    if not (found / "rig.py").is_file():
        pytest.skip(f"no simulator of foreign rigs in {found}; EMAVIZ_RIG may name its folder")
    return found


def recorded(case: Case, store: Path) -> Recorded:
    """A case's recordings, simulated anew; store: where their files go."""
    actuator = load_actuator(folder() / f"{case.rig}.toml")
    if "--proportional" in case.options:
        actuator = actuator.with_values({"controller.integral_gain_Nm_rad": 0.0})
    fitted, held = ([_recording(case, one, i, store) for i, one in enumerate(p)] for p in (case.fitted, case.held))
    inside = [[read(path, actuator) for path, _ in part] for part in (fitted, held)]
    return Recorded(actuator, inside[0], inside[1], fitted[0][1])


def _recording(case: Case, programme: str, number: int, store: Path) -> tuple[Path, dict[str, Any]]:
    out = store / f"{case.rig}_{programme}_{number}"
    hidden = [part for name, strength in case.hide for part in ("--hide", f"{name}={strength}")]
    options = [case.rig, programme, "--out", str(out), "--unit", str(case.unit), "--seed", str(case.unit)]
    simulator = _simulator()
    columns, truth = simulator.recording(simulator.arguments([*options, *hidden, *case.options]))
    simulator.written(columns, truth, str(out))
    return out.with_suffix(".csv"), truth


@cache
def _simulator() -> ModuleType:
    spec = importlib.util.spec_from_file_location("foreign_rig_simulator", folder() / "rig.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # numba looks a kernel's module up by its name
    spec.loader.exec_module(module)
    return module
