"""Worn actuators with and without missing physics: pytest -m study -s tests/discovery/test_faulty_study.py

The plant is the three-phase model with base parameters drawn from their tolerances; 0.45 A rms noise at 10 kHz, 12 bits
a motor turn; chirp, small step and slow sine fitted, another sine held out.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from support.hidden_effects import SINE, recorded

from ema_model.discovery import discover
from ema_model.effects import CATALOGUE

pytestmark = pytest.mark.study

COMMANDS = [("chirp", {}, 0.5), ("step", {"final_rad": 0.005}, 0.5), SINE]
UNSEEN = [("sine", {"amplitude_rad": 0.02, "frequency_Hz": 5}, 0.5)]
FAULTS = ("k1", "k2", "k3", "k6", "k8")
EFFECTS = ("cogging_torque", "stribeck_friction", "hinge_moment", "asymmetric_friction", "position_sensor_delay")
RUNS = 25


def drawn(seed, with_effect):
    """A fault of 0.15 … 0.6 (the gain to either side), and a clear effect of any phase."""
    random = np.random.default_rng(seed)
    name = FAULTS[seed % len(FAULTS)]
    size = random.uniform(0.15, 0.6)
    faults = {name: 0.5 + 0.5 * random.choice([-1.0, 1.0]) * size if name == "k8" else size}
    if name == "k6":
        faults["k7"] = random.uniform(0.1, 0.9)
    if not with_effect:
        return faults, {}
    effect = CATALOGUE[EFFECTS[(seed // len(FAULTS)) % len(EFFECTS)]]
    settings = {effect.parameters[0].name: effect.severities[1]}
    if effect.is_periodic:
        settings |= {"order": 12.0, "phase_rad": random.uniform(-3.0, 3.0)}
    return faults, {effect.name: settings}


@pytest.mark.parametrize("with_effect", [False, True])
def test_faults_are_told_from_missing_physics(with_effect):
    counts: Counter[str] = Counter()
    for seed in range(RUNS):
        faults, effects = drawn(seed, with_effect)
        fitted, unseen = (recorded(seed, commands=runs, faults=faults, effects=effects) for runs in (COMMANDS, UNSEEN))
        found = discover(fitted, holdout=unseen)
        names = {one.name for one in found.effects}
        said = {name for name in faults if any(f"fault {name} " in text for text in found.warnings)}
        right = set(found.faults) - {"k7"} == set(faults) - {"k7"}
        counts["faults"] += right
        counts["faults, or said to explain as much"] += set(found.faults) | said >= set(faults) - {"k7"}
        counts["effects"] += names == set(effects)
        counts["both"] += right and names == set(effects)
        counts["at the floor"] += max(found.ladder[-1].rmse, found.ladder[-1].holdout_rmse or 0.0) <= 1.1
        told = {name: round(float(one.value), 3) for name, one in found.faults.items()}
        print(f"{seed:3} {faults} {list(effects)} → {told} {sorted(names)} {found.ladder[-1].rmse:.2f}", flush=True)
    print(f"{RUNS} plants, {'one effect' if with_effect else 'no effect'} beside the fault: {dict(counts)}")
    assert counts["both"] >= 0.8 * RUNS
