"""What a discovery found, in plain words: for the terminal, a notebook, the report and the recording alike."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from ema_model.actuator.naming import on_axes
from ema_model.actuator.readings import sentences as phrases_of
from ema_model.comparison.sentences import cause_of
from ema_model.discovery.result import Added, Change, Discovery, Rung
from ema_model.discovery.verify import Verified
from ema_model.effects import CATALOGUE, find
from ema_model.effects.effect import FAMILIES
from ema_model.errors import InputError
from ema_model.estimation import Calibrated
from ema_model.faults import BY_NAME, FAULTS, NAMES
from ema_model.quantities.axes import Axes
from ema_model.quantities.numbers import amount, number, with_uncertainty
from ema_model.quantities.shown import of_signal
from ema_model.quantities.sides import USER
from ema_model.quantities.titles import in_sentence
from ema_model.simulation.words import run_in_words
from ema_model.text import Document, Lines, Note, Table

VERDICTS = {
    "effects_found": "effects are missing, and have been added",
    "adequate": "nothing is missing: the residual is noise and the model's own floor",
    "partly_explained": "a part of what is missing has been found, and added; of the rest the cause is not known",
    "unknown_effect": "something is missing that none of the known effects explains",
    "not_converged": "the calibration has not converged; what looks like missing physics may be an unfinished fit",
    "not_repeatable": "the run does not repeat itself, so that a comparison over time means nothing",
}
_SIGNS = {"effect": "+", "removed": "−"}
FLOOR_NOTE = (
    "Errors are rms over all fitted signals in units of the floor: 1 is what noise and the model's own limits leave. "
    "A little below 1 is usual, as the floor is measured on the safe side."
)


def headline(found: Discovery) -> str:
    """The verdict in one sentence; in two where the controller is not the file's."""
    if found.controller_seen is None:
        return _answer(found)
    if found.verdict == "adequate" and not found.parameters_outside_tolerance:
        return "The controller is not what the file says; without it, motion and current show nothing else missing."
    return f"The controller is not what the file says. Without it: {in_sentence(_answer(found))}"


def _answer(found: Discovery) -> str:
    faulty = _faulty(found)
    if found.verdict == "effects_found":
        return f"The model lacks {_named(found)}{f', and the actuator has {faulty}' if faulty else ''}."
    if found.verdict == "adequate" and faulty:
        return f"No physics is missing: the actuator has {faulty}."
    if found.verdict == "adequate" and found.parameters_outside_tolerance:
        return "No physics is missing, but not all parameters are within their tolerance."
    if found.verdict == "partly_explained":
        return f"Found in part: {_named(found) or 'a curve'}{f', and {faulty}' if faulty else ''}; {remains(found)}."
    if found.verdict == "unknown_effect" and found.at_floor and found.transmission_seen is not None:
        return "Motion and current are explained; the user's position beyond the motor's is not."
    if found.verdict == "unknown_effect" and found.curve is None:
        return f"Something is missing that none of the known effects explains: {remains(found)}."
    text = VERDICTS.get(found.verdict, found.verdict.replace("_", " "))
    return f"{text[:1].upper()}{text[1:]}."


def _named(found: Discovery) -> str:
    """'cogging torque and constant load or current sensor bias, which cannot be told apart'; "" where none is."""
    # Once, where two orders of one effect were added.
    groups = {one.name: [one.name, *one.same_as] for one in reversed(found.effects)}
    names = [" or ".join(in_sentence(effect_title(name)) for name in groups[one]) for one in reversed(groups)]
    if any(len(group) > 1 for group in groups.values()):
        return f"{', and '.join(names)}, which cannot be told apart"
    return _listed(names) if names else ""


def remains(found: Discovery) -> str:
    """'4.0 times the floor remains, cause unknown, varies with the load'."""
    if found.at_floor and found.transmission_seen is not None:
        return "motion and current are explained, the user's position beyond the motor's is not"
    if found.at_floor and found.unknown is None:
        return "what remains is as small as the floor, but lasts longer than noise"
    goes = "" if found.unknown is None else f", varies with {cause_of(found.unknown.variable, found.unknown.modulator)}"
    return f"{number(found.ladder[-1].rmse, 2)} times the floor remains, cause unknown{goes}"


