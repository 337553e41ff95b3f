"""Recordings of the foreign rigs that lie beside the project, made where they are missing, and what is true of them."""

from __future__ import annotations

import importlib.util
import json
import shutil
from pathlib import Path
from types import ModuleType
from typing import Any

RIG = Path(__file__).parents[3] / "shared" / "rig"
PROGRAMMES = ("chirp", "steps", "triangle")
QUICK = ("clean", "cogging", "stribeck", "spring")
UNITS = 3


def made(folder: Path, quick: bool) -> None:
    """The recordings and the actuators' files below a folder: every effect that a rig can hide, for some units."""
    rig = _module()
    for name in rig.RIGS:
        folder.mkdir(parents=True, exist_ok=True)
        shutil.copy(RIG / f"{name}.toml", folder)
        for hidden in QUICK if quick else ("clean", *rig.EFFECTS):
            for unit in range(1 if quick else UNITS):
                _scenario(rig, name, hidden, unit, folder / name / f"{hidden}-{unit}")


def truth_of(recording: str) -> dict[str, Any]:
    """What the rig says of a recording."""
    return json.loads(Path(recording).with_suffix(".truth.json").read_text(encoding="utf-8"))


def _scenario(rig: ModuleType, name: str, hidden: str, unit: int, folder: Path) -> None:
    for seed, programme in enumerate(PROGRAMMES):
        out = folder / programme
        if not out.with_suffix(".truth.json").exists():
            hide = [] if hidden == "clean" else ["--hide", hidden]
            given = [name, programme, "--unit", str(unit), "--seed", str(seed), "--out", str(out), *hide]
            options = rig.arguments(given)
            rig.written(*rig.recording(options), options.out)


def _module() -> ModuleType:
    spec = importlib.util.spec_from_file_location("foreign_rig", RIG / "rig.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
