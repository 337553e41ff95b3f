"""The first model of a discovery: calibrated to the recordings, before any effect."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from ema_model.actuator import Actuator
from ema_model.actuator.file import check_represents
from ema_model.comparison.compare import weights_of
from ema_model.comparison.loop_lag import other_controller
from ema_model.comparison.residuals import OPEN_LOOP
from ema_model.comparison.result import Comparison
from ema_model.discovery.history import Step, Story, rung_of
from ema_model.discovery.loop import by_inverse_dynamics, is_lost, with_divergence
from ema_model.discovery.refit import settings_in, together
from ema_model.discovery.result import Change
from ema_model.discovery.terms import noise_of, scored_terms, terms_of
from ema_model.discovery.thresholds import FAR
from ema_model.discovery.words import NOT_REPEATABLE, OPEN_LOOP_LEFT
from ema_model.errors import InputError
from ema_model.estimation.model_fit import Data, fit, floor_ratio, gather, in_floors_of, with_effect
from ema_model.models.measured_motion import fit_stretches, with_delay_of_drive
from ema_model.recordings import Measurement
from ema_model.recordings.read import check_same_actuator, prepared
from ema_model.recordings.recording_set import check_held_out
from ema_model.simulation.compiled import compile_library

Progress = Callable[[str], None]

_MOTOR = frozenset({"current_A", "motor_torque_Nm"})  # what a measured motion tells something of


def begun(
    measurements: Sequence[Measurement],
    actuator: Actuator,
    holdout: Sequence[Measurement] = (),
    signals: Sequence[str] | None = None,
    tell: Progress = lambda text: None,
    compared: Comparison | None = None,
) -> Story:
    """The calibrated model, before any effect.

    A loop that is not repeatable is taken by inverse dynamics, where the recordings allow it, and so is an open one:
    there the noise of what is put in adds up in the motion.
    compared: of the same recordings, actuator and signals, whose calibration this one goes on from.
    Raises InputError for recordings that cannot be compared.
    """
    check_same_actuator([*measurements, *holdout])
    check_held_out(measurements, holdout)
    compile_library(actuator)
    actuator = with_delay_of_drive(actuator, measurements)
    is_open = actuator.controller.kind == "open"
    starts = None if compared is None else _where_it_ended(compared)
    simulated = None if is_open else calibrated_story(measurements, actuator, holdout, signals, tell, starts)
    if simulated is not None and simulated.repeatable:
        return simulated
    moved = _by_motion(measurements, actuator, holdout, signals, tell)
    if moved is not None:
        moved.warnings.append(OPEN_LOOP_LEFT if is_open else NOT_REPEATABLE)
        return moved
    story = simulated or calibrated_story(measurements, actuator, holdout, signals, tell)
    if is_open:
        story.warnings.append(OPEN_LOOP)
    return story


def _by_motion(
    measurements: Sequence[Measurement],
    actuator: Actuator,
    holdout: Sequence[Measurement],
    signals: Sequence[str] | None,
    tell: Progress,
) -> Story | None:
    """The same by inverse dynamics; None where the recordings, or the signals that are asked for, do not allow it."""
    inverse = by_inverse_dynamics([*measurements, *holdout], actuator)
    if inverse is None or _MOTOR.isdisjoint(weights_of(signals, actuator)):
        return None
    try:
        return calibrated_story(measurements, inverse, holdout, signals, tell)
    except InputError:  # too little motion
        return None


def calibrated_story(
    measurements: Sequence[Measurement],
    actuator: Actuator,
    holdout: Sequence[Measurement],
    signals: Sequence[str] | None,
    tell: Progress,
    starts: Mapping[str, float] | None = None,
) -> Story:
    """The same of what one model can take, in its loop or without.

    starts: x by name of an earlier calibration, near which this one ends.
    """
    tell("measuring the model's floor")
    data, held = (_data(recordings, actuator, signals) for recordings in (measurements, holdout))
    assert data is not None
    tell("calibrating" if starts is None else "taking on the comparison's calibration")
    far = replace(data, floors=[replace(one, even=True) for one in data.floors])
    base = fit(far, actuator, starts, tell, rough=starts is not None)
    is_far = floor_ratio(far, base.plant, base.calibration.signals) > FAR
    # How the two models differ depends on their parameters: on where the motor comes to stand above all.
    data, lost = with_divergence((far if is_far else data).beside(base), base)
    held = None if held is None else held.beside(base)
    if not (base.calibration.is_final and data.weighs_as(far)):
        base = fit(data, actuator, base.starts, tell)
    data, held = in_floors_of(base, data, held)
    story = Story(data, held, [Step(base, rung_of(Change(), base, data, held), ())], not is_lost(lost))
    if base.plant.simulates_commands:  # before what is missing is kept from driving parameters to their bounds
        left = floor_ratio(data.before_fit, base.plant, base.calibration.signals)
        story.loop_lag = other_controller(base.plant, base.calibration, base.calibration.before, left)
    return story


def _where_it_ended(compared: Comparison) -> Mapping[str, float] | None:
    """x by name; None of a comparison whose calibration is not to be trusted, or that has none."""
    found = compared.calibration
    if found is None or not found.converged:
        return None
    return dict(zip([*found.parameters, *found.starts], map(float, found.x)))


def with_fitted_effects(
    measurements: Sequence[Measurement],
    actuator: Actuator,
    names: Sequence[str],
    tell: Progress = lambda text: None,
) -> Actuator:
    """The actuator with these effects at what the recordings ask for, free to be calibrated about it.

    Their values are first guessed by the score of their fingerprints, at the best order of a periodic one, and then
    fitted, all together.  What the recordings cannot show begins at the library's usual values, what the file has at
    the file's.  Raises InputError for an effect that the model has no place for.
    """
    for name in names:
        check_represents(actuator, name)
    compile_library(actuator)
    story = calibrated_story(measurements, actuator, (), None, tell)
    tell("looking for the effects' values")
    prints, _ = story.fingerprints(names)
    noise, orders = noise_of(story.data, story.current), story.left().orders
    scored = scored_terms(story.current, terms_of(story.data, story.current, prints, noise, orders), noise)
    found = {one.candidate.name: one.candidate for one in scored if one.candidate.predicted_drop > 0.0}
    guessed = {name: found[name].settings for name in names if name in found}
    if guessed:
        fitted = together(story.data, story.current, guessed, story.current.starts, tell)
        guessed = settings_in(fitted, guessed)
    for name in names:
        actuator = with_effect(actuator, name, guessed.get(name, actuator.effects.get(name, {})))
    return actuator


def _data(recordings: Sequence[Measurement], actuator: Actuator, signals: Sequence[str] | None) -> Data | None:
    if not recordings:
        return None
    inside = [prepared(recording, actuator) for recording in recordings]
    return gather(inside, actuator, weights_of(signals, actuator), fit_stretches(inside, actuator))
