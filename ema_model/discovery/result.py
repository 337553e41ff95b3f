"""What a discovery finds: its verdict, the ladder of its steps, the candidates, and all that was seen beside."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.parameters import on_axes
from ema_model.comparison.explain import Explanation
from ema_model.comparison.free_simulation import FreeError, Simulated, errors_in_units
from ema_model.comparison.loop_lag import LoopLag
from ema_model.comparison.regions import Event
from ema_model.comparison.residuals import OverFloor
from ema_model.discovery.loop import ControllerSeen, Repeated
from ema_model.discovery.thresholds import FAR
from ema_model.discovery.transmission import TransmissionSeen, TwoMasses
from ema_model.effects import CATALOGUE, find
from ema_model.errors import InputError
from ema_model.estimation import Calibrated, Calibration, Floor
from ema_model.estimation.calibrate import KnownTogether, combinations
from ema_model.estimation.model_fit import Data
from ema_model.faults import BY_NAME
from ema_model.models import Model
from ema_model.quantities import Axes, all_of, amount, in_sentence
from ema_model.result import FLAT, NAME, NULL, Result, as_named

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


_RMSE = "rms error pooled over signals, in units of the floor; 1 is the floor"
_FAULT = "fault"  # in place of the family of a candidate that is one


@dataclass(frozen=True)
class Candidate:
    """An effect that might be missing, with its best settings so far; or a fault of the actuator, with its k."""

    name: Annotated[  # of an eccentricity k6, which has k7 among its settings
        str, Meta(description="of the effect, or k1 … k8")
    ]
    predicted_drop: Annotated[float, Meta(description="of χ², before any refit", extra=NULL)]
    settings: dict[str, float]
    untestable_reason: Annotated[str, Meta(description="why these recordings cannot show it; empty where they can")] = (
        ""
    )
    refitted_drop: Annotated[float | None, Meta(description="of χ², by the refit; null: it was not refitted")] = None
    cannot_represent: Annotated[  # whatever is recorded
        str, Meta(description="why this model has no place for it; empty where it has one")
    ] = ""
    probability: Annotated[
        float | None,
        Meta(description="that this, or an effect that has it among same_as, is missing; null: ruled out"),
    ] = None

    @property
    def family(self) -> Annotated[str, Meta(description="mechanics, electrics, sensor, drive, or fault")]:
        """As the library has it."""
        return _FAULT if self.name in BY_NAME else find(self.name).family

    @property
    def tested(self) -> Annotated[bool, Meta(description="whether it was refitted")]:
        """By the search."""
        return self.refitted_drop is not None

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

    kind: Annotated[
        str,
        Meta(description="calibrated, without_controller, fault, effect, parameter (freed), removed or replaced"),
    ] = "calibrated"
    names: Annotated[tuple[str, ...], Meta(description="of the effects, faults or parameters", extra=NAME)] = ()
    orders: Annotated[
        tuple[float, ...], Meta(description="of a periodic effect that was there at others, per revolution")
    ] = ()


@dataclass(frozen=True)
class Rung:
    """One step of the error ladder, in units of the floor: 1 is the floor."""

    change: Change
    rmse: float
    holdout_rmse: float | None
    signals: Annotated[dict[str, float], Meta(description="rms error by signal, in its unit", extra=NULL)]
    holdout_signals: Annotated[dict[str, float], Meta(description="the same of what was not fitted", extra=NULL)]
    signals_per_window: Sequence[dict[str, Array]]  # the fitted model's, (blocks,) each
    recordings: Annotated[  # by name
        dict[str, float], Meta(description="rmse of each fitted recording, in floors", extra=NULL)
    ] = field(default_factory=dict)
    holdout_recordings: Annotated[dict[str, float], Meta(description="the same of what was not fitted", extra=NULL)] = (
        field(default_factory=dict)
    )


@dataclass(frozen=True)
class StoodIn:
    """A calibrated parameter that moved back as an effect was added: it had masked the effect."""

    path: str
    before: float  # σ from the file's value
    after: float


@dataclass(frozen=True)
class Added:
    """An effect that was added to the model."""

    name: Annotated[str, Meta(description="as `emaviz effects` lists it")]
    parameters: dict[str, Calibrated]
    rmse_before: Annotated[float, Meta(description=f"without it: {_RMSE}", extra=NULL)]
    rmse_after: Annotated[float, Meta(description="with it, likewise", extra=NULL)]
    holdout_before: Annotated[
        float | None, as_named("holdout_rmse_before", "of what was not fitted, without it; null: nothing")
    ]
    holdout_after: Annotated[
        float | None, as_named("holdout_rmse_after", "of what was not fitted, with it; null: nothing")
    ]
    same_as: Annotated[
        tuple[str, ...], Meta(description="effects and faults that these recordings cannot tell from it")
    ]
    key: str  # under which the model holds it: `name`, or `name_2` for a second order of the same
    chosen: Annotated[dict[str, float], Meta(description="parameters that were not fitted, as a whole order")] = field(
        default_factory=dict
    )
    stood_in: tuple[StoodIn, ...] = ()  # parameters that had been standing in for it
    supported_by: Annotated[
        tuple[str, ...], Meta(description="the models that bear it out: closed_loop, inverse_dynamics")
    ] = ()
    stands_for: str = ""  # the path of the base parameter whose value outside its tolerance it is
    of_the_file: bool = False  # whether the file has it, at other values
    probability: Annotated[float | None, Meta(description="that it, or one of same_as, is missing; null: a curve")] = (
        None
    )

    @property
    def family(self) -> Annotated[str, Meta(description="mechanics, electrics, sensor or drive")]:
        """As the library has it."""
        return find(self.name).family


@dataclass(frozen=True)
class Experiment:
    """A test to do next, and what it would separate."""

    command: Annotated[str, Meta(description="as of `emaviz simulate --command`")]
    settings: dict[str, float]
    duration_s: float
    load_torque_Nm: Annotated[float, as_named("load", "N·m at the user (N on a linear axis), against positive motion")]
    add_signal: Annotated[str | None, Meta(description="a signal to record as well")]
    separates: Annotated[tuple[str, str], Meta(description="the two effects that it tells apart")]
    expected_chi2: Annotated[float, Meta(description="by which the wrong one of them would fit worse", extra=NULL)]

    @property
    def asked(
        self,
    ) -> Annotated[dict[str, float], as_named("settings", "of the command, as of --set, and duration_s, s")]:
        """Settings with the duration."""
        return {**self.settings, "duration_s": self.duration_s}


@dataclass(frozen=True)
class Contradiction:
    """A held-out recording that contradicts the fitted ones."""

    recording: Annotated[str, Meta(description="its name")]
    signal: Annotated[str | None, Meta(description="whose reading explains it", extra=NAME)]
    how: Annotated[str, Meta(description="sign, zero, unit, actuator or unknown")]
    sentence: Annotated[str, Meta(description="the same in words")]
    before: Annotated[float, Meta(description="its rms error, in floors", extra=NULL)]
    after: Annotated[float, Meta(description="the same once that is put right", extra=NULL)]


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


# --- what the parts of a discovery are called -------------------------------------------------------------------------

_FAULTS = {"k6": "Rotor eccentricity"}  # that are called otherwise than their number: with its phase it is one cause
SIGNS = {"effect": "+", "removed": "−"}


def effect_title(name: str) -> str:
    """'Cogging torque' of 'cogging_torque'; the name itself of an effect that is not known here.

    Of a fault 'Backlash (fault k2)', since effects have names like its title.
    """
    if name in BY_NAME:
        return f"{_FAULTS.get(name, BY_NAME[name].title)} (fault {name})"
    try:
        return find(name).title
    except InputError:
        return name


def rung_label(one: Change, axes: Axes) -> str:
    """'+ cogging_torque of orders 28, 14', by the library's names: for the terminal and JSON."""
    if one.kind == "fault":
        return f"fault {all_of([BY_NAME[name].label for name in one.names])}"
    if one.kind == "parameter":
        return f"{on_axes(one.names[0], axes).path} outside its tolerance"
    if one.kind == "replaced":
        return f"{one.names[1]} in place of {one.names[0]}"
    if one.kind == "without_controller":
        return "calibrated, without the controller"
    if one.kind == "calibrated":
        return one.kind
    if one.names[0] in BY_NAME:
        return f"{SIGNS[one.kind]} fault {all_of([BY_NAME[name].label for name in one.names])}"
    names = [name if name in CATALOGUE else in_sentence(effect_title(name)) for name in one.names]
    return f"{SIGNS[one.kind]} {all_of(names)}{of_orders(one.orders, axes)}"


