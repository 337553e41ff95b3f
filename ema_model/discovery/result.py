"""What a discovery finds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.comparison.error_in_floors import OverFloor
from ema_model.comparison.explain import Explanation
from ema_model.comparison.free_simulation import Simulated
from ema_model.comparison.loop_lag import LoopLag
from ema_model.comparison.regions import Event
from ema_model.discovery.criteria import FAR
from ema_model.discovery.observed.controller import ControllerSeen
from ema_model.discovery.observed.repeated import Repeated
from ema_model.discovery.observed.transmission import TransmissionSeen
from ema_model.discovery.observed.two_masses import TwoMasses
from ema_model.estimation import Calibrated, Calibration, Floor
from ema_model.estimation.model_fit import Data
from ema_model.models import Model
from ema_model.text import InWords

Array = NDArray[np.float64]

VERDICTS = (
    "effects_found",
    "adequate",
    "partly_explained",
    "unknown_effect",
    "not_converged",
    "not_repeatable",
    "uninformative",
    "interrupted",
)


@dataclass(frozen=True)
class Candidate:
    """One effect that might be missing, with its best settings so far; or a fault of the actuator, with its k."""

    name: str  # of a fault k1 … k8, of an eccentricity k6, which has k7 among its settings
    predicted_drop: float  # of χ², before any refit
    settings: dict[str, float]
    untestable_reason: str = ""
    refitted_drop: float | None = None  # of χ², where it was refitted
    cannot_represent: str = ""  # why the model has no place for it, whatever is recorded
    probability: float | None = None  # that this, of all candidates or none, is missing; None: ruled out

    @property
    def obstacle(self) -> str:
        """Why it is not tried, of the model or of the recordings, in words; "" where it may be."""
        if self.cannot_represent:
            return f"this model cannot represent it: {self.cannot_represent}"
        return self.untestable_reason

    @property
    def drop(self) -> float:
        """The fall of χ²: that of the refit, or the predicted one where there was none."""
        return self.predicted_drop if self.refitted_drop is None else self.refitted_drop


@dataclass(frozen=True)
class Change:
    """What a rung's model has beyond the one before.

    kind: "calibrated", "without_controller", "fault" (k1 … k8), "effect", "parameter" (its path: freed beyond its
    tolerance), "removed" (an effect or a fault), or "replaced" (an effect, and what came in its place); orders: of a
    periodic effect that was there already, at others.
    """

    kind: str = "calibrated"
    names: tuple[str, ...] = ()
    orders: tuple[float, ...] = ()


@dataclass(frozen=True)
class Rung:
    """One step of the error ladder, in units of the floor: 1 is the floor."""

    change: Change
    rmse: float
    holdout_rmse: float | None
    signals: dict[str, float]  # rms by signal, in its unit
    holdout_signals: dict[str, float]  # the same of what was held out
    signals_per_window: Sequence[dict[str, Array]]  # the fitted model's, (blocks,) each
    recordings: dict[str, float] = field(default_factory=dict)  # `rmse` of each recording by name
    holdout_recordings: dict[str, float] = field(default_factory=dict)  # the same of what was held out


@dataclass(frozen=True)
class StoodIn:
    """A calibrated parameter that moved back as an effect was added: it had masked the effect."""

    path: str
    before: float  # σ from the file's value
    after: float


@dataclass(frozen=True)
class Added:
    """An effect that was added."""

    name: str
    parameters: dict[str, Calibrated]
    rmse_before: float
    rmse_after: float
    holdout_before: float | None
    holdout_after: float | None
    same_as: tuple[str, ...]  # effects and faults that this recording cannot tell from it
    key: str  # under which the model holds it: `name`, or `name_2` for a second order of the same
    chosen: dict[str, float] = field(default_factory=dict)  # parameters that are not fitted: a whole order
    stood_in: tuple[StoodIn, ...] = ()  # parameters that had been standing in for it
    supported_by: tuple[str, ...] = ()  # of "closed_loop" and "inverse_dynamics"
    stands_for: str = ""  # the path of the base parameter whose value outside its tolerance it is
    of_the_file: bool = False  # whether the file has it, at other values
    probability: float | None = None  # that it, or what cannot be told from it, is missing; None: not known


@dataclass(frozen=True)
class Experiment:
    """A test to do next, and what it would separate."""

    command: str
    settings: dict[str, float]
    duration_s: float
    load_torque_Nm: float  # at the user
    add_signal: str | None  # to record as well
    separates: tuple[str, str]
    expected_chi2: float


@dataclass(frozen=True)
class Contradiction:
    """A held-out recording at odds with the fitted ones."""

    recording: str
    signal: str | None  # whose reading explains it, by its name inside
    how: str  # "sign", "zero", "unit", "actuator" or "unknown"
    sentence: str
    before: float  # its error, in floors
    after: float  # the same once that is put right


def errors_of(ladder: Sequence[Rung], one: Added) -> dict[str, float | None]:
    """The errors before and after the last step of a ladder that added an effect, as fields of `Added`."""
    steps = [i for i, rung in enumerate(ladder) if i and _adds(rung.change, one.name, one.stands_for)]
    if not steps:
        return {}
    after, first = ladder[steps[-1]], steps[-1]
    while ladder[first].change.kind == "replaced":  # what it came in the place of had taken its part before
        name = ladder[first].change.names[0]
        earlier = [i for i in range(1, first) if _adds(ladder[i].change, name)]
        if not earlier:
            break
        first = earlier[-1]
    before = ladder[first - 1]
    return {
        "rmse_before": before.rmse,
        "rmse_after": after.rmse,
        "holdout_before": before.holdout_rmse,
        "holdout_after": after.holdout_rmse,
    }


def _adds(change: Change, name: str, stands_for: str = "") -> bool:
    """Whether a step adds that effect, or frees the parameter that it stands for."""
    if change.kind == "replaced":
        return change.names[1] == name
    if change.kind == "parameter":
        return bool(stands_for) and stands_for in change.names
    return change.kind == "effect" and name in change.names


def misses_unseen(last: Rung, disagreements: Sequence[Contradiction]) -> bool:
    """Whether a model is far off what was not fitted, and that has no other sign, zero, unit or actuator to blame."""
    unseen = last.holdout_rmse
    return unseen is not None and unseen > FAR and all(one.how == "unknown" for one in disagreements)


@dataclass(frozen=True, eq=False, repr=False)
class Discovery(InWords):
    """The verdict, and all that led to it."""

    verdict: str
    calibration: Calibration  # of the last model
    effects: Sequence[Added]
    ladder: Sequence[Rung]
    candidates: Sequence[Candidate]  # of the first search, best first
    parameters_outside_tolerance: Sequence[str]
    actuator: Actuator  # with the effects, as calibrated
    plant: Model  # the recordings as they were fitted: windows with their blocks
    floors: Sequence[Floor]  # of its windows
    data: Data  # what was fitted
    at_floor: bool = False  # whether what is left may be noise and the model's own floor
    held: Data | None = None  # and what was held out
    faults: Mapping[str, Calibrated] = field(default_factory=dict)  # k1 … k8 in the last model
    unknown: Explanation | None = None
    curve: Added | None = None  # the torque curve that was added for what is unknown
    next_experiment: Experiment | None = None
    not_claimed: Mapping[str, str] = field(default_factory=dict)  # effects that the data would pay for, and why not
    warnings: Sequence[str] = field(default_factory=tuple)
    controller_seen: ControllerSeen | None = None  # where the drive's controller is not the file's
    loop_lag: LoopLag | None = None  # likewise, where the position follows its command another way than the file's
    transmission_seen: TransmissionSeen | None = None  # where no model covers it and it is not the file's
    two_masses_seen: TwoMasses | None = None  # where a second mass swings on the motor's and no model holds it
    disagreements: Sequence[Contradiction] = field(default_factory=tuple)  # held-out recordings at odds with the fitted
    repeated: Repeated | None = None  # where a command was recorded twice
    events: Sequence[Event] = field(default_factory=tuple)  # what happened at one moment of a recording
    simulation: Mapping[str, Simulated] = field(default_factory=dict)  # of the last model running freely, by signal
    freed: Sequence[Added] = field(default_factory=tuple)  # effects that are a base parameter's value beyond tolerance

    @property
    def floor_band(self) -> tuple[float, float]:
        """Multiples of the floor, between which nine of ten true models' errors lie."""
        return self.data.floor_band

    @property
    def in_floors(self) -> OverFloor:
        """The error of the last model, with its band."""
        return OverFloor(self.ladder[-1].rmse, self.floor_band)

    @property
    def unseen(self) -> OverFloor | None:
        """The same of what was held out; None without any."""
        error = self.ladder[-1].holdout_rmse
        return None if self.held is None or error is None else OverFloor(error, self.held.floor_band)

    @property
    def is_within_band(self) -> bool:
        """Whether neither is above its band, where errors may be counted in floors at all."""
        told = [one for one in (self.in_floors, self.unseen) if one is not None and self.floor_believable]
        return not any(one.is_above for one in told)

    @property
    def floor_believable(self) -> bool:
        """Whether errors may be counted in floors: nothing that was recorded twice says otherwise."""
        return self.repeated is None or self.repeated.floor_believable

    @property
    def ranked(self) -> list[Candidate]:
        """Best first: by how probable they are, or what a refit gave, then by what was predicted; obstacles last."""
        return sorted(
            self.candidates,
            key=lambda one: (bool(one.obstacle), -(one.probability or 0.0), one.refitted_drop is None, -one.drop),
        )
