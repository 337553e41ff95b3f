"""A discovery in words: sentences, tables, labels, JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, NotRequired, TypedDict

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.actuator import sentences as phrases_of
from ema_model.actuator.parameters import on_axes
from ema_model.comparison.criteria import BAND
from ema_model.comparison.free_simulation import FreeError, errors_in_units
from ema_model.comparison.loop_lag import BLAMED, LoopLag
from ema_model.comparison.regions import Event
from ema_model.comparison.residuals import dependence
from ema_model.comparison.result import free_simulation
from ema_model.comparison.verdict import ORDER_OF_PRIMARY
from ema_model.discovery.criteria import FAR
from ema_model.discovery.observed.controller import ControllerSeen
from ema_model.discovery.result import VERDICTS, Added, Candidate, Change, Discovery, Experiment, Rung, misses_unseen
from ema_model.discovery.verify import Verified
from ema_model.effects import CATALOGUE, find
from ema_model.effects.effect import FAMILIES
from ema_model.errors import InputError
from ema_model.estimation import Calibrated, Calibration
from ema_model.estimation.calibrate import KnownTogether, combinations, together
from ema_model.faults import BY_NAME, FAULTS, NAMES, cause_of, causes, vector
from ema_model.quantities.axes import Axes, of_signal
from ema_model.quantities.numbers import IntervalJson, Quantity, amount, number, plain, with_uncertainty
from ema_model.quantities.sides import USER
from ema_model.quantities.titles import all_of, in_sentence
from ema_model.result import json_form, json_type
from ema_model.simulation.run import run_in_words
from ema_model.text import Document, Facts, Lines, Note, Table

# --- what the parts of a discovery are called: effects, steps of the ladder, fitted values ----------------------------

_FAULTS = {"k6": "Rotor eccentricity"}  # that are called otherwise than their number: with its phase it is one cause
_SIGNS = {"effect": "+", "removed": "−"}


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


def rung_title(one: Change, axes: Axes) -> str:
    """'+ Cogging torque'."""
    if one.kind in _SIGNS:
        names = [name for name in one.names if name not in BY_NAME or name == cause_of(name)[0]]
        return f"{_SIGNS[one.kind]} {all_of([effect_title(name) for name in names])}{_of_orders(one.orders, axes)}"
    if one.kind == "parameter":
        return f"{on_axes(one.names[0], axes).title} freed"
    if one.kind == "replaced":
        before, after = (effect_title(name) for name in one.names)
        return f"{after} in place of {in_sentence(before)}"
    if one.kind == "fault":  # a phase belongs to its modulus
        return f"Fault {all_of([BY_NAME[name].label for name in causes(one.names)])}"
    label = rung_label(one, axes)
    return label[:1].upper() + label[1:]


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
        return f"{_SIGNS[one.kind]} fault {all_of([BY_NAME[name].label for name in one.names])}"
    names = [name if name in CATALOGUE else in_sentence(effect_title(name)) for name in one.names]
    return f"{_SIGNS[one.kind]} {all_of(names)}{_of_orders(one.orders, axes)}"


def _of_orders(orders: Sequence[float], axes: Axes) -> str:
    """' of orders 28, 14', ' of order 24', or along a linear motor ' of pitches 2.50 mm, 417 µm'; '' of none."""
    if not orders:
        return ""
    several = len(orders) > 1
    if axes.motor == "linear":
        pitches = ", ".join(amount(2.0 * math.pi / order, "m") for order in orders)
        return f" of {'pitches' if several else 'pitch'} {pitches}"
    return f" of {'orders' if several else 'order'} {', '.join(f'{order:g}' for order in orders)}"


def value(one: Calibrated) -> str:
    """'12.2 ± 0.70 mN·m': with half of the 90 % interval; its ends where physics cuts them."""
    if one.cut:
        shown = Quantity("", one.unit).scaled([one.value, *one.interval90])
        middle, low, high = (number(shown.factor * each) for each in (one.value, *one.interval90))
        return f"{middle} ({low} … {high}, cut at its physical limit) {shown.unit}".rstrip()
    half = 0.5 * (one.interval90[1] - one.interval90[0])
    return with_uncertainty(one.value, half, one.unit)


def settings(found: Discovery, one: Added) -> dict[str, str]:
    """Each parameter of an added effect with its value; whole numbers, which are chosen and not fitted, first."""
    chosen = {name: f"{setting:g}" for name, setting in one.chosen.items()}
    return chosen | {name: value(fitted_of(found, one, name)) for name in one.parameters}


def fitted_of(found: Discovery, one: Added, name: str) -> Calibrated:
    """A fitted parameter of an added effect as the last model has it: later effects may have moved it."""
    return found.calibration.parameters.get(f"effects.{one.key}.{name}", one.parameters[name])


# --- the fitted recordings of a discovery as lines over time: measured, the model of each step, and the floor ---------

Array = NDArray[np.float64]

PAUSE_S = 0.2  # between runs that each start anew, so that one is seen to end


@dataclass(frozen=True, eq=False)
class Track:
    """One recording; all arrays are (blocks,)."""

    name: str
    time_s: Array  # increasing: a run that starts anew follows the one before
    measured: dict[str, Array]
    models: list[dict[str, Array]]  # of each step of the ladder
    sigma: dict[str, Array]  # what a perfect model would leave

    def residual(self, signal: str, step: int) -> Array:
        """Measured − model of that step of the ladder."""
        return self.measured[signal] - self.models[step][signal]


def primary(found: Discovery) -> str:
    """The signal whose residual tells most: the current where it was fitted."""
    fitted = found.ladder[0].signals
    return next((name for name in ORDER_OF_PRIMARY if name in fitted), next(iter(fitted)))


def tracks(found: Discovery) -> list[Track]:
    """A track for each fitted recording, in their order, with the signals that were fitted."""
    floors = found.floors
    windows = found.plant.windows
    joined = []
    for recording in dict.fromkeys(window.recording for window in windows):
        parts = [i for i, window in enumerate(windows) if window.recording == recording]
        names = [name for name in found.ladder[0].signals if all(name in windows[i].measured for i in parts)]
        joined.append(
            Track(
                windows[parts[0]].name,
                _onward([windows[i].time_s for i in parts]),
                {name: np.concatenate([windows[i].measured[name] for i in parts]) for name in names},
                [
                    {name: np.concatenate([rung.signals_per_window[i][name] for i in parts]) for name in names}
                    for rung in found.ladder
                ],
                {name: np.concatenate([floors[i].sigma(name) for i in parts]) for name in names},
            )
        )
    return joined


def one_after_another(found: list[Track]) -> tuple[list[Array], list[float]]:
    """Times of the tracks on one axis, s, and what was added to each; the first keeps its own."""
    times, shifts = [], []
    for track in found:
        shift = float(times[-1][-1] + PAUSE_S - track.time_s[0]) if times else 0.0
        times.append(track.time_s + shift)
        shifts.append(shift)
    return times, shifts


def _onward(parts: list[Array]) -> Array:
    times = [parts[0]]
    for before, part in pairwise(parts):
        shift = times[-1][-1] - before[-1]
        back = part[0] + shift <= times[-1][-1]
        times.append(part + (times[-1][-1] + PAUSE_S - part[0] if back else shift))
    return np.concatenate(times)


# --- what each fault is, as an engineer is told who finds it in the ranking -------------------------------------------
# What each fault is, as an engineer is told who finds it in the ranking: equation, cause, size, what it looks like.

_TYPICAL = (0.25, 0.75)  # k of a low and a high fault, as the thesis has them


@dataclass(frozen=True)
class FaultPage:
    """A fault of the actuator, k1 … k8, in words."""

    equation: str  # what it changes in the base model's
    explanation: str
    shows: str
    mistaken_for: str
    line: str  # of the base model's equations, which it changes: a key of `model_equation`


def _short(phase: str) -> FaultPage:
    k = f"k_{'ABC'.index(phase) + 3}"
    return FaultPage(
        f"N_{phase} → (1 − {k}) N_{phase}",
        f"The insulation between turns of phase {phase} has failed, mostly from heat or vibration, so that a part of "
        "its winding carries no current. The phase gives less torque and less back-EMF, in its own stretches of each "
        "electric turn.",
        "in the current, as a ripple of twice the electric frequency, and as less torque per ampere",
        "torque ripple, demagnetisation, a short circuit of another phase",
        "current",
    )


PAGES = {
    "k1": FaultPage(
        "T_f → (1 + 2 k_1) T_f",
        "Lubricant has aged or is gone, a bearing or the screw is damaged: dry friction at rest and in motion grows, "
        "all of it by the same factor.",
        "in the current, with the sign of the speed",
        "demagnetisation, load-dependent friction, Stribeck friction, a tolerance of the file's friction",
        "friction",
    ),
    "k2": FaultPage(
        "b → (1 + 99 k_2) b",
        "Teeth, nut or joints are worn: the motor turns through the play b before the user's side follows, at each "
        "reversal.",
        "in the user's position after each reversal, and as knocks in the current",
        "position sensor delay, dead band, torsional compliance",
        "output",
    ),
    "k3": _short("A"),
    "k4": _short("B"),
    "k5": _short("C"),
    "k6": FaultPage(
        "B → (1 + k_6 cos(θ − φ)) B",
        "The rotor does not turn in the middle of the stator: bearings are worn, or the shaft is bent. The field B is "
        "stronger where the air gap is thin, at the angle φ = 2π(k7 − ½), and weaker on the other side; each phase "
        "meets it a third of a turn after the one before.",
        "in the current, once per turn beside the poles' own periods",
        "torque ripple, cogging torque, encoder eccentricity",
        "motion",
    ),
    "k8": FaultPage(
        "G → (0.5 + k_8) G",
        "The position loop's proportional gain is not the file's: it was set otherwise, or its electronics have "
        "drifted. No part of the mechanics is worn.",
        "in the user's position, which follows the command too fast or too slowly",
        "position sensor delay, speed loop integral action, another controller",
        "drive",
    ),
}


def page_of(name: str) -> FaultPage:
    """Of a fault, or of the one that it belongs to."""
    return PAGES[cause_of(name)[0]]


def size(one: Candidate, actuator: Actuator) -> str:
    """A fault's suggested size, physical and in k: 'backlash 703 µrad, k2 ≈ 0.20'."""
    phrases = dict(zip(NAMES, phrases_of(vector(one.settings), actuator)))
    return ", ".join([*(phrases[name] for name in one.settings), f"{one.name} ≈ {one.settings[one.name]:.2f}"])


