"""Lives of units, made for tests and for teaching: wear from flight to flight until a fault crosses its threshold.

A life is drawn from a seed.  Its flights are recordings of the three-phase model (`recorded`), or k̂ drawn directly
from what identifications of such recordings were found to be able to tell (`drawn`), thousands of lives in minutes.
`python -m ema_model.simulated_lives` finds anew how well identifications tell k.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model import faults
from ema_model.actuator import Actuator, load_actuator
from ema_model.commands import command
from ema_model.errors import InputError, quoted
from ema_model.estimation.problem import ECCENTRICITY, to_vector
from ema_model.files.opened import shipped_folder
from ema_model.identification.fit import refine, setting
from ema_model.identification.search import Objective
from ema_model.identification.uncertainty import uncertainty
from ema_model.recordings import Measurement, write_measurement
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.plant import simulate
from ema_model.simulation.run import Run
from ema_model.tracking.flights import UNFIT, Flight

# --- what a flight asks of the actuator: a command and a load, the harder the more it wears ---------------------------

SENSORS = Sensors(current_noise_A=0.45, encoder_bits=12)
_LOADS_Nm = (0.0, 8.0, 20.0)  # of the gentle, the usual and the hard flights
_HARD = (0.6, 1.3)  # severities between them


@dataclass(frozen=True)
class Profile:
    """A command with its settings, and a recorded load."""

    command: str
    settings: dict[str, Any]
    load_torque_Nm: float

    @property
    def run(self) -> Run:
        """As it is simulated, 0.5 s at 10 kHz."""
        return Run(command(self.command, self.settings), load_torque_Nm=self.load_torque_Nm)


_COMMANDS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("chirp", {}),
    ("multisine", {"amplitude_rad": 8e-3, "frequencies_Hz": (2.0, 6.0, 14.0)}),
    ("sine", {"amplitude_rad": 6e-3, "frequency_Hz": 9.0}),
)
PROFILES = tuple(Profile(name, settings, load) for load in _LOADS_Nm for name, settings in _COMMANDS)


def profiles_of(life: Life) -> np.ndarray:
    """Of each flight, which of PROFILES: the load follows its severity, the command is any."""
    random = np.random.default_rng([life.seed, 42])
    load = np.searchsorted(_HARD, life.severity)
    return load * len(_COMMANDS) + random.integers(len(_COMMANDS), size=life.flights)


# --- the flights of a life without recordings: k̂ drawn from what identifications can tell ----------------------------
# What is common to a unit's flights (its base parameters) is drawn once, what is a flight's own in each flight; both
# change with the flight's profile and with how worn the unit is.

_STATED = 0.2  # by which what an identification says of its own σ² varies about what it is, in natural logarithms


def drawn(life: Life) -> list[Flight]:
    """All flights of a life; those that are of no use are excluded, and their k̂ is anything."""
    random = np.random.default_rng([life.seed, 45])
    known, profiles = accuracy(), profiles_of(life)
    u = base_of(life, known.common.shape[-1])
    vectors = to_vector(life.k)
    healthy = to_vector(faults.HEALTHY)
    flights = []
    for i, (k, profile) in enumerate(zip(vectors, profiles)):
        shares = _states(k - healthy)
        own = np.tensordot(shares, known.own[:, profile], 1)
        common = np.tensordot(shares, known.common[:, profile], 1)
        error = np.linalg.cholesky(own + 1e-14 * np.eye(8)) @ random.standard_normal(8)
        stated = own * np.exp(_STATED * random.standard_normal())
        usable = bool(life.usable[i])
        seen = k + common @ u + error if usable else random.random(8)
        flights.append(Flight(f"flight_{i + 1:04d}", seen, stated, common, "" if usable else UNFIT))
    return flights


def _states(off: np.ndarray) -> np.ndarray:
    """How much each state of `accuracy` counts for a unit that is `off` (8,) from healthy; sums to 1."""
    size = np.abs(off)
    eccentricity = float(np.hypot(*off[list(ECCENTRICITY)]))
    worn = np.array([*size[:5], eccentricity, size[7]]) / WORN_AT
    worn /= max(1.0, float(worn.sum()))
    assert len(worn) + 1 == len(STATES)
    return np.concatenate([[1.0 - worn.sum()], worn])


# --- what truly happens to a unit -------------------------------------------------------------------------------------
# What truly happens to a unit: its wear, flight by flight, with the load of each flight, a repair, bad recordings.
#
# Each flight wears by its severity, which is Gamma distributed with mean 1 and a coefficient of variation, so that
# the time in which a part wears is a sum over flights and no count of them. Three laws say how k follows that time.

Array = NDArray[np.float64]

LAWS = ("linear", "accelerating", "onset")
_WORN = ("k1", "k2", "k3", "k4", "k5", "k6", "k8")
_THRESHOLDS = {"k1": (0.2, 0.6), "k2": (0.2, 0.6), "k6": (0.15, 0.5), "k8": (0.1, 0.3)}
_SHORT = (0.1, 0.4)  # of k3, k4, k5
_FLIGHTS = (100, 400)
POWER = (1.5, 3.0)  # of the accelerating law, k ∝ tᵖ
ONSET = (0.2, 0.6)  # share of a part's life before which nothing wears
_START = 0.05  # most of a worn part's k at first
_BAD = 0.03  # share of flights whose recording is of no use
_REPAIRED = 0.25  # share of lives in which the part is replaced once
_REPAIRED_AT = (0.4, 0.8)  # share of the part's life
_BESIDE = 0.5  # share of lives in which another fault wears too, and how far it gets towards its own threshold
_BESIDE_AT_END = 0.3


@dataclass(frozen=True, eq=False)
class Life:
    """A unit from its first flight to the one in which its fault crosses the threshold, or to its last."""

    seed: int
    law: str  # of LAWS, or "healthy"
    variation: float  # coefficient of variation of the severities
    k: Array  # (flights, 8), true
    severity: Array  # (flights,), mean 1
    usable: NDArray[np.bool_]  # (flights,)
    fault: str = ""  # the one that crosses
    threshold: float = float("nan")  # of that k
    power: float = 1.0  # of the law
    onset: int = 0  # flight of the last part from which on it wears
    repaired: int | None = None  # the first flight with a new part

    @property
    def flights(self) -> int:
        """How many there are; in the last one the threshold is crossed, if at all."""
        return len(self.k)


def healthy_life(seed: int, flights: int | None = None, variation: float = 0.5) -> Life:
    """Nothing wears."""
    random = np.random.default_rng([seed, 40])
    count = int(random.integers(*_FLIGHTS)) if flights is None else flights
    severity = _severities(random, variation, count)
    k = np.tile(faults.HEALTHY, (count, 1))
    return Life(seed, "healthy", variation, k, severity, random.random(count) >= _BAD)


def worn_life(law: str, seed: int, variation: float = 0.5, fault: str | None = None) -> Life:
    """One fault wears by a law until it crosses a threshold that is drawn, after 100 … 400 flights or so.

    Another may wear a little beside it, and the part may have been replaced once.  InputError for no such law.
    """
    if law not in LAWS:
        raise InputError(f"no wear law {quoted(law)!r}; there are {', '.join(LAWS)}")
    random = np.random.default_rng([seed, 41, LAWS.index(law)])
    name = str(random.choice(_WORN)) if fault is None else fault
    beside = str(random.choice([one for one in _WORN if one != name])) if random.random() < _BESIDE else ""
    phase = float(random.uniform(0.0, 1.0))  # of an eccentricity, wherever there is one
    start, threshold = _ends(random, name)
    length = float(random.uniform(*_FLIGHTS))
    power = float(random.uniform(*POWER)) if law == "accelerating" else 1.0
    onset_share = float(random.uniform(*ONSET)) if law == "onset" else 0.0
    parts = [1.0]
    if random.random() < _REPAIRED:
        first = float(random.uniform(*_REPAIRED_AT))
        parts, length = [first, 1.0], length / (1.0 + first)
    severity = _severities(random, variation, 4 * int(length) + 4000)
    values, at, onset, repaired = [], 0, 0, None
    for number, share in enumerate(parts):
        onset = at + round(onset_share * length)
        wear = np.cumsum(np.where(np.arange(len(severity)) >= onset, severity, 0.0)[at:])
        progress = (wear / ((1.0 - onset_share) * length)) ** power
        end = int(np.argmax(progress >= share)) + 1
        values.append(progress[:end])
        at += end
        if number + 1 < len(parts):
            repaired = at
    progress = np.concatenate(values)
    count = len(progress)
    k = np.tile(faults.HEALTHY, (count, 1))
    k[:, faults.NAMES.index(name)] = start + (threshold - start) * progress
    if beside:
        low, far = _ends(random, beside)
        k[:, faults.NAMES.index(beside)] = low + _BESIDE_AT_END * (far - low) * np.arange(1, count + 1) / count
    if "k6" in (name, beside):
        k[:, 6] = phase
    return Life(
        seed, law, variation, k, severity[:count], random.random(count) >= _BAD, name, threshold, power, onset, repaired
    )


def _ends(random: np.random.Generator, name: str) -> tuple[float, float]:
    """A fault's value when the part is new to us, and its threshold."""
    size = float(random.uniform(*_THRESHOLDS.get(name, _SHORT)))
    start = float(random.uniform(0.0, _START))
    if name == "k8":
        return 0.5, 0.5 + float(random.choice([-1.0, 1.0])) * size
    return start, size