def repeatability(found: Discovery) -> list[str]:
    """How near the rig comes to itself, where a command was recorded twice."""
    twice = found.repeated
    if twice is None:
        return []
    axes = found.actuator.axes
    each = [of_signal(name, axes).scaled([value]).text(value) for name, value in twice.signals.items()]
    told = f"{' and '.join(twice.recordings)} are of one command, and apart by {_listed(each)} rms"
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
    if found.effects:
        told.append(f"With {'it' if len(found.effects) == 1 else 'them'} the error falls from {_times(first, last)}.")
    else:
        bare = found.ladder[-2] if found.curve is not None else last  # a curve is no part of the calibrated model
        held = "" if bare.holdout_rmse is None else f" ({number(bare.holdout_rmse)} times on what was not fitted)"
        told.append(f"The calibrated model's error is {number(bare.rmse)} times the floor{held}.")
    if found.faults:
        told.append(f"{'; '.join(faults(found).values())}. Effects and faults are estimated together.")
    for one in found.effects:
        if one.same_as:
            rivals = _listed([in_sentence(effect_title(name)) for name in one.same_as])
            told.append(f"These recordings cannot tell {in_sentence(effect_title(one.name))} from {rivals}.")
    if found.parameters_outside_tolerance:
        outside = _listed([on_axes(path, found.actuator.axes).title for path in found.parameters_outside_tolerance])
        whose = "its" if len(found.parameters_outside_tolerance) == 1 else "their"
        told.append(f"Outside {whose} tolerance: {outside}.")
    if found.unknown is not None:
        told.append(("Something else is left. " if found.effects else "") + found.unknown.sentence)
    told += not_claimed(found)
    if found.curve is not None:
        told.append(f"A torque curve stands in for it, with which the error falls from {_times(first, last)}.")
    return told + repeatability(found)


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
        asked += f", and measure the {_listed(names)} as well"
    rivals = _listed([in_sentence(effect_title(name)) for name in best.separates])
    return [f"{asked}.", f"It would tell {rivals} apart: χ² of {best.expected_chi2:.0f} is expected between them."]


def faults(found: Discovery) -> dict[str, str]:
    """Each fault that was found, by name: 'k2 backlash 0.201 ± 0.012 (backlash 209 µrad)'."""
    phrases = dict(zip(NAMES, phrases_of(found.calibration.k, found.actuator)))
    return {name: f"{BY_NAME[name].label} {value(one)} ({phrases[name]})" for name, one in found.faults.items()}


def _faulty(found: Discovery) -> str:
    """'the faults k1 friction and k2 backlash', "" without one; a phase belongs to its modulus."""
    labels = [fault.label for fault in FAULTS if fault.name in found.faults and fault.name != "k7"]
    return f"the fault{'s' if len(labels) > 1 else ''} {_listed(labels)}" if labels else ""


def effect_title(name: str) -> str:
    """'Cogging torque' of 'cogging_torque'; the name itself of an effect that is not known here."""
    try:
        return find(name).title
    except InputError:
        return name


def rung_title(one: Change, axes: Axes) -> str:
    """'+ Cogging torque'."""
    if one.kind in _SIGNS:
        return f"{_SIGNS[one.kind]} {_listed([effect_title(name) for name in one.names])}{_of_orders(one, axes)}"
    if one.kind == "parameter":
        return f"{on_axes(one.names[0], axes).title} freed"
    label = rung_label(one, axes)
    return label[:1].upper() + label[1:]


def rung_label(one: Change, axes: Axes) -> str:
    """'+ cogging_torque of orders 28, 14', by the library's names: for the terminal and JSON."""
    if one.kind == "fault":
        return f"fault {_listed([BY_NAME[name].label for name in one.names])}"
    if one.kind == "parameter":
        return f"{on_axes(one.names[0], axes).path} outside its tolerance"
    if one.kind == "without_controller":
        return "calibrated, without the controller"
    if one.kind == "calibrated":
        return one.kind
    names = [name if name in CATALOGUE else in_sentence(effect_title(name)) for name in one.names]
    return f"{_SIGNS[one.kind]} {_listed(names)}{_of_orders(one, axes)}"


def _of_orders(one: Change, axes: Axes) -> str:
    """' of orders 28, 14', or along a linear motor ' of pitches 2.50 mm, 417 µm'."""
    if not one.orders:
        return ""
    if axes.motor == "linear":
        return f" of pitches {', '.join(amount(2.0 * math.pi / order, 'm') for order in one.orders)}"
    return f" of orders {', '.join(f'{order:g}' for order in one.orders)}"