def typical(name: str, actuator: Actuator) -> str:
    """'friction × 1.50 to 2.50 (k1 0.25 to 0.75)'."""
    first = cause_of(name)[0]
    low, high = (phrases_of(vector({first: k}), actuator)[NAMES.index(first)].split(" ") for k in _TYPICAL)
    apart = next(i for i, (one, other) in enumerate(zip(low, high)) if one != other)
    return f"{' '.join(low)} to {' '.join(high[apart:])} ({first} {_TYPICAL[0]:g} to {_TYPICAL[1]:g})"


# --- a discovery in numbers: what was added, the ladder, each recording, the candidates -------------------------------

_DIVERGED = 1e3  # times what was predicted, by which a refit is worse than the model without the effect


def added(found: Discovery) -> Iterator[Facts]:
    """Each effect with its parameters, also where it is a base parameter's value."""
    for one in (*found.effects, *found.freed):
        effect = find(one.name)
        lines = [f"it belongs to {FAMILIES[effect.family]}"] if effect.family == "drive" else []
        lines += [f"order {of:g}: {said}" for of in _orders_of(one) if (said := of_the_poles(of, found.actuator))]
        yield Facts(_parameters(found, one), f"{effect.title}: {effect.equation}", lines)


_STRAIN_WAVE = 1.0 / 30.0  # gear ratio, from which on a single stage is usually a strain wave gear's


def _orders_of(one: Added) -> list[float]:
    return [one.chosen["order"]] if "order" in one.chosen else []


def of_the_poles(order: float, actuator: Actuator) -> str:
    """What else than teeth and slots has an order of the motor: its currents by the pole pairs, a strain wave gear.

    A phase current that is off by a constant ripples the torque once an electrical turn, phases that are read with
    different gains twice, an inverter's dead time six times; a wave generator is an ellipse, and turns with the motor.
    """
    if actuator.axes.motor == "linear":
        return ""
    pairs = actuator.motor.pole_pairs
    causes = {
        1.0: "offsets of the phase currents",
        2.0: "phase currents of unequal gain",
        6.0: "the inverter's dead time",
    }
    told = []
    if pairs > 1.0 and (cause := causes.get(order / pairs)):
        times = {1.0: "once", 2.0: "twice", 6.0: "six times"}[order / pairs]
        told.append(f"{times} an electrical turn, as {cause} would ripple, too")
    if order == 2.0 and abs(actuator.transmission.gear_ratio) <= _STRAIN_WAVE and actuator.axes.user == "rotary":
        told.append("twice a turn of the motor, as a strain wave gear's generator would, too")
    return "; ".join(told)


def _parameters(found: Discovery, one: Added) -> dict[str, str]:
    names = {name: on_axes(f"effects.{one.key}.{name}", found.actuator.axes).name for name in one.parameters}
    return {names.get(name, name): told for name, told in settings(found, one).items()}


