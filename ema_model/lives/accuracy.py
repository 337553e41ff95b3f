"""How well an identification of each profile tells k, found once by identifying recordings of the three-phase model.

`python -m ema_model.lives` makes assets/lives/accuracy.npz anew, in some minutes: for each profile, of the healthy
actuator and of one with each fault, the own covariance and what the base parameters move (`tracking.flight`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ema_model import faults
from ema_model.actuator import load_actuator
from ema_model.files.shipped import shipped_folder
from ema_model.identification.fit import refine, setting
from ema_model.identification.objective import Objective
from ema_model.identification.uncertainty import uncertainty
from ema_model.lives.profiles import PROFILES, SENSORS
from ema_model.simulation.plant import simulate

Array = NDArray[np.float64]

WORN_AT = 0.3  # from healthy, of the fault of each state
STATES: tuple[dict[str, float], ...] = (
    {},
    {"k1": WORN_AT},
    {"k2": WORN_AT},
    {"k3": WORN_AT},
    {"k4": WORN_AT},
    {"k5": WORN_AT},
    {"k6": WORN_AT, "k7": 0.3},
    {"k8": 0.5 - WORN_AT},
)
_FILE = "accuracy.npz"


@dataclass(frozen=True, eq=False)
class Accuracy:
    """By state and profile."""

    own: Array  # (states, profiles, 8, 8)
    common: Array  # (states, profiles, 8, base parameters)


@cache
def accuracy() -> Accuracy:
    """As it was found."""
    with np.load(shipped_folder("lives") / _FILE) as found:
        return Accuracy(found["own"], found["common"])


def find() -> Accuracy:
    """Identifies them all; about a second each."""
    actuator = load_actuator()
    own, common = [], []
    for number, state in enumerate(STATES):
        truth = faults.vector(state)
        for i, profile in enumerate(PROFILES):
            recording = SENSORS.record(simulate(profile.run, actuator, truth, {}), 100 * number + i)
            fitted = refine(setting(Objective([recording], actuator), parameters_known=False), truth, number)
            sure = uncertainty(fitted, fitted.k)
            own.append(sure.own)
            common.append(sure.common)
    shape = (len(STATES), len(PROFILES))
    return Accuracy(*(np.reshape(values, (*shape, *np.shape(values)[1:])) for values in (own, common)))


def write() -> Path:
    """Finds it and keeps it."""
    found, path = find(), shipped_folder("lives") / _FILE
    np.savez_compressed(path, own=found.own, common=found.common)
    return path