def of_orders(orders: Sequence[float], axes: Axes) -> str:
    """' of orders 28, 14', ' of order 24', or along a linear motor ' of pitches 2.50 mm, 417 µm'; '' of none."""
    if not orders:
        return ""
    several = len(orders) > 1
    if axes.motor == "linear":
        pitches = ", ".join(amount(2.0 * math.pi / order, "m") for order in orders)
        return f" of {'pitches' if several else 'pitch'} {pitches}"
    return f" of {'orders' if several else 'order'} {', '.join(f'{order:g}' for order in orders)}"


def masked(added: Sequence[Added], axes: Axes) -> list[str]:
    """One line for each effect that parameters of the model had been standing in for, and where they are now."""
    moved: dict[str, dict[str, tuple[float, float]]] = {}  # by effect: at several orders it is one
    for one in added:
        parts = moved.setdefault(one.name, {})
        for part in one.stood_in:
            if part.path != one.stands_for:
                parts[part.path] = parts.get(part.path, (part.before, part.after))[0], part.after
    return [f"{find(name).title} had been masked by {_moved(parts, axes)}." for name, parts in moved.items() if parts]


def _moved(parts: Mapping[str, tuple[float, float]], axes: Axes) -> str:
    """'motor torque constant (−2.5 → −0.4 σ), now nearer to its nominal value'."""
    ends = {path: [f"{round(end, 1) + 0.0:+.1f}".replace("-", "−") for end in both] for path, both in parts.items()}
    told = [f"{in_sentence(on_axes(path, axes).title)} ({a} → {b} σ)" for path, (a, b) in ends.items()]
    return f"{all_of(told)}, now nearer to {'its nominal value' if len(told) == 1 else 'their nominal values'}"