def ladder(found: Discovery) -> Table:
    """Errors in floors, beside those of the signal that tells most; in all units where no floor is to be believed."""
    if not found.floor_believable:
        return ladder_by_signal(found)
    first = primary(found)
    shown = of_signal(first, found.actuator.axes).scaled([one.signals[first] for one in found.ladder])
    title = f"{in_sentence(shown.title)} [{shown.unit}]"
    held = any(first in one.holdout_signals for one in found.ladder)
    errors = [
        [
            *(_in_floors(error) for error in (one.rmse, one.holdout_rmse)),
            *(_in_unit(of.get(first), shown) for of in (one.signals, one.holdout_signals)[: 1 + held]),
        ]
        for one in found.ladder
    ]
    heads = ("fitted", "held out", title, "held out")
    return _steps(found, heads[: 3 + held], errors, "(1 is the floor; rms)")


def ladder_by_signal(found: Discovery) -> Table:
    """What is left of each signal after each step, in its unit."""
    shown = {
        name: of_signal(name, found.actuator.axes).scaled([one.signals[name] for one in found.ladder])
        for name in found.ladder[0].signals
    }
    errors = [[one.text(rung.signals[name]) for name, one in shown.items()] for rung in found.ladder]
    return _steps(found, [one.title for one in shown.values()], errors, "(rms of what was fitted)")


def _steps(found: Discovery, heads: Sequence[str], errors: Sequence[list[str]], unit: str) -> Table:
    labels = [rung_title(one.change, found.actuator.axes) for one in found.ladder]
    return Table(tuple(heads), [[label, *one] for label, one in zip(labels, errors)], "error ladder", unit=unit)


def per_recording(found: Discovery) -> Table | None:
    """The error of each recording, fitted or held out, on the first and the last step; None where there is but one."""
    first, last = found.ladder[0], found.ladder[-1]
    rows = [[name, number(first.recordings[name]), number(error)] for name, error in last.recordings.items()]
    held = [
        [name, number(first.holdout_recordings[name]), number(error)] for name, error in last.holdout_recordings.items()
    ]
    if len(rows) + len(held) < 2:
        return None
    remarks = [*([""] * len(rows)), *(["held out"] * len(held))]
    return Table(("calibrated", "last step"), [*rows, *held], "recording", remarks, "(error over the floor)")


def candidates(found: Discovery) -> Table | None:
    """What each effect or fault alone would take away from χ²; None where none was scored."""
    if not found.candidates:
        return None
    is_probable = any(one.probability is not None for one in found.candidates)
    rows = [
        [
            effect_title(one.name),
            "–" if one.obstacle else f"{one.predicted_drop:.0f}",
            _refitted(one),
            *(("–" if one.probability is None else in_percent(one.probability),) if is_probable else ()),
        ]
        for one in found.ranked
    ]
    remarks = [one.obstacle for one in found.ranked]
    head = ("predicted", "refitted", *(("probable",) if is_probable else ()))
    return Table(head, rows, "candidates", remarks, "(fall of χ²)")


def in_percent(probability: float) -> str:
    """'97 %', '> 99.9 %', '< 0.1 %'."""
    if probability > 0.999:
        return "> 99.9 %"
    return "< 0.1 %" if probability < 0.001 else f"{100.0 * probability:.3g} %"


def _refitted(one: Candidate) -> str:
    """A refit that ends at far more than it could ever take away has diverged; its number says nothing."""
    if one.refitted_drop is None:
        return ""
    if not -_DIVERGED * max(one.predicted_drop, 1.0) < one.refitted_drop < math.inf:
        return "refit diverged"
    return f"{one.refitted_drop:.0f}".replace("-", "−")


def _in_floors(error: float | None) -> str:
    return "" if error is None else number(error)


def _in_unit(error: float | None, shown: Quantity) -> str:
    return "" if error is None else number(shown.factor * error)


# --- further sentences of a discovery, as page, reports and recordings show them --------------------------------------
# Further sentences of a discovery, as page, reports and recordings show them: its warnings, what had been masked.

LOOP_UNTOLD = (
    "In the closed loop no effect explains the whole error, and nothing shows another control law than the file's: how "
    "the drive samples, filters or delays may differ. What the measured motion needs of the motor is reported instead, "
    "without a controller."
)
OPEN_LOOP_LEFT = (
    "In open loop the noise of the recorded current adds up in the motion. What the measured motion needs of the motor "
    "is compared instead."
)
NOT_REPEATABLE = (
    "The closed loop is not repeatable (a change of 0.05 % in the inertia moves its signals by more than the noise): "
    "what the measured motion needs is compared instead."
)


def mismatch(seen: ControllerSeen | None, axes: Axes, lag: LoopLag | None = None) -> list[str]:
    """That the controller is not what the file says, and what was seen instead: of its law, and how late it follows."""
    late = "" if lag is None else f" {lag.sentence}"
    if seen is None:
        return [] if lag is None else [f"{BLAMED}{late}"]
    parts = []
    for gain in seen.gains:
        if seen.holds and gain.differs:
            one = on_axes(gain.path, axes)
            told = with_uncertainty(gain.seen, gain.half, one.unit)
            parts.append(f"a {in_sentence(one.title)} of {told} where the file has {amount(gain.file, one.unit)}")
    if seen.late:
        parts.append(f"an answer that comes {number(1e3 * seen.delay_s, 2)} ms later")
    told = f"On the measured motion the drive's current shows {' and '.join(parts)}. " if parts and seen.holds else ""
    left, best = (f"{100.0 * share:.0f} %" for share in (seen.left_by_file, seen.left))
    form = "" if seen.holds else ", so that it is of another form"
    return [
        f"{BLAMED} {told}Of that current the file's controller leaves {left} "
        f"unexplained, the best one of the same form {best}{form}.{late} What the measured motion needs of the motor "
        "is reported instead, without a controller."
    ]


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


def as_well(ties: Mapping[str, str], added: Sequence[Added], faults: Sequence[str]) -> list[str]:
    """One line for each fault and effect of which one was taken, and the other would explain as much.

    ties: effects by fault; or other faults.
    """
    names, lines = {*faults, *(one.name for one in added)}, []
    for fault, effect in ties.items():
        label, title = f"the fault {BY_NAME[fault].label}", effect_title(effect)
        if effect in names and fault not in faults:
            lines.append(f"T{label[1:]} would explain as much as {in_sentence(title)}.")
        elif fault in faults and effect not in names:
            lines.append(f"{title} would explain as much as {label}.")
    return lines


def held_back(paths: Sequence[str], axes: Axes) -> list[str]:
    """One line on parameters that stay as the file says, since what is missing would drive them to their bounds."""
    if not paths:
        return []
    names = ", ".join(in_sentence(on_axes(path, axes).title) for path in paths)
    return [
        f"Kept as the file says, since what is missing would drive {'it' if len(paths) == 1 else 'them'}"
        f" to the edge of tolerance: {names}."
    ]


def untold(first: str, second: str) -> str:
    """That no test is known which would tell two effects apart."""
    one, other = (in_sentence(effect_title(name)) for name in (first, second))
    return f"No command within the range of these recordings tells {one} from {other}."


