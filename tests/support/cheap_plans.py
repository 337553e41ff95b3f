"""Plans of seconds."""

from __future__ import annotations

from pathlib import Path

RUNS = """
[runs.short]
command = "chirp"
duration_s = 0.05
"""
CHEAP = """
does = "identify"
runs = "short"
algorithm = "do"
population = 4
iterations = 2
parameters_known = true
"""


def written(folder: Path, groups: str, name: str = "plan.toml") -> Path:
    """A plan with these groups, in which CHEAP stands for cheap identifications."""
    path = folder / name
    path.write_text(RUNS + groups.replace("CHEAP", CHEAP), encoding="utf-8")
    return path


def cheap(folder: Path, tasks: int, name: str = "plan.toml") -> Path:
    """So many identifications."""
    drawn = "faults = { uniform = { k1 = [0.0, 0.5], k8 = [0.2, 0.8] } }\nnoise_A = 0.45"
    return written(folder, f"[groups.cheap]\nCHEAP{drawn}\nseeds = {{ from = 0, count = {tasks} }}\n", name)
