"""What was found in comparing units: in what which of them differ, how they are of a type, which model suits which."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.quantities.interval import HALF_90
from ema_model.text import InWords
from ema_model.units.criteria import MISFIT

Array = NDArray[np.float64]
Interval = tuple[float, float]


@dataclass(frozen=True)
class Difference:
    """A parameter in which one unit is not as the others; every interval holds 90 %."""

    unit: str
    parameter: str  # "section.parameter"
    alike: tuple[str, ...]  # other parameters of the unit that would tell it as well
    change: float  # from what the others share, in the parameter's unit
    change90: Interval
    share: float | None  # the change over what the others share; None where that is 0
    share90: Interval | None
    evidence: float  # of −2 log likelihood, by which sharing it is worse
    held_out: float | None  # the same on recordings that were not fitted; None without any

    @property
    def together(self) -> tuple[str, ...]:
        """The parameters that are known as one, that one first."""
        return (self.parameter, *self.alike)


@dataclass(frozen=True)
class OfType:
    """A parameter of the type."""

    mean: float
    mean90: Interval
    scatter: float  # 1 σ over units, in the parameter's unit; 0 where all share it
    sigma: float  # 1 σ of a further unit: scatter and what is not known of the mean
    unit: str
    told: bool  # whether the recordings tell it at all: else it is as the file says


@dataclass(frozen=True)
class OfRecording:
    """In what one recording disagrees with the others of its unit: freed for it, and no difference between units."""

    unit: str
    recording: str
    quantity: str  # "current_zero", "current_delay" or "winding_temperature"
    value: float
    value90: Interval
    in_unit: str  # "A", "s" or "K"
    allowed_for: bool  # else nothing is told of what the unit differs in


@dataclass(frozen=True, eq=False)
class Alone:
    """A parameter of each unit as its own recordings tell it, the others' values aside."""

    value: Array  # (units,), in the parameter's unit
    sigma: Array  # (units,), 1 σ of it; the file's tolerance where nothing is told

    def interval90(self, unit: int) -> Interval:
        """Of one unit, by its place."""
        half = HALF_90 * float(self.sigma[unit])
        return float(self.value[unit]) - half, float(self.value[unit]) + half


@dataclass(frozen=True, eq=False)
class Transfer:
    """Each unit's own model on each unit's recordings."""

    signal: str
    error: Array  # (model of, recordings of), rms in the signal's unit
    floor: Array  # (recordings of,), rms
    floors: Array  # (model of, recordings of): all signals' error in floors


@dataclass(frozen=True)
class Need:
    """A parameter that a unit's recordings do not tell."""

    unit: str
    parameter: str
    recording: str  # of another unit, which tells it there; empty where no unit's recordings do


@dataclass(frozen=True, repr=False, eq=False)
class UnitsCompared(InWords):
    """The answer."""

    actuator: Actuator  # as its file says
    units: tuple[str, ...]
    recordings: tuple[tuple[str, ...], ...]  # names, fitted, of each unit
    held_out: tuple[tuple[str, ...], ...]
    differences: tuple[Difference, ...]
    dropped: tuple[Difference, ...]  # that held-out recordings contradict
    of_recordings: tuple[OfRecording, ...]
    of_type: dict[str, OfType]
    alone: dict[str, Alone]  # by parameter, as `of_type`
    transfer: Transfer
    needs: tuple[Need, ...]
    errors: Array  # (units,), of each unit's own model, in floors
    type_actuator: Actuator  # with the type's values and tolerances
    warnings: tuple[str, ...]

    @property
    def is_missed(self) -> bool:
        """Whether a unit's own model leaves far more than the floor."""
        return bool(np.any(self.errors > MISFIT))

    @property
    def scattering(self) -> list[str]:
        """Parameters that scatter over all units."""
        return [path for path, one in self.of_type.items() if one.scatter > 0.0]