# --- a discovery in plain numbers, as `emaviz discover --json` writes it ----------------------------------------------
# A discovery in plain numbers, as `emaviz discover --json` writes it: what each field means, and where it is from.

_FAULT = "fault"  # in place of the family of a candidate that is one
_RMSE = "rms error pooled over signals, in units of the floor; 1 is the floor"


if TYPE_CHECKING:
    CalibrationJson = CombinationJson = SimulatedJson = ParameterJson = EventJson = dict[str, Any]
else:
    CalibrationJson, CombinationJson, SimulatedJson, ParameterJson, EventJson = map(
        json_type, (Calibration, KnownTogether, FreeError, Calibrated, Event)
    )


class EffectParameterJson(TypedDict):
    """A parameter of an added effect, in its `unit`; one that was chosen, as a whole order, was not fitted."""

    value: Annotated[float, Meta(description="what was found")]
    interval90: Annotated[IntervalJson | None, Meta(description="the ends of the 90 % interval about value")]
    from_file: NotRequired[Annotated[bool, Meta(description="whether the interval is null, as nothing is told")]]
    unit: Annotated[str, Meta(description="of value, initial and interval90; empty for a ratio")]
    initial: NotRequired[Annotated[float, Meta(description="what the fit began with; of a fitted one")]]
    z: NotRequired[Annotated[float, Meta(description="value − initial, in σ of its tolerance; of a fitted one")]]
    at_bound: NotRequired[Annotated[bool, Meta(description="whether the fit ended at the end of what is allowed")]]


class AddedJson(TypedDict):
    """An effect that was added to the model."""

    name: Annotated[str, Meta(description="as `emaviz effects` lists it")]
    family: Annotated[str, Meta(description="mechanics, electrics, sensor or drive")]
    parameters: Annotated[dict[str, EffectParameterJson], Meta(description="by their names in the actuator's file")]
    rmse_before: Annotated[float | None, Meta(description=f"without it: {_RMSE}")]
    rmse_after: Annotated[float | None, Meta(description="with it, likewise")]
    holdout_rmse_before: Annotated[float | None, Meta(description="of what was not fitted, without it; null: nothing")]
    holdout_rmse_after: Annotated[float | None, Meta(description="of what was not fitted, with it; null: nothing")]
    same_as: Annotated[list[str], Meta(description="effects and faults that these recordings cannot tell from it")]
    supported_by: Annotated[list[str], Meta(description="the models that bear it out: closed_loop, inverse_dynamics")]
    probability: Annotated[float | None, Meta(description="that it, or one of same_as, is missing; null: a curve")]


class RungJson(TypedDict):
    """One step of the error ladder."""

    label: Annotated[str, Meta(description="what was changed, in words")]
    kind: Annotated[
        str,
        Meta(description="calibrated, without_controller, fault, effect, parameter (freed), removed or replaced"),
    ]
    names: Annotated[list[str], Meta(description="of the effects, faults or parameters")]
    orders: Annotated[list[float], Meta(description="of a periodic effect that was there at others, per revolution")]
    rmse: Annotated[float | None, Meta(description=f"{_RMSE}; null: the floor is not to be believed")]
    holdout_rmse: Annotated[float | None, Meta(description="the same of what was not fitted; null: nothing")]
    signals: Annotated[dict[str, float | None], Meta(description="rms error by signal, in its unit")]
    holdout_signals: Annotated[dict[str, float | None], Meta(description="the same of what was not fitted")]
    recordings: Annotated[dict[str, float | None], Meta(description="rmse of each fitted recording, in floors")]
    holdout_recordings: Annotated[dict[str, float | None], Meta(description="the same of what was not fitted")]


class CandidateJson(TypedDict):
    """An effect, or a fault, that might be missing."""

    name: Annotated[str, Meta(description="of the effect, or k1 … k8")]
    family: Annotated[str, Meta(description="mechanics, electrics, sensor, drive, or fault")]
    predicted_drop: Annotated[float | None, Meta(description="of χ², before any refit")]
    tested: Annotated[bool, Meta(description="whether it was refitted")]
    refitted_drop: Annotated[float | None, Meta(description="of χ², by the refit; null: it was not refitted")]
    settings: Annotated[dict[str, float | None], Meta(description="its best settings, by the names in files")]
    untestable_reason: Annotated[str, Meta(description="why these recordings cannot show it; empty where they can")]
    cannot_represent: Annotated[str, Meta(description="why this model has no place for it; empty where it has one")]
    probability: Annotated[
        float | None, Meta(description="that this, of all candidates or none, is missing; null: ruled out")
    ]


class UnknownJson(TypedDict):
    """What the last model leaves, as a curve of one variable times a modulator."""

    variable: Annotated[str, Meta(description="motor_angle, user_position, motor_speed, acceleration, current, …")]
    modulator: Annotated[str, Meta(description="what the curve is multiplied by: 1, current or sign_speed")]
    r2: Annotated[float | None, Meta(description="share of the residual's power, as it is, cross-validated")]
    curve: Annotated[
        list[list[float | None]],
        Meta(description="rows of the variable, the mean residual there and its standard error, in SI units"),
    ]
    added: Annotated[AddedJson | None, Meta(description="the torque curve that stands for it in the model, if any")]


class RepeatabilityJson(TypedDict):
    """The two recordings of one command that are furthest apart."""

    recordings: Annotated[list[str], Meta(description="their names")]
    over_floor: Annotated[float | None, Meta(description="rms of their difference over √2, in floors")]
    signals: Annotated[dict[str, float | None], Meta(description="the same by signal, in its unit")]


class RemainingJson(TypedDict):
    """What the last model leaves."""

    rmse: Annotated[float | None, Meta(description=f"{_RMSE}; null: the floor is not to be believed")]
    at_floor: Annotated[bool, Meta(description="whether it may be noise and the model's own floor")]
    within_band: Annotated[
        bool | None,
        Meta(description="whether neither it nor the error of what was held out is above its band"),
    ]


class ExperimentJson(TypedDict):
    """A test to do next."""

    command: Annotated[str, Meta(description="as of `emaviz simulate --command`")]
    settings: Annotated[dict[str, float], Meta(description="of the command, as of --set, and duration_s, s")]
    load: Annotated[float, Meta(description="N·m at the user (N on a linear axis), against positive motion")]
    add_signal: Annotated[str | None, Meta(description="a signal to record as well")]
    separates: Annotated[list[str], Meta(description="the two effects that it tells apart")]
    expected_chi2: Annotated[float | None, Meta(description="by which the wrong one of them would fit worse")]


class GainJson(TypedDict):
    """A gain of the controller, in the unit that ends its name."""

    file: Annotated[float, Meta(description="what the actuator's file says")]
    seen: Annotated[float, Meta(description="what the drive's current tells")]
    interval90: Annotated[IntervalJson, Meta(description="the ends of the 90 % interval about seen")]
    differs: Annotated[bool, Meta(description="whether it is another than the file's, for sure and by much")]


