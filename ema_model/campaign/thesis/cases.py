"""The eleven actuators on which the thesis judges its algorithms (T 5.0.1, T 5.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model import faults
from ema_model.identification.run import ROBUST

ALGORITHMS = {"ssa": "SSA", "hba": "HBA", "do": "DOA"}  # by our name, the thesis's
EVERY = (*ALGORITHMS, ROBUST)
MULTIPLE = "multiple"
FAULTS = {  # those that stand alone, with the k that tells each
    "friction": "k1",
    "backlash": "k2",
    "short_circuit": "k3",
    "eccentricity": "k6",
    "gain": "k8",
}
TITLES = {
    "friction": "Friction",
    "backlash": "Backlash",
    "short_circuit": "Short circuit",
    "eccentricity": "Eccentricity",
    "gain": "Gain",
    MULTIPLE: "Several at once",
}


@dataclass(frozen=True)
class Case:
    """One of the eleven."""

    name: str
    title: str
    fault: str  # of TITLES
    settings: dict[str, float]

    @property
    def k(self) -> NDArray[np.float64]:
        """(8,)"""
        return faults.vector(self.settings)

    @property
    def main(self) -> str:
        """The k that is told of it; of several faults the gain, which moves the current most."""
        return FAULTS.get(self.fault, "k8")


_T_5_3 = {"k1": 0.0133, "k2": 0.05, "k3": 0.003, "k6": 0.012, "k8": 0.35}
CASES: tuple[Case, ...] = (
    *(
        Case(f"{fault}_{size}", f"{TITLES[fault]}, {size}: {name} = {value:g}", fault, {name: value})
        for fault, name in FAULTS.items()
        for size, value in (("low", 0.25), ("high", 0.75))
    ),
    Case(MULTIPLE, "Several at once (T 5.3)", MULTIPLE, _T_5_3),
)
BY_NAME = {case.name: case for case in CASES}


def case_of(k_true: ArrayLike) -> Case | None:
    """The one with these true k (8,); None for another."""
    k = np.asarray(k_true, dtype=float)
    return next((case for case in CASES if np.allclose(case.k, k, rtol=0.0, atol=1e-9)), None)