# --- what the JSON form tells of parts, by the names in files ---------------------------------------------------------


@dataclass(frozen=True)
class AddedInFile:
    """An effect that was added, with its parameters as the last model has them."""

    added: Annotated[Added, Meta(extra=FLAT)]
    parameters: Annotated[
        dict[str, Calibrated],
        Meta(description="by their names in the actuator's file; one that was chosen is what it began with"),
    ]


def in_file(one: Added, axes: Axes, last: Mapping[str, Calibrated] | None = None) -> AddedInFile:
    """last: a model's fitted parameters, by path: later effects may have moved them."""
    paths = {name: f"effects.{one.key}.{name}" for name in (*one.parameters, *one.chosen)}
    known = {name: (last or {}).get(paths[name], fitted) for name, fitted in one.parameters.items()}
    known |= {name: Calibrated(v, v, (v, v), "", z=0.0, at_bound=False) for name, v in one.chosen.items()}
    return AddedInFile(one, {on_axes(paths[name], axes).name: fitted for name, fitted in known.items()})


@dataclass(frozen=True)
class LadderStep:
    """One step of the error ladder."""

    label: Annotated[str, Meta(description="what was changed, in words")]
    change: Annotated[Change, Meta(extra=FLAT)]
    rmse: Annotated[float | None, Meta(description=f"{_RMSE}; null: the floor is not to be believed")]
    holdout_rmse: Annotated[float | None, Meta(description="the same of what was not fitted; null: nothing")]
    errors: Annotated[Rung, Meta(extra=FLAT)]