class ControllerSeenJson(TypedDict):
    """The drive's controller, by its current, where it is not the file's."""

    gains: Annotated[dict[str, GainJson], Meta(description="by their names in the actuator's file")]
    delay_s: Annotated[float, Meta(description="s, by which it answers later than the file's controller")]
    left_by_file: Annotated[float, Meta(description="share of the current's rms that the file's controller misses")]
    left: Annotated[float, Meta(description="the same with the gains and the delay that suit best")]
    same_form: Annotated[bool, Meta(description="whether the law of the file's controller tells the current at all")]


class TransmissionSeenJson(TypedDict):
    """By how much the user's position leaves gear ratio × motor's position."""

    error: Annotated[float, Meta(description="rms at the user, rad (m on a linear axis)")]
    noise: Annotated[float, Meta(description="rms that the two sensors' noise makes, likewise")]
    cause: Annotated[str, Meta(description="acceleration, bandwidth, direction, position; empty: not known")]
    period: Annotated[float | None, Meta(description="at the motor, rad or m, where it repeats with the position")]
    amplitude: Annotated[float | None, Meta(description="of what repeats, at the user, rad or m")]
    frequency_Hz: Annotated[float | None, Meta(description="Hz, of the user on a shaft that gives, the motor held")]


class TwoMassesJson(TypedDict):
    """Two masses joined by a spring, seen in the motor alone, from torque to speed."""

    antiresonance_Hz: Annotated[float, Meta(description="at which the load swings alone and holds the motor")]
    resonance_Hz: Annotated[float, Meta(description="at which motor and load swing against each other")]
    inertia_ratio: Annotated[float, Meta(description="the load's inertia over the motor's")]
    stiffness: Annotated[float, Meta(description="of what joins them, at the motor: N·m/rad, of a linear motor N/m")]
    coherence: Annotated[float, Meta(description="of the motion with the torque, mean over the frequencies that count")]


class DisagreementJson(TypedDict):
    """A held-out recording that contradicts the fitted ones."""

    recording: Annotated[str, Meta(description="its name")]
    signal: Annotated[str | None, Meta(description="whose reading explains it")]
    how: Annotated[str, Meta(description="sign, zero, unit, actuator or unknown")]
    sentence: Annotated[str, Meta(description="the same in words")]
    before: Annotated[float | None, Meta(description="its rms error, in floors")]
    after: Annotated[float | None, Meta(description="the same once that is put right")]


class SavedActuatorJson(TypedDict):
    """The improved model, written as an actuator file and simulated again from there."""

    file: Annotated[str, Meta(description="as given with --save-actuator")]
    verified_rmse: Annotated[float | None, Meta(description=f"of the saved model: {_RMSE}")]
    verified_holdout_rmse: Annotated[float | None, Meta(description="the same of what was not fitted; null: nothing")]


class DiscoveryJson(TypedDict):
    """Which physical effects the model of one actuator lacks."""

    verdict: Annotated[str, Meta(description=f"one of {', '.join(VERDICTS)}")]
    calibration: Annotated[CalibrationJson, Meta(description="of the last model")]
    identifiable: Annotated[list[CombinationJson], Meta(description="what the recordings tell only together")]
    effects: Annotated[list[AddedJson], Meta(description="that are missing, in the order in which they were added")]
    ladder: Annotated[list[RungJson], Meta(description="the error after each change of the model")]
    simulation: Annotated[
        dict[str, SimulatedJson],
        Meta(description="of the last model running freely, driven by the command, or in open loop; by signal"),
    ]
    candidates: Annotated[list[CandidateJson], Meta(description="all effects of the first search, best first")]
    faults: Annotated[dict[str, ParameterJson], Meta(description="k1 … k8 that the last model has, 0 … 1")]
    parameters_outside_tolerance: Annotated[list[str], Meta(description="section.name, beyond their tolerance")]
    unknown: Annotated[UnknownJson | None, Meta(description="what no effect explains; null: nothing that is told")]
    floor_believable: Annotated[bool, Meta(description="whether errors may be counted in floors")]
    floor_band: Annotated[list[float], Meta(description="between which rmse of nine of ten true models lies")]
    holdout_floor_band: Annotated[list[float] | None, Meta(description="floor_band of what was held out; null: none")]
    repeatability: Annotated[RepeatabilityJson | None, Meta(description="null: no command was recorded twice")]
    remaining: Annotated[RemainingJson, Meta(description="the error of the last model")]
    not_claimed: Annotated[dict[str, str], Meta(description="effects that the data would pay for, and why not")]
    next_experiment: Annotated[ExperimentJson | None, Meta(description="that tells the rivals apart; null: none")]
    controller_mismatch: Annotated[bool, Meta(description="whether the drive's controller is not the file's")]
    controller_seen: Annotated[ControllerSeenJson | None, Meta(description="what it is instead")]
    transmission_seen: Annotated[TransmissionSeenJson | None, Meta(description="where it is not the file's")]
    two_masses_seen: Annotated[TwoMassesJson | None, Meta(description="where the motor shows a second mass")]
    disagreements: Annotated[list[DisagreementJson], Meta(description="held-out recordings at odds with the fitted")]
    events: Annotated[list[EventJson], Meta(description="what happened at one moment")]
    warnings: Annotated[list[str], Meta(description="what the answer must be read with")]
    saved_actuator: NotRequired[Annotated[SavedActuatorJson, Meta(description="with --save-actuator")]]