def value(one: Calibrated) -> str:
    """'12.2 ± 0.70 mN·m': with half of the 90 % interval."""
    half = 0.5 * (one.interval90[1] - one.interval90[0])
    return with_uncertainty(one.value, half, one.unit)


def settings(found: Discovery, one: Added) -> dict[str, str]:
    """Each parameter of an added effect with its value; whole numbers, which are chosen and not fitted, first."""
    chosen = {name: f"{setting:g}" for name, setting in one.chosen.items()}
    return chosen | {name: value(fitted_of(found, one, name)) for name in one.parameters}


def fitted_of(found: Discovery, one: Added, name: str) -> Calibrated:
    """A fitted parameter of an added effect as the last model has it: later effects may have moved it."""
    return found.calibration.parameters.get(f"effects.{one.key}.{name}", one.parameters[name])


def document_of(found: Discovery) -> Document:
    """All that the terminal and a notebook show: the verdict, the effects, the ladder, the candidates."""
    notes = [Note(sentence) for sentence in [*found.warnings, *repeatability(found)]]
    head = Lines([f"{found.verdict}: {headline(found)}"])
    return Document([head, *notes, *_added(found), *_tables(found), *_rest(found)])


def _added(found: Discovery) -> Iterator[Lines]:
    for one in found.effects:
        effect = find(one.name)
        names = {name: on_axes(f"effects.{one.key}.{name}", found.actuator.axes).name for name in one.parameters}
        lines = [f"{names.get(name, name):24}  {told}" for name, told in settings(found, one).items()]
        if effect.family == "drive":
            lines.append(f"it belongs to {FAMILIES[effect.family]}")
        if one.same_as:
            rivals = _listed([in_sentence(effect_title(name)) for name in one.same_as])
            lines.append(f"these recordings cannot tell it from {rivals}")
        yield Lines(lines, f"{effect.title}: {effect.equation}")
    if found.faults:
        yield Lines(list(faults(found).values()), "faults of the actuator")


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


def _tables(found: Discovery) -> Iterator[Table]:
    yield _ladder(found)
    if (table := per_recording(found)) is not None:
        yield table
    if found.candidates:
        rows = [
            [one.name, f"{one.predicted_drop:.0f}", "" if one.refitted_drop is None else f"{one.refitted_drop:.0f}"]
            for one in found.candidates
        ]
        remarks = [one.untestable_reason for one in found.candidates]
        yield Table(("predicted", "refitted"), rows, "candidates", remarks, "(fall of χ²)")


def _ladder(found: Discovery) -> Table:
    """Errors in floors; in the signals' units where the floor is not to be believed."""
    axes = found.actuator.axes
    labels = [rung_label(one.change, axes) for one in found.ladder]
    if found.floor_believable:
        errors = [[_three(one.rmse), _three(one.holdout_rmse)] for one in found.ladder]
        return _table(("fitted", "held out"), labels, errors, "(1 is the floor)")
    shown = {
        name: of_signal(name, axes).scaled([one.signals[name] for one in found.ladder])
        for name in found.ladder[0].signals
    }
    errors = [[one.text(rung.signals[name]) for name, one in shown.items()] for rung in found.ladder]
    return _table([one.title for one in shown.values()], labels, errors, "(rms of what was fitted)")


def _table(heads: Sequence[str], labels: Sequence[str], errors: Sequence[list[str]], unit: str) -> Table:
    return Table(tuple(heads), [[label, *one] for label, one in zip(labels, errors)], "error ladder", unit=unit)


def _rest(found: Discovery) -> Iterator[Lines]:
    if found.parameters_outside_tolerance:
        outside = ", ".join(on_axes(name, found.actuator.axes).path for name in found.parameters_outside_tolerance)
        yield Lines([f"outside their tolerance: {outside}"])
    if found.verdict in ("partly_explained", "unknown_effect"):
        yield Lines([remains(found)])
    if found.unknown is not None:
        yield Lines([found.unknown.sentence])
    for lines in (not_claimed(found), next_experiment(found)):
        if lines:
            yield Lines(lines)


def _three(rmse: float | None) -> str:
    return "" if rmse is None else f"{rmse:.3f}"


def _times(first: Rung, last: Rung) -> str:
    fall = f"{number(first.rmse)} to {number(last.rmse)} times the floor"
    if first.holdout_rmse is None or last.holdout_rmse is None:
        return fall
    return f"{fall}, and on what was not fitted from {number(first.holdout_rmse)} to {number(last.holdout_rmse)} times"


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