def _severities(random: np.random.Generator, variation: float, count: int) -> Array:
    shape = 1.0 / variation**2
    return random.gamma(shape, 1.0 / shape, count)


# --- how well an identification of each profile tells k ---------------------------------------------------------------
# How well an identification of each profile tells k, found once by identifying recordings of the three-phase model.
#
# `python -m ema_model.simulated_lives` makes assets/lives/accuracy.npz anew, in some minutes: for each profile, of the
# healthy actuator and of one with each fault, the own covariance and what the base parameters move (`tracking.flight`).

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


def write_accuracy() -> Path:
    """Finds it and keeps it."""
    found, path = find(), shipped_folder("lives") / _FILE
    np.savez_compressed(path, own=found.own, common=found.common)
    return path


# --- the flights of a life as recordings of the three-phase model -----------------------------------------------------

_BAD_NOISE_A = 6.0  # of a broken wire: the rig records, and nothing can be told


def unit_of(life: Life, actuator: Actuator) -> Actuator:
    """The unit: each base parameter somewhere within its tolerance, once for all its flights."""
    u = base_of(life, len(actuator.tolerances))
    values = {
        path: actuator.value(path) + one.sigma * x
        for x, (path, one) in zip(u, actuator.tolerances.items())
        if not path.startswith("sensors.")
    }
    return actuator.with_values(values)