def as_dict(found: Discovery) -> DiscoveryJson:
    """Everything but the series, in numbers and texts that JSON can hold; unknown numbers are None."""
    axes = found.actuator.axes

    def in_files(name: str) -> str:
        return on_axes(name, axes).path

    unknown, seen = found.unknown, found.transmission_seen
    twice, is_believable = found.repeated, found.floor_believable
    document: DiscoveryJson = {
        "verdict": found.verdict,
        "calibration": json_form(found.calibration, in_files),
        "identifiable": json_form(combinations(found.calibration.identifiable, axes), in_files),
        "effects": [_added(found, one) for one in found.effects],
        "ladder": [_rung(rung, axes, is_believable) for rung in found.ladder],
        "simulation": json_form(errors_in_units(found.simulation), in_files),
        "candidates": [_candidate(one, axes) for one in found.ranked],
        "faults": json_form(found.faults, in_files),
        "parameters_outside_tolerance": [on_axes(name, axes).path for name in found.parameters_outside_tolerance],
        "unknown": None
        if unknown is None
        else {
            "variable": unknown.variable,
            "modulator": unknown.modulator,
            "r2": unknown.share,
            "curve": np.column_stack([unknown.centres, unknown.curve, unknown.error]).tolist(),
            "added": None if found.curve is None else _added(found, found.curve),
        },
        "floor_believable": is_believable,
        "floor_band": list(found.floor_band),
        "repeatability": None
        if twice is None
        else {
            "recordings": list(twice.recordings),
            "over_floor": twice.apart,
            "signals": {axes.signal(name): value for name, value in twice.signals.items()},
        },
        "holdout_floor_band": None if found.unseen is None else list(found.unseen.band),
        "remaining": {
            "rmse": found.in_floors.error if is_believable else None,
            "at_floor": found.at_floor,
            "within_band": found.is_within_band if is_believable else None,
        },
        "not_claimed": dict(found.not_claimed),
        "next_experiment": _experiment(found.next_experiment),
        "controller_mismatch": found.controller_seen is not None or found.loop_lag is not None,
        "controller_seen": _seen(found.controller_seen, axes),
        "transmission_seen": None if seen is None else TransmissionSeenJson(**asdict(seen)),
        "two_masses_seen": None if found.two_masses_seen is None else TwoMassesJson(**asdict(found.two_masses_seen)),
        "disagreements": [
            {
                "recording": one.recording,
                "signal": None if one.signal is None else axes.signal(one.signal),
                "how": one.how,
                "sentence": one.sentence,
                "before": one.before,
                "after": one.after,
            }
            for one in found.disagreements
        ],
        "events": json_form(found.events, in_files),
        "warnings": [*found.warnings, *masked(found.effects, found.actuator.axes)],
    }
    return plain(document)


def _candidate(one: Candidate, axes: Axes) -> CandidateJson:
    is_fault = one.name in BY_NAME
    names = {name: name if is_fault else on_axes(f"effects.{one.name}.{name}", axes).name for name in one.settings}
    return {
        "name": one.name,
        "family": _FAULT if is_fault else find(one.name).family,
        "predicted_drop": one.predicted_drop,
        "tested": one.refitted_drop is not None,
        "refitted_drop": one.refitted_drop,
        "settings": {names[name]: value for name, value in one.settings.items()},
        "untestable_reason": one.untestable_reason,
        "cannot_represent": one.cannot_represent,
        "probability": one.probability,
    }


def _rung(one: Rung, axes: Axes, is_believable: bool) -> RungJson:
    change = one.change
    names = [on_axes(name, axes).path for name in change.names] if change.kind == "parameter" else list(change.names)
    return {
        "label": rung_label(change, axes),
        "kind": change.kind,
        "names": names,
        "orders": list(change.orders),
        "rmse": one.rmse if is_believable else None,  # in floors
        "holdout_rmse": one.holdout_rmse if is_believable else None,
        "signals": dict(one.signals),
        "holdout_signals": dict(one.holdout_signals),
        "recordings": dict(one.recordings),
        "holdout_recordings": dict(one.holdout_recordings),
    }


def _seen(one: ControllerSeen | None, axes: Axes) -> ControllerSeenJson | None:
    if one is None:
        return None
    return {
        "gains": {
            on_axes(gain.path, axes).path: {
                "file": gain.file,
                "seen": gain.seen,
                "interval90": [gain.seen - gain.half, gain.seen + gain.half],
                "differs": gain.differs,
            }
            for gain in one.gains
        },
        "delay_s": one.delay_s,
        "left_by_file": one.left_by_file,
        "left": one.left,
        "same_form": one.holds,
    }


def _experiment(one: Experiment | None) -> ExperimentJson | None:
    if one is None:
        return None
    return {
        "command": one.command,
        "settings": {**one.settings, "duration_s": one.duration_s},
        "load": one.load_torque_Nm,
        "add_signal": one.add_signal,
        "separates": list(one.separates),
        "expected_chi2": one.expected_chi2,
    }


def _added(found: Discovery, one: Added) -> AddedJson:
    axes = found.actuator.axes
    parameters: dict[str, EffectParameterJson] = {
        name: json_form(fitted_of(found, one, name), str) for name in one.parameters
    }
    for name, value in one.chosen.items():
        parameters[name] = {"value": value, "interval90": [value, value], "unit": ""}
    return {
        "name": one.name,
        "family": find(one.name).family,
        "parameters": {on_axes(f"effects.{one.key}.{name}", axes).name: facts for name, facts in parameters.items()},
        "rmse_before": one.rmse_before,
        "rmse_after": one.rmse_after,
        "holdout_rmse_before": one.holdout_before,
        "holdout_rmse_after": one.holdout_after,
        "same_as": list(one.same_as),
        "supported_by": list(one.supported_by),
        "probability": one.probability,
    }


# --- what a discovery found, in plain words: for the terminal, a notebook, the report and the recording alike ---------

VERDICT_WORDS = {
    "effects_found": "effects are missing, and have been added",
    "adequate": "nothing is missing: the residual is noise and the model's own floor",
    "partly_explained": "a part of what is missing has been found, and added; of the rest the cause is not known",
    "unknown_effect": "something is missing that none of the known effects explains",
    "not_converged": "the calibration has not converged; what looks like missing physics may be an unfinished fit",
    "not_repeatable": "the run does not repeat itself, so that a comparison over time means nothing",
    "uninformative": "these recordings tell nothing of the model: what they hold is constant, or within its floor",
    "interrupted": "the search was cut off before it had added anything",
}
_MOVED, _MOST_MOVED = 0.5, 3  # σ of a tolerance, from which on a parameter's own value is worth a word; of those
_HARDLY = 0.02  # of the held-out error: what moves it by less is hardly seen there
FLOOR_NOTE = (
    "Errors are rms over all fitted signals in units of the floor: 1 is what noise and the model's own limits leave. "
    "Nine of ten true models end within the band that is drawn."
)


def verdict_name(found: Discovery) -> str:
    """The verdict as a name of two words: 'effects found'."""
    return found.verdict.replace("_", " ")


def headline(found: Discovery) -> str:
    """The verdict in one sentence; in two where the controller is not the file's."""
    if found.controller_seen is None:
        return _answer(found) if found.loop_lag is None else f"{BLAMED} {_answer(found)}"
    if (
        found.verdict == "adequate"
        and not found.parameters_outside_tolerance
        and not found.not_claimed
        and found.is_within_band
    ):
        return "The controller is not what the file says; without it, motion and current show nothing else missing."
    return f"The controller is not what the file says. Without it: {in_sentence(_answer(found))}"


def so_far(found: Discovery) -> str:
    """What the model has, and how far that brought the error, while there is no verdict yet."""
    has = [text for text in (_named(found), _faulty(found)) if text]
    return f"{f'So far: {all_of(has)}. ' if has else ''}{sentences(found)[0]}"