@dataclass(frozen=True)
class RankedCandidate:
    """An effect, or a fault, that might be missing."""

    candidate: Annotated[Candidate, Meta(extra=FLAT)]
    settings: Annotated[dict[str, float], Meta(description="its best settings, by the names in files", extra=NULL)]


@dataclass(frozen=True, eq=False)
class Unexplained:
    """What the last model leaves, as a curve of one variable times a modulator."""

    explanation: Annotated[Explanation, Meta(extra=FLAT)]
    curve: Annotated[
        Array,
        Meta(
            description="rows of the variable, the mean residual there and its standard error, in SI units",
            extra={"dimensions": 2},
        ),
    ]
    added: Annotated[AddedInFile | None, Meta(description="the torque curve that stands for it in the model, if any")]


@dataclass(frozen=True)
class Remaining:
    """What the last model leaves."""

    rmse: Annotated[float | None, Meta(description=f"{_RMSE}; null: the floor is not to be believed")]
    at_floor: Annotated[bool, Meta(description="whether it may be noise and the model's own floor")]
    within_band: Annotated[
        bool | None,
        Meta(description="whether neither it nor the error of what was held out is above its band"),
    ]


# --- the whole --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, repr=False)
class Discovery(Result):
    """Which physical effects the model of one actuator lacks: the verdict, and all that led to it."""

    verdict: Annotated[str, Meta(description=f"one of {', '.join(VERDICTS)}")]
    calibration: Annotated[Calibration, Meta(description="of the last model")]
    effects: Sequence[Added]
    ladder: Sequence[Rung]
    candidates: Sequence[Candidate]  # of the first search, best first
    parameters_outside_tolerance: Annotated[
        Sequence[str], Meta(description="section.name, beyond their tolerance", extra=NAME)
    ]
    actuator: Actuator  # with the effects, as calibrated
    plant: Model  # the recordings as they were fitted: windows with their blocks
    floors: Sequence[Floor]  # of its windows
    data: Data  # what was fitted
    at_floor: bool = False  # whether what is left may be noise and the model's own floor
    held: Data | None = None  # and what was held out
    faults: Annotated[Mapping[str, Calibrated], Meta(description="k1 … k8 that the last model has, 0 … 1")] = field(
        default_factory=dict
    )
    unknown: Explanation | None = None
    curve: Added | None = None  # the torque curve that was added for what is unknown
    next_experiment: Annotated[Experiment | None, Meta(description="that tells the rivals apart; null: none")] = None
    not_claimed: Annotated[Mapping[str, str], Meta(description="effects that the data would pay for, and why not")] = (
        field(default_factory=dict)
    )
    warnings: Sequence[str] = ()
    controller_seen: Annotated[  # where the drive's controller is not the file's
        ControllerSeen | None, Meta(description="what it is instead")
    ] = None
    loop_lag: LoopLag | None = None  # likewise, where the position follows its command another way than the file's
    transmission_seen: Annotated[  # where no model covers it
        TransmissionSeen | None, Meta(description="where it is not the file's")
    ] = None
    two_masses_seen: Annotated[  # where no model holds it
        TwoMasses | None, Meta(description="where the motor shows a second mass")
    ] = None
    disagreements: Annotated[
        Sequence[Contradiction], Meta(description="held-out recordings at odds with the fitted")
    ] = ()
    repeated: Annotated[Repeated | None, as_named("repeatability", "null: no command was recorded twice")] = None
    events: Annotated[Sequence[Event], Meta(description="what happened at one moment")] = ()
    simulation: Mapping[str, Simulated] = field(default_factory=dict)  # of the last model running freely, by signal
    freed: Sequence[Added] = field(default_factory=tuple)  # effects that are a base parameter's value beyond tolerance

    def name_in_files(self, name: str) -> str:
        """A signal's, or a parameter's path."""
        axes = self.actuator.axes
        return on_axes(name, axes).path if "." in name else axes.signal(name)

    @property
    def floor_band(
        self,
    ) -> Annotated[tuple[float, float], Meta(description="between which rmse of nine of ten true models lies")]:
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
    def floor_believable(self) -> Annotated[bool, Meta(description="whether errors may be counted in floors")]:
        """Whether errors may be counted in floors: nothing that was recorded twice says otherwise."""
        return self.repeated is None or self.repeated.floor_believable

    @property
    def ranked(self) -> list[Candidate]:
        """Best first: by how probable they are, what is named before its rivals; then by their fall; obstacles last."""
        named = {one.name for one in (*self.effects, *self.freed)}
        return sorted(
            self.candidates,
            key=lambda one: (
                bool(one.obstacle),
                -(one.probability or 0.0),
                one.name not in named,
                one.refitted_drop is None,
                -one.drop,
            ),
        )

    # --- as the JSON form has it --------------------------------------------------------------------------------------

    @property
    def identifiable(
        self,
    ) -> Annotated[list[KnownTogether], Meta(description="what the recordings tell only together")]:
        """Of the calibration."""
        return combinations(self.calibration.identifiable, self.actuator.axes)

    @property
    def added_in_file(
        self,
    ) -> Annotated[list[AddedInFile], as_named("effects", "that are missing, in the order in which they were added")]:
        """The effects with their last values."""
        return [in_file(one, self.actuator.axes, self.calibration.parameters) for one in self.effects]

    @property
    def steps(self) -> Annotated[list[LadderStep], as_named("ladder", "the error after each change of the model")]:
        """The ladder with its labels."""
        errors = [(one.rmse, one.holdout_rmse) if self.floor_believable else (None, None) for one in self.ladder]
        return [
            LadderStep(rung_label(one.change, self.actuator.axes), one.change, *error, one)
            for one, error in zip(self.ladder, errors)
        ]

    @property
    def free_errors(
        self,
    ) -> Annotated[
        dict[str, FreeError],
        as_named(
            "simulation",
            "of the last model running freely, driven by the command, or in open loop; by signal",
        ),
    ]:
        """Of `simulation`, by signal."""
        return errors_in_units(self.simulation)

    @property
    def ranking(
        self,
    ) -> Annotated[list[RankedCandidate], as_named("candidates", "all effects of the first search, best first")]:
        """Candidates by rank; a fault's settings are k."""
        axes = self.actuator.axes
        return [
            RankedCandidate(
                one,
                {
                    name if one.name in BY_NAME else on_axes(f"effects.{one.name}.{name}", axes).name: value
                    for name, value in one.settings.items()
                },
            )
            for one in self.ranked
        ]

    @property
    def left_unexplained(
        self,
    ) -> Annotated[Unexplained | None, as_named("unknown", "what no effect explains; null: nothing that is told")]:
        """The explanation with its curve."""
        if self.unknown is None:
            return None
        curve = np.column_stack([self.unknown.centres, self.unknown.curve, self.unknown.error])
        stands = self.curve
        last = self.calibration.parameters
        return Unexplained(self.unknown, curve, None if stands is None else in_file(stands, self.actuator.axes, last))

    @property
    def holdout_floor_band(
        self,
    ) -> Annotated[tuple[float, float] | None, Meta(description="floor_band of what was held out; null: none")]:
        """As `unseen` has it."""
        return None if self.unseen is None else self.unseen.band

    @property
    def remaining(self) -> Annotated[Remaining, Meta(description="the error of the last model")]:
        """What the last model leaves."""
        if not self.floor_believable:
            return Remaining(None, self.at_floor, None)
        return Remaining(self.in_floors.error, self.at_floor, self.is_within_band)

    @property
    def controller_mismatch(
        self,
    ) -> Annotated[bool, Meta(description="whether the drive's controller is not the file's")]:
        """By its current, or by how the position follows its command."""
        return self.controller_seen is not None or self.loop_lag is not None

    @property
    def to_be_read_with(
        self,
    ) -> Annotated[list[str], as_named("warnings", "what the answer must be read with")]:
        """Warnings, and what had been masked."""
        return [*self.warnings, *masked(self.effects, self.actuator.axes)]
