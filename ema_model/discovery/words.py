"""A discovery in words: sentences, tables, labels."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.actuator import sentences as phrases_of
from ema_model.actuator.parameters import on_axes
from ema_model.comparison.loop_lag import BLAMED, LoopLag
from ema_model.comparison.residuals import dependence
from ema_model.comparison.result import free_simulation
from ema_model.comparison.thresholds import BAND
from ema_model.comparison.verdict import ORDER_OF_PRIMARY
from ema_model.discovery.loop import ControllerSeen
from ema_model.discovery.remaining import Verified
from ema_model.discovery.result import (
    SIGNS,
    Added,
    Candidate,
    Change,
    Discovery,
    Rung,
    effect_title,
    masked,
    misses_unseen,
    of_orders,
    rung_label,
)
from ema_model.discovery.thresholds import FAR
from ema_model.effects import find
from ema_model.effects.effect import FAMILIES
from ema_model.estimation import Calibrated
from ema_model.estimation.calibrate import together
from ema_model.faults import BY_NAME, FAULTS, NAMES, cause_of, causes, vector
from ema_model.quantities import USER, Axes, Quantity, all_of, amount, in_sentence, number, of_signal, with_uncertainty
from ema_model.simulation.run import run_in_words
from ema_model.text import Document, Facts, Lines, Note, Table

# --- what the parts of a discovery are called: effects, steps of the ladder, fitted values ----------------------------


def rung_title(one: Change, axes: Axes) -> str:
    """'+ Cogging torque'."""
    if one.kind in SIGNS:
        names = [name for name in one.names if name not in BY_NAME or name == cause_of(name)[0]]
        return f"{SIGNS[one.kind]} {all_of([effect_title(name) for name in names])}{of_orders(one.orders, axes)}"
    if one.kind == "parameter":
        return f"{on_axes(one.names[0], axes).title} freed"
    if one.kind == "replaced":
        before, after = (effect_title(name) for name in one.names)
        return f"{after} in place of {in_sentence(before)}"
    if one.kind == "fault":  # a phase belongs to its modulus
        return f"Fault {all_of([BY_NAME[name].label for name in causes(one.names)])}"
    label = rung_label(one, axes)
    return label[:1].upper() + label[1:]


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
    alike = {rival: one.name for one in (*found.effects, *found.freed) for rival in one.same_as}
    remarks = [
        f"or {in_sentence(effect_title(alike[one.name]))}: not told apart" if one.name in alike else one.obstacle
        for one in found.ranked
    ]
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
            f"With {'it' if added == 1 else 'them'} the error falls from {_times(first, last)}."
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
            order = of_orders(_orders_of(one), found.actuator.axes) if several else ""
            this = "one of these" if one.same_as else f"{in_sentence(effect_title(one.name))}{order}"
            told.append(f"That {this} is missing is {in_percent(one.probability)} probable.")
    if found.parameters_outside_tolerance:
        outside = all_of([_beside_file(found, path) for path in found.parameters_outside_tolerance])
        whose = "its" if len(found.parameters_outside_tolerance) == 1 else "their"
        by_themselves = {*found.calibration.outside_tolerance, *(one.stands_for for one in found.freed)}
        shared = set(found.parameters_outside_tolerance) - by_themselves
        scale = f", counting what shares {whose} scale, as the torque constant" if shared else ""
        told.append(f"Outside {whose} tolerance{scale}: {outside}.")
    for one in found.freed:
        if one.same_as:
            title = in_sentence(on_axes(one.stands_for, found.actuator.axes).title)
            rivals = all_of([in_sentence(effect_title(name)) for name in one.same_as])
            told.append(f"These recordings cannot tell a different {title} from {rivals}.")
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
    """' That of the equivalent current falls from 61.1 to 4.69 mA rms.'; "" where its digits do not fall."""
    name = primary(found)
    shown = of_signal(name, found.actuator.axes).scaled([first.signals[name], last.signals[name]])
    before, after = (number(shown.factor * rung.signals[name]) for rung in (first, last))
    if before == after:
        return ""
    return f" That of the {in_sentence(shown.title)} falls from {before} to {shown.text(last.signals[name])} rms."


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