def _answer(found: Discovery) -> str:
    faulty = _faulty(found)
    if found.verdict == "interrupted" and (has := [text for text in (_named(found), faulty) if text]):
        return f"The search was cut off. Found so far: {all_of(has)}."
    if found.verdict == "effects_found":
        return f"The model lacks {_named(found)}{f', and the actuator has {faulty}' if faulty else ''}."
    if found.verdict == "adequate" and found.floor_believable and found.in_floors.is_above:
        return _nearly_adequate(found, faulty)
    if found.verdict == "adequate" and faulty:
        return f"No physics is missing: the actuator has {faulty}."
    if found.verdict == "adequate" and found.parameters_outside_tolerance:
        return "No physics is missing, but not all parameters are within their tolerance."
    if found.verdict == "adequate" and found.not_claimed:
        return "No more is left than a true model leaves, and nothing that was tried can be claimed for it."
    if found.verdict in ("unknown_effect", "partly_explained") and found.two_masses_seen is not None:
        also = f"{_named(found)}; and " if _named(found) else ""
        return f"The model lacks {also}{found.two_masses_seen.short}."
    if found.verdict == "partly_explained":
        return f"Found in part: {_named(found) or 'a curve'}{f', and {faulty}' if faulty else ''}; {remains(found)}."
    if found.verdict == "unknown_effect" and found.at_floor and found.transmission_seen is not None:
        return f"Motion and current are explained; {found.transmission_seen.short}."
    if found.verdict == "unknown_effect" and found.curve is None:
        if found.not_claimed:  # an effect that would pay does explain some of it
            return f"Something is missing, and nothing that was tried can be claimed for it: {remains(found)}."
        return f"Something is missing that none of the known effects explains: {remains(found)}."
    text = VERDICT_WORDS.get(found.verdict, verdict_name(found))
    return f"{text[:1].upper()}{text[1:]}."


def _nearly_adequate(found: Discovery, faulty: str) -> str:
    """Of a model that passes, though more is left than nine of ten true ones leave: no more than that is said."""
    floors = found.in_floors
    told = f"At {floors.text} times the floor, where a true model's error is {floors.band_text}, {floors.more}"
    first = f"The actuator has {faulty}. " if faulty else ""
    if found.parameters_outside_tolerance:
        first += "Not all parameters are within their tolerance. "
    if found.not_claimed:
        return f"{first}{told}, and nothing that was tried can be claimed for it."
    return f"{first}{told}, and no effect of the library explains it."


def _named(found: Discovery) -> str:
    """'cogging torque and constant load or current sensor bias, which cannot be told apart'; "" where none is."""
    # Once, where two orders of one effect were added.
    groups = {one.name: [one.name, *one.same_as] for one in reversed(found.effects)}
    theirs = {one.name for one in found.effects if one.of_the_file}

    def called(name: str) -> str:
        title = in_sentence(effect_title(name))
        return f"a {title} other than the file's" if name in theirs else title

    names = [" or ".join(called(name) for name in groups[one]) for one in reversed(groups)]
    if any(len(group) > 1 for group in groups.values()):
        return f"{', and '.join(names)}, which cannot be told apart"
    return all_of(names) if names else ""


def remains(found: Discovery) -> str:
    """'4.0 times the floor remains, cause unknown, varies with the load'."""
    if found.at_floor and found.transmission_seen is not None:
        return f"motion and current are explained, {found.transmission_seen.short}"
    if found.at_floor and found.unknown is None:
        return "what remains is as small as the floor, but lasts longer than noise"
    left = found.unknown
    goes = "" if left is None else f", varies with {dependence(left.variable, left.modulator)}"
    shaft = "" if found.transmission_seen is None else f"; and {found.transmission_seen.short}"
    rest, unseen = found.ladder[-1].rmse, found.ladder[-1].holdout_rmse
    if unseen is not None and rest < FAR and misses_unseen(found.ladder[-1], found.disagreements):
        return f"what was not fitted is missed by {number(unseen)} times the floor, cause unknown{goes}{shaft}"
    return f"{number(rest)} times the floor remains, cause unknown{goes}{shaft}"


def repeatability(found: Discovery) -> list[str]:
    """How near the rig comes to itself, where a command was recorded twice."""
    twice = found.repeated
    if twice is None:
        return []
    axes = found.actuator.axes
    each = [of_signal(name, axes).scaled([value]).text(value) for name, value in twice.signals.items()]
    told = f"{' and '.join(twice.recordings)} are of one command, and apart by {all_of(each)} rms"
    told += f", {number(twice.apart, 2)} times the floor"
    if twice.floor_believable:
        return [f"{told}."]
    return [f"{told}: the rig repeats itself less well than the floor has it, so that errors count in units alone."]


def not_claimed(found: Discovery) -> list[str]:
    """A line for each effect that the data would pay for, with what speaks against it."""
    return [f"{effect_title(name)} is not claimed: {why}." for name, why in found.not_claimed.items()]


def sentences(found: Discovery) -> list[str]:
    """What follows the headline: how far the error falls, what cannot be told apart, what is left."""
    told = []
    first, last = found.ladder[0], found.ladder[-1]
    added = len(found.effects) + len(causes(found.faults))
    if added:
        told.append(
            f"With {'it' if added == 1 else 'them'} the error falls from {_times(first, last)}. "
            + _fall_in_unit(found, first, last)
        )
        told += masked(found.effects, found.actuator.axes)
    else:
        bare = found.ladder[-2] if found.curve is not None else last  # a curve is no part of the calibrated model
        held = "" if bare.holdout_rmse is None else f" ({number(bare.holdout_rmse)} times on what was not fitted)"
        told.append(
            f"The calibrated model's error is {number(bare.rmse)} times the floor{held}. {_rms_in_unit(found, bare)}"
        )
    if found.floor_believable:
        told.append(f"A true model's error is {found.in_floors.band_text} times the floor (90 % interval).")
    told += not_fitted(found)
    if found.faults:
        told.append(f"{'; '.join(faults(found).values())}. Effects and faults are estimated together.")
    for one in found.effects:
        if one.same_as:
            rivals = all_of([in_sentence(effect_title(name)) for name in one.same_as])
            told.append(f"These recordings cannot tell {in_sentence(effect_title(one.name))} from {rivals}.")
        if one.probability is not None:
            several = sum(other.name == one.name for other in found.effects) > 1
            order = _of_orders(_orders_of(one), found.actuator.axes) if several else ""
            this = "one of these" if one.same_as else f"{in_sentence(effect_title(one.name))}{order}"
            told.append(f"That {this} is missing is {in_percent(one.probability)} probable.")
    if found.parameters_outside_tolerance:
        outside = all_of([_beside_file(found, path) for path in found.parameters_outside_tolerance])
        whose = "its" if len(found.parameters_outside_tolerance) == 1 else "their"
        by_themselves = {*found.calibration.outside_tolerance, *(one.stands_for for one in found.freed)}
        shared = set(found.parameters_outside_tolerance) - by_themselves
        scale = f", counting what shares {whose} scale, as the torque constant" if shared else ""
        told.append(f"Outside {whose} tolerance{scale}: {outside}.")
    told += moved(found)
    if found.unknown is not None:
        told.append(("Something else is left. " if found.effects else "") + found.unknown.sentence)
    told += not_claimed(found)
    if found.curve is not None:
        told.append(f"A torque curve stands in for it, with which the error falls from {_times(first, last)}.")
    return told + repeatability(found)


