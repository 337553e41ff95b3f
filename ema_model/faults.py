"""The eight fault parameters k1…k8, what they mean physically, and how an answer is scored."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.quantities import check_number, in_sentence

_LEAST_TURNS = 0.02  # less, and the three-phase model diverges when two phases are shorted


@dataclass(frozen=True)
class Fault:
    """One normalised fault parameter, in [0, 1]."""

    name: str
    title: str
    healthy: float

    @property
    def label(self) -> str:
        """'k1 friction'."""
        return f"{self.name} {in_sentence(self.title)}"


FAULTS = (
    Fault("k1", "Friction", 0.0),
    Fault("k2", "Backlash", 0.0),
    Fault("k3", "Short circuit A", 0.0),
    Fault("k4", "Short circuit B", 0.0),
    Fault("k5", "Short circuit C", 0.0),
    Fault("k6", "Eccentricity", 0.0),
    Fault("k7", "Eccentricity phase", 0.5),
    Fault("k8", "Proportional gain", 0.5),
)
NAMES = tuple(fault.name for fault in FAULTS)
BY_NAME = {fault.name: fault for fault in FAULTS}
# What is one cause: of the eccentricity its modulus and its phase.
CAUSES = (("k1",), ("k2",), ("k3",), ("k4",), ("k5",), ("k6", "k7"), ("k8",))
# What each multiplies in the actuator, in words: see `physical`.  An eccentricity is no factor.
FACTORS = {"k1": "(1 + 2 k1)", "k2": "(1 + 99 k2)", "k8": "(0.5 + k8)"} | {
    name: f"(1 − {name})" for name in ("k3", "k4", "k5")
}
HEALTHY: NDArray[np.float64] = np.array([fault.healthy for fault in FAULTS])
HEALTHY.setflags(write=False)


def cause_of(name: str) -> tuple[str, ...]:
    """The faults that one stands for together with, the first of which names them."""
    return next(names for names in CAUSES if name in names)


def causes(names: Collection[str]) -> list[str]:
    """Of these faults, the one that names each cause: k6 without its k7."""
    return [one[0] for one in CAUSES if one[0] in names]


class PhysicalFaults(SimpleNamespace):
    """What k means: each field has the leading shape of k."""

    friction_factor: NDArray[np.float64]  # ×(1 + 2 k1)
    backlash_factor: NDArray[np.float64]  # ×(1 + 99 k2)
    turns: NDArray[np.float64]  # (3, …), healthy fraction of turns N_A, N_B, N_C = 1 − k
    eccentricity: NDArray[np.float64]  # ζ = k6
    phase_rad: NDArray[np.float64]  # φ = 2π(k7 − ½)
    gain_factor: NDArray[np.float64]  # ×(0.5 + k8)


def physical(k: ArrayLike) -> PhysicalFaults:
    """The physical reading of k, (…, 8) → fields of shape (…)."""
    k = np.asarray(k, dtype=float)
    return PhysicalFaults(
        friction_factor=1.0 + 2.0 * k[..., 0],
        backlash_factor=1.0 + 99.0 * k[..., 1],
        turns=np.maximum(1.0 - np.moveaxis(k[..., 2:5], -1, 0), _LEAST_TURNS),
        eccentricity=k[..., 5] + 0.0,
        phase_rad=2.0 * np.pi * (k[..., 6] - 0.5),
        gain_factor=0.5 + k[..., 7],
    )


def factors(k: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What each of one k (8,) multiplies, and its derivative by k, (8,) each; NaN of the eccentricity."""
    read = physical(k)
    values = [read.friction_factor, read.backlash_factor, *read.turns, np.nan, np.nan, read.gain_factor]
    slopes = [2.0, 99.0, -1.0, -1.0, -1.0, np.nan, np.nan, 1.0]
    return np.array(values, dtype=float), np.array(slopes)


def vector(settings: dict[str, float]) -> NDArray[np.float64]:
    """k from some of its components by name, the others healthy; InputError outside [0, 1] or for other names."""
    k = HEALTHY.copy()
    for name, value in settings.items():
        if name not in NAMES:
            raise InputError(f"no fault {quoted(name)!r}; faults are k1 … k8{did_you_mean(name, NAMES)}")
        check_number(value, f"fault {name}")
        if not 0.0 <= value <= 1.0:  # also NaN
            raise InputError(f"fault {name} = {value:g} is outside 0 … 1")
        k[NAMES.index(name)] = value
    return k


def checked(k: ArrayLike) -> NDArray[np.float64]:
    """k (8,) as it is given; InputError for what is not 8 numbers, and outside [0, 1]."""
    try:
        found = np.asarray(k, dtype=float)
    except (TypeError, ValueError):
        found = np.empty(0)
    if found.shape != HEALTHY.shape:
        raise InputError(f"k must be 8 numbers, k1 … k8, not {quoted(repr(k), 60)}")
    return vector(dict(zip(NAMES, found.tolist())))


def named(k: ArrayLike) -> dict[str, float]:
    """The inverse of `vector`: the components of one k that are not healthy; k7, an angle, only beside a k6."""
    inside = zip(NAMES, np.clip(k, 0.0, 1.0))
    found = {name: float(value) for name, value in inside if value != BY_NAME[name].healthy}
    if "k6" not in found:
        found.pop("k7", None)
    return found


def error_percent(k: ArrayLike, truth: ArrayLike, *, wrap: bool = False) -> float:
    """Err % = 100 √([Σ_{1..6} Δk² + k6,true Δk7² + Δk8²] / 6.5) (T 5.2).

    With `wrap`, k7 is the angle that it is (0 and 1 are the same direction); without, as printed.
    """
    k, truth = np.asarray(k, dtype=float), np.asarray(truth, dtype=float)
    d = k - truth
    if wrap:
        d[6] -= np.round(d[6])
    return float(100.0 * np.sqrt((np.sum(d[:6] ** 2) + truth[5] * d[6] ** 2 + d[7] ** 2) / 6.5))


def performance_coefficient(error_percent: ArrayLike, elapsed_s: ArrayLike) -> NDArray[np.float64]:
    """PC % = 100 (1 − Err_i t_i / Σ_j Err_j t_j) over the algorithms compared (T 5.4); higher is better."""
    cost = np.asarray(error_percent, dtype=float) * np.asarray(elapsed_s, dtype=float)
    return 100.0 * (1.0 - cost / np.sum(cost))