def base_of(life: Life, count: int) -> np.ndarray:
    """(count,), in σ of the tolerances, within 2.5 σ."""
    return np.clip(np.random.default_rng([life.seed, 43]).standard_normal(count), -2.5, 2.5)


def recorded(life: Life, actuator: Actuator, flights: range | None = None) -> Iterator[tuple[str, Measurement]]:
    """Names ("flight_0007") and recordings, one after another; FloatingPointError if the model diverges."""
    unit, profiles = unit_of(life, actuator), profiles_of(life)
    for i in flights or range(life.flights):
        clean = simulate(PROFILES[profiles[i]].run, unit, life.k[i], {})
        one = SENSORS.record(clean, 100_000 * life.seed + i)
        if not life.usable[i]:
            noise = np.random.default_rng([life.seed, 44, i]).standard_normal(one.samples)
            one = one.with_signals(current_A=np.cumsum(noise) / np.sqrt(one.samples) * _BAD_NOISE_A)
        kept = {name: one[name] for name in ("time_s", "command_rad", "user_position_rad", "motor_position_rad",
                                             "current_A", "load_torque_Nm") if name in one}  # fmt: skip
        yield f"flight_{i + 1:04d}", Measurement(kept, name=f"flight_{i + 1:04d}")


def write_flights(life: Life, actuator: Actuator, folder: Path, flights: range | None = None) -> list[Path]:
    """The same as files in a folder that must be there."""
    found = []
    for name, one in recorded(life, actuator, flights):
        found.append(folder / f"{name}.parquet")
        write_measurement(one, found[-1])
    return found


if __name__ == "__main__":
    print(write_accuracy())