def not_fitted(found: Discovery) -> list[str]:
    """That a model that is at its floor is not there on what was held out."""
    at_floor, unseen = found.verdict in ("adequate", "effects_found") and found.floor_believable, found.unseen
    if not at_floor or unseen is None or not unseen.is_above:
        return []
    told = f"{unseen.text} times its floor, where a true model's error is {unseen.band_text} times"
    return [f"What was not fitted is off by {told}: the model does not tell all of it."]


def moved(found: Discovery) -> list[str]:
    """['Within tolerance, but not as the file has it: motor viscous friction 21.3 ± 0.35 mN·m·s/rad (8.00).']"""
    if found.verdict not in ("adequate", "effects_found"):
        return []  # what is left may have moved them
    sure = {
        path: one
        for path, one in found.calibration.parameters.items()
        if path not in found.parameters_outside_tolerance
        and "." in path
        and not path.startswith(("effects.", "sensors."))
        and abs(one.z) > _MOVED
        and abs(one.value - one.initial) > one.interval90[1] - one.interval90[0]
    }
    most = sorted(sure, key=lambda path: -abs(sure[path].z))[:_MOST_MOVED]
    named = [_beside_file(found, path) for path in most]
    return [f"Within tolerance, but not as the file has it: {all_of(named)}."] if named else []


def _beside_file(found: Discovery, path: str) -> str:
    """'motor viscous friction 21.3 ± 0.35 mN·m·s/rad (8.00)'; its name alone where an effect is its value."""
    name = in_sentence(on_axes(path, found.actuator.axes).title)
    one = found.calibration.parameters.get(path)
    stands_for = any(path == effect.stands_for for effect in found.freed)
    return name if one is None or stands_for else f"{name} {value(one)} ({amount(one.initial, one.unit)})"


def verification(found: Discovery, saved: Verified) -> str:
    """'verified: 0.69 × the floor', and plainly so if the saved model is worse than the one that was found."""
    held = "" if saved.holdout_rmse is None else f", {number(saved.holdout_rmse)} × on what was not fitted"
    text = f"verified: {number(saved.rmse)} × the floor{held}"
    if not saved.is_worse:
        return text
    last = found.ladder[-1]
    then = "" if last.holdout_rmse is None else f" and {number(last.holdout_rmse)} ×"
    return f"{text}, which is worse than the {number(last.rmse)} ×{then} of the ladder: the file is not the whole model"


def next_experiment(found: Discovery) -> list[str]:
    """What to record next, and what it would settle; nothing where nothing is left to tell apart."""
    best = found.next_experiment
    if best is None:
        return []
    axes = found.actuator.axes
    asked = f"Record {run_in_words(best.command, best.settings, best.duration_s, axes)}"
    if best.load_torque_Nm:
        asked += f", under a load of {amount(best.load_torque_Nm, axes.unit('N·m', USER))} at the user"
    if best.add_signal:
        names = [in_sentence(of_signal(name, axes).title) for name in best.add_signal.split(", ")]
        asked += f", and measure the {all_of(names)} as well"
    rivals = all_of([in_sentence(effect_title(name)) for name in best.separates])
    return [f"{asked}.", f"It would tell {rivals} apart: χ² of {best.expected_chi2:.0f} is expected between them."]


def faults(found: Discovery) -> dict[str, str]:
    """Each fault that was found, by name: 'k2 backlash 0.201 ± 0.012 (backlash 209 µrad)'."""
    phrases = dict(zip(NAMES, phrases_of(found.calibration.k, found.actuator)))
    return {name: f"{BY_NAME[name].label} {value(one)} ({phrases[name]})" for name, one in found.faults.items()}


def _faulty(found: Discovery) -> str:
    """'the faults k1 friction and k2 backlash', "" without one; a phase belongs to its modulus."""
    labels = [fault.label for fault in FAULTS if fault.name in found.faults and fault.name != "k7"]
    return f"the fault{'s' if len(labels) > 1 else ''} {all_of(labels)}" if labels else ""


def document_of(found: Discovery) -> Document:
    """All that is shown of it in words: the verdict and what follows, the effects, the ladder, the candidates."""
    tables = (ladder(found), *free_simulation(found.simulation, found.actuator.axes))
    tables += (per_recording(found), candidates(found))
    asked = next_experiment(found)
    return Document(
        [
            Lines([f"{verdict_name(found)}: {headline(found)}", *sentences(found)]),
            *(Note(warning) for warning in found.warnings),
            *map(Note, together(found.calibration, found.actuator.axes)),
            *added(found),
            *(table for table in tables if table is not None),
            *([Lines(asked)] if asked else []),
        ]
    )


def _rms_in_unit(found: Discovery, rung: Rung) -> str:
    """'That is 42.1 mA rms of the equivalent current (51.0 mA on what was not fitted).'"""
    name = primary(found)
    shown = of_signal(name, found.actuator.axes).scaled(rung.signals[name])
    unseen = rung.holdout_signals.get(name)
    held = "" if unseen is None else f" ({shown.text(unseen)} on what was not fitted)"
    return f"That is {shown.text(rung.signals[name])} rms of the {in_sentence(shown.title)}{held}."


def _fall_in_unit(found: Discovery, first: Rung, last: Rung) -> str:
    """'The equivalent current's falls from 61.1 to 4.69 mA rms.'"""
    name = primary(found)
    shown = of_signal(name, found.actuator.axes).scaled([first.signals[name], last.signals[name]])
    fall = f"from {number(shown.factor * first.signals[name])} to {shown.text(last.signals[name])} rms"
    return f"That of the {in_sentence(shown.title)} falls {fall}."


def _times(first: Rung, last: Rung) -> str:
    fall = f"{number(first.rmse)} to {number(last.rmse)} times the floor"
    if first.holdout_rmse is None or last.holdout_rmse is None:
        return fall
    if last.holdout_rmse <= BAND and abs(last.holdout_rmse - first.holdout_rmse) < _HARDLY * first.holdout_rmse:
        unseen = f"from {number(first.holdout_rmse)} to {number(last.holdout_rmse)} times"
        return f"{fall}; what was not fitted hardly shows it ({unseen})"
    return f"{fall}{on_unseen(first.holdout_rmse, last.holdout_rmse)} times"


def on_unseen(before: float, after: float) -> str:
    """', and on what was not fitted from 4.35 to 1.02', behind how the error falls; else that it does not there."""
    told = f"from {number(before)} to {number(after)}"
    if after < before:
        return f", and on what was not fitted {told}"
    return f"; on what was not fitted it does not fall, {told}"
