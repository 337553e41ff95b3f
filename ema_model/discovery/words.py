"""What a discovery found, in plain words: for the terminal, a notebook, the report and the recording alike."""

from __future__ import annotations

from ema_model.actuator.naming import on_axes
from ema_model.actuator.readings import sentences as phrases_of
from ema_model.comparison.criteria import BAND
from ema_model.comparison.sentences import dependence
from ema_model.comparison.verdict import most_of_floor
from ema_model.discovery.criteria import FAR
from ema_model.discovery.result import Discovery, Rung, misses_unseen
from ema_model.discovery.shown.labels import effect_title, value
from ema_model.discovery.shown.sentences import masked
from ema_model.discovery.shown.tables import added, candidates, ladder, per_recording
from ema_model.discovery.verify import Verified
from ema_model.faults import BY_NAME, FAULTS, NAMES, causes
from ema_model.quantities.numbers import amount, number
from ema_model.quantities.shown import of_signal
from ema_model.quantities.sides import USER
from ema_model.quantities.titles import all_of, in_sentence
from ema_model.simulation.words import run_in_words
from ema_model.text import Document, Lines, Note

VERDICTS = {
    "effects_found": "effects are missing, and have been added",
    "adequate": "nothing is missing: the residual is noise and the model's own floor",
    "partly_explained": "a part of what is missing has been found, and added; of the rest the cause is not known",
    "unknown_effect": "something is missing that none of the known effects explains",
    "not_converged": "the calibration has not converged; what looks like missing physics may be an unfinished fit",
    "not_repeatable": "the run does not repeat itself, so that a comparison over time means nothing",
    "interrupted": "the search was cut off before it had added anything",
}
_MOVED, _MOST_MOVED = 0.5, 3  # σ of a tolerance, from which on a parameter's own value is worth a word; of those
_HARDLY = 0.02  # of the held-out error: what moves it by less is hardly seen there
_NEAR = 1.2  # times the floor, below which a digit more tells a true model from another
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
        return _answer(found)
    if found.verdict == "adequate" and not found.parameters_outside_tolerance and not found.not_claimed:
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
    if found.verdict == "adequate" and faulty:
        return f"No physics is missing: the actuator has {faulty}."
    if found.verdict == "adequate" and found.parameters_outside_tolerance:
        return "No physics is missing, but not all parameters are within their tolerance."
    if found.verdict == "adequate" and found.not_claimed:
        return "No more is left than a true model leaves, and nothing that was tried can be claimed for it."
    if found.verdict == "partly_explained":
        return f"Found in part: {_named(found) or 'a curve'}{f', and {faulty}' if faulty else ''}; {remains(found)}."
    if found.verdict == "unknown_effect" and found.at_floor and found.transmission_seen is not None:
        return f"Motion and current are explained; {found.transmission_seen.short}."
    if found.verdict == "unknown_effect" and found.curve is None:
        if found.not_claimed:  # an effect that would pay does explain some of it
            return f"Something is missing, and nothing that was tried can be claimed for it: {remains(found)}."
        return f"Something is missing that none of the known effects explains: {remains(found)}."
    text = VERDICTS.get(found.verdict, verdict_name(found))
    return f"{text[:1].upper()}{text[1:]}."


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
        return f"what was not fitted is missed by {number(unseen, 2)} times the floor, cause unknown{goes}{shaft}"
    return f"{number(rest, 2 if rest > _NEAR else 3)} times the floor remains, cause unknown{goes}{shaft}"


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
        told.append(f"With {'it' if added == 1 else 'them'} the error falls from {_times(first, last)}.")
        told += masked(found.effects, found.actuator.axes)
    else:
        bare = found.ladder[-2] if found.curve is not None else last  # a curve is no part of the calibrated model
        held = "" if bare.holdout_rmse is None else f" ({number(bare.holdout_rmse)} times on what was not fitted)"
        told.append(f"The calibrated model's error is {number(bare.rmse)} times the floor{held}.")
    if found.floor_believable:
        low, high = found.floor_band
        told.append(f"A true model's error is {low:.2f} to {high:.2f} times the floor (90 % interval).")
    told += not_fitted(found)
    if found.faults:
        told.append(f"{'; '.join(faults(found).values())}. Effects and faults are estimated together.")
    for one in found.effects:
        if one.same_as:
            rivals = all_of([in_sentence(effect_title(name)) for name in one.same_as])
            told.append(f"These recordings cannot tell {in_sentence(effect_title(one.name))} from {rivals}.")
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
    error = found.ladder[-1].holdout_rmse
    at_floor = found.verdict in ("adequate", "effects_found") and found.floor_believable
    if not at_floor or found.held is None or error is None or error <= most_of_floor(found.held.floor_spread):
        return []
    low, high = found.held.floor_band
    told = f"{number(error)} times its floor, where a true model's error is {low:.2f} to {high:.2f} times"
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
    tables = (ladder(found), per_recording(found), candidates(found))
    asked = next_experiment(found)
    return Document(
        [
            Lines([f"{verdict_name(found)}: {headline(found)}", *sentences(found)]),
            *(Note(warning) for warning in found.warnings),
            *added(found),
            *(table for table in tables if table is not None),
            *([Lines(asked)] if asked else []),
        ]
    )


def _times(first: Rung, last: Rung) -> str:
    fall = f"{number(first.rmse)} to {number(last.rmse)} times the floor"
    if first.holdout_rmse is None or last.holdout_rmse is None:
        return fall
    unseen = f"from {number(first.holdout_rmse)} to {number(last.holdout_rmse)} times"
    if last.holdout_rmse <= BAND and abs(last.holdout_rmse - first.holdout_rmse) < _HARDLY * first.holdout_rmse:
        return f"{fall}; what was not fitted hardly shows it ({unseen})"
    return f"{fall}, and on what was not fitted {unseen}"
