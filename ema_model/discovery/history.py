"""How a model grows: from the calibrated one, an effect a step, each with its error; steps can be taken back.

A search takes steps by itself; a person at the page takes the same by hand.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile

from ema_model.actuator import Actuator
from ema_model.actuator.file import cannot_represent, check_represents
from ema_model.comparison.compare import weights_of
from ema_model.comparison.explain import Explanation
from ema_model.comparison.free_simulation import Simulated
from ema_model.comparison.loop_lag import LoopLag, other_controller
from ema_model.comparison.regions import Event
from ema_model.comparison.residuals import OPEN_LOOP
from ema_model.comparison.result import Comparison
from ema_model.discovery.curve import curve_trial
from ema_model.discovery.fingerprints import Fingerprint, fingerprints, may_act, of_the_file
from ema_model.discovery.loop import ControllerSeen, by_inverse_dynamics, is_lost, with_divergence
from ema_model.discovery.refit import (
    Trial,
    fitted_to_the_end,
    refitted,
    settings_in,
    stands_for,
    together,
    without_fault,
)
from ema_model.discovery.remaining import Left, at_floor, left_by
from ema_model.discovery.result import Added, Candidate, Change, Contradiction, Rung, StoodIn
from ema_model.discovery.terms import evidence_of_fit, noise_of, scored_terms, terms_of
from ema_model.discovery.thresholds import FAR, HALF, NAMED
from ema_model.discovery.transmission import TransmissionSeen, TwoMasses
from ema_model.discovery.uncertainty import settled
from ema_model.discovery.words import NOT_REPEATABLE, OPEN_LOOP_LEFT
from ema_model.effects import CATALOGUE, catalogue_name
from ema_model.errors import InputError
from ema_model.estimation import Calibration
from ema_model.estimation.model_fit import (
    Data,
    Fit,
    as_in,
    fit,
    floor_ratio,
    gather,
    holdout_fit,
    in_floors_of,
    ratio_by_recording,
    rms_by_signal,
    with_effect,
    without_effect,
)
from ema_model.faults import NAMES as FAULTS
from ema_model.faults import cause_of
from ema_model.models.measured_motion import fit_stretches, with_delay_of_drive
from ema_model.recordings import Measurement
from ema_model.recordings.read import check_same_actuator, prepared
from ema_model.recordings.recording_set import check_held_out
from ema_model.simulation.pack import compile_behind, compile_library

Progress = Callable[[str], None]

_MOVED = 1.5  # σ that a parameter comes back by, when it had been standing in for an effect
_MOST_PITCHES = 8  # along a linear motor, each of which is simulated


@dataclass(frozen=True, eq=False)
class Step:
    """A model on the way: its fit, its rung of the ladder, and the effects that were added so far."""

    fit: Fit
    rung: Rung
    added: tuple[Added, ...]
    settled_from: Step | None = None  # the same before its fit was settled, or its errors were told in other floors


def change_of(trial: Trial, parameter: str) -> Change:
    """What a step that adds this changes; parameter: the path of the one that it stands for."""
    if trial.faults:
        return Change("fault", trial.faults)
    name = trial.candidate.name
    if parameter:
        return Change("parameter", (parameter,))
    orders = tuple(values["order"] for key, values in trial.effects.items() if key != name and "order" in values)
    return Change("effect", (name,), orders)


def rung_of(change: Change, found: Fit, data: Data, held: Data | None) -> Rung:
    """A fit's errors, with those of what was held out."""
    shown = found.calibration.signals
    ratio, rms = floor_ratio(data, found.plant, shown), rms_by_signal(data, found.plant, shown)
    each = ratio_by_recording(data, found.plant, shown)
    unseen, unseen_rms, unseen_each = (None, {}, {}) if held is None else holdout_fit(held, found)
    return Rung(change, ratio, unseen, rms, unseen_rms, shown, each, unseen_each)


def stood_in(before: Fit, after: Fit) -> tuple[StoodIn, ...]:
    """Parameters that came back toward the file's value."""
    moved = []
    for path, one in before.calibration.parameters.items():
        now = after.calibration.parameters.get(path)  # None of one that an effect multiplies
        if now is not None and not path.startswith("effects.") and abs(one.z) - abs(now.z) > _MOVED:
            moved.append(StoodIn(path, one.z, now.z))
    return tuple(moved)


def refreshed(one: Added, calibration: Calibration) -> Added:
    """With the values of a calibration."""
    path = f"effects.{one.key}."
    fitted = {name.removeprefix(path): value for name, value in calibration.parameters.items() if name.startswith(path)}
    settings = calibration.actuator.effects[one.key]
    chosen = {name: value for name, value in settings.items() if name not in fitted}
    return replace(one, parameters=fitted, chosen=chosen)


@dataclass(frozen=True, eq=False)
class ShownFit:
    """What is computed of a fit to be shown alone: a step back shows it again at once."""

    data: Data  # in whose floors
    held: Data | None
    calibration: Calibration  # with intervals
    events: Sequence[Event]
    simulation: Mapping[str, Simulated]

    def is_of(self, data: Data, held: Data | None) -> bool:
        """Whether it is of these recordings, whatever the floors."""
        return self.data.has_recordings_of(data) and (
            held is self.held or (held is not None and held.has_recordings_of(self.held))
        )


@dataclass
class Story:
    """The steps so far, and the recordings that they are judged by."""

    data: Data
    held: Data | None
    steps: list[Step]
    repeatable: bool = True
    warnings: list[str] = field(default_factory=list)
    ties: dict[str, str] = field(default_factory=dict)  # effects by the fault that would explain as much
    refused: dict[str, str] = field(default_factory=dict)  # effects that are not claimed, and what speaks against each
    support: dict[str, tuple[str, ...]] = field(default_factory=dict)  # models that bear out an effect, by its name
    controller_seen: ControllerSeen | None = None  # where it is not the file's
    loop_lag: LoopLag | None = None  # likewise, as the first fit of the loop showed it
    transmission_seen: TransmissionSeen | None = None  # where the user's position leaves the motor's
    two_masses_seen: TwoMasses | None = None  # where a second mass swings on the motor's and no model holds it
    disagreements: list[Contradiction] = field(default_factory=list)  # of held-out recordings
    turned: list[Contradiction] = field(default_factory=list)  # the same of those whose encoder was put right
    calm: dict[Fit, Fit] = field(default_factory=dict)  # fits by those that they were settled from
    shown: dict[Fit, ShownFit] = field(default_factory=dict)

    @property
    def base(self) -> Fit:
        """The calibrated model without any effect."""
        return self.steps[0].fit

    @property
    def current(self) -> Fit:
        """The last model."""
        return self.steps[-1].fit

    @property
    def without_curve(self) -> Fit:
        """The last model that has no curve of what is unknown, which would take up anything."""
        return next(step.fit for step in reversed(self.steps) if all(one.name in CATALOGUE for one in step.added))

    @property
    def added(self) -> tuple[Added, ...]:
        """The effects in the last model."""
        return self.steps[-1].added

    @property
    def of_the_file(self) -> Mapping[str, Mapping[str, float]]:
        """Effects that the actuator's file has, as it has them."""
        return self.base.actuator.effects

    @property
    def ladder(self) -> list[Rung]:
        """The error of each step."""
        return [step.rung for step in self.steps]

    @property
    def named(self) -> list[str]:
        """The library's effects in the model that are no parameters outside their tolerance."""
        return [one.name for one in self.added if one.name in CATALOGUE and not one.stands_for]

    def left(self) -> Left:
        """What the last model leaves."""
        return left_by(self.data, self.current)

    def fingerprints(
        self, names: Sequence[str] | None = None, orders: Sequence[float] | None = None
    ) -> tuple[list[Fingerprint], list[Candidate]]:
        """Of all effects (or these), at all orders that can be seen (or these); and what the model has no place for."""
        actuator = self.current.actuator
        known = actuator.effects
        acting = [name for name in CATALOGUE if may_act(name, actuator)]
        wanted = [name for name in (acting if names is None else names) if name not in known]
        barred = {name: reason for name in wanted if (reason := cannot_represent(actuator, name))}
        wanted = [name for name in wanted if name not in barred]
        given = [name for name in self.of_the_file if name not in {one.key for one in self.added}]
        orders = self.left().orders if orders is None else orders
        if actuator.axes.motor == "linear":
            orders = orders[:_MOST_PITCHES]  # the rest are there to tell what noise is
        prints = fingerprints(self.data, self.current, wanted, orders)
        prints += of_the_file(self.current, [name for name in given if names is None or name in names])
        return prints, [Candidate(name, 0.0, {}, cannot_represent=reason) for name, reason in barred.items()]

    def trial(self, candidate: Candidate, tell: Progress = lambda text: None) -> Trial:
        """One candidate in the model, refitted."""
        name = candidate.name
        is_the_files = name in self.of_the_file and all(one.key != name for one in self.added)
        return refitted(self.data, self.current, candidate, self.current.starts, tell, key=name if is_the_files else "")

    def curve(self, explanation: Explanation | None, tell: Progress = lambda text: None) -> Trial | None:
        """The residual's own curve as a torque, refitted, if the model with it is far more probable."""
        trial = curve_trial(self.data, self.current, explanation, tell)
        return trial if trial is not None and self.gain(trial.fit) > NAMED else None

    def gain(self, found: Fit, beside: Fit | None = None) -> float:
        """By how much more probable a fit makes the recordings than another, the last model: as a logarithm."""
        beside = beside or self.current
        noise = noise_of(self.data, beside)
        after, before = (evidence_of_fit(self.data, self.held, one, noise).log for one in (found, beside))
        return after - before

    def add(self, trial: Trial, ties: Sequence[str] = ()) -> None:
        """Takes a trial for the next model."""
        if trial.faults:
            self._tell_in_floors_of(trial.fit)
            if ties:
                self.ties[trial.candidate.name] = ties[0]
        before, moved = self.steps[-1].rung, stood_in(self.current, trial.fit)
        parameter = "" if trial.faults else stands_for(self.current, trial)
        rung = self._rung(change_of(trial, parameter), trial.fit)
        errors = before.rmse, rung.rmse, before.holdout_rmse, rung.holdout_rmse
        new = [
            Added(catalogue_name(key), {}, *errors, tuple(ties), key, {}, moved, (), parameter, key in self.of_the_file)
            for key in trial.effects
        ]
        self._append(trial.fit, rung, (*self.added, *new))
        compile_behind(trial.fit.actuator)

    def remove(self, key: str, found: Fit | None = None) -> None:
        """Takes an effect or a fault out again, as a step of its own; found: the fit without it, if it is known."""
        smaller = found or self.without(key)
        if key in FAULTS:
            self._tell_in_floors_of(smaller)
        names = cause_of(key) if key in FAULTS else (next(one.name for one in self.added if one.key == key),)
        rung = self._rung(Change("removed", names), smaller)
        self._append(smaller, rung, tuple(one for one in self.added if one.key != key))

    def swap(self, key: str, trial: Trial) -> None:
        """Takes a trial in the place of an effect, as a step of its own."""
        place = next(i for i, one in enumerate(self.added) if one.key == key)
        old, name = self.added[place], trial.candidate.name
        rung = self._rung(Change("replaced", (old.name, name)), trial.fit)
        errors = old.rmse_before, rung.rmse, old.holdout_before, rung.holdout_rmse
        new = Added(name, {}, *errors, (), name, of_the_file=name in self.of_the_file)
        self._append(trial.fit, rung, (*self.added[:place], new, *self.added[place + 1 :]))
        compile_behind(trial.fit.actuator)

    def tie(self, key: str, name: str, equal: bool) -> None:
        """Names another effect beside one of the last model's, as not to be told from it, or no more."""
        last = self.steps[-1]
        added = [
            replace(one, same_as=(*(known for known in one.same_as if known != name), *((name,) if equal else ())))
            if one.key == key
            else one
            for one in last.added
        ]
        self.steps[-1] = replace(last, added=tuple(added))

    def set_probability(self, key: str, probability: float) -> None:
        """Says how probable it is that an effect of the last model, or what cannot be told from it, is missing."""
        last = self.steps[-1]
        added = (replace(one, probability=probability) if one.key == key else one for one in last.added)
        self.steps[-1] = replace(last, added=tuple(added))

    def without(self, key: str, tell: Progress = lambda text: None, found: Fit | None = None) -> Fit:
        """The last model, or another one that was found, without one of its effects or faults, refitted."""
        found = found or self.current
        if key in FAULTS:
            return without_fault(self.data, found, key, tell)
        actuator = without_effect(found.actuator, key)
        if key in self.of_the_file:
            actuator = as_in(self.base.actuator, key, actuator)
        return fit(self.data, actuator, found.starts, tell, found.faults)

    def finish(self, tell: Progress = lambda text: None) -> None:
        """Fits the last model to its very end, with intervals, where it was refitted roughly or its floor is another.

        How far a model is from its three-phase twin goes with how it moves: where the one before it moved otherwise,
        since it left twice as much or more, the floor is measured anew beside this one.
        """
        last = self.steps[-1]
        if len(self.steps) == 1:
            return
        fits = [step.fit for step in self.steps[-2:]]
        before, after = (floor_ratio(self.data, one.plant, one.calibration.signals) for one in fits)
        moves_otherwise = before > FAR and after < HALF * before
        is_final = last.fit.calibration.is_final
        data = self.data.beside(last.fit) if moves_otherwise else self.data
        if is_final and data.weighs_as(self.data):
            return
        again = not is_final and (last.rung.change.kind == "fault" or before > FAR)
        found = fitted_to_the_end(data, last.fit, again, tell)  # tell may raise to stop
        held = self.held.beside(last.fit) if moves_otherwise and self.held is not None else self.held
        self.steps.pop()
        if moves_otherwise:
            self.data, self.held = data, held
            self._tell_in_floors_of(found)
        self._append(found, self._rung(last.rung.change, found), last.added)

    def settle(self, tell: Progress = lambda text: None) -> None:
        """Fits the models anew as what each leaves asks for, where what the last one leaves is no noise.

        Counted in the sensors' noise, an error that the model cannot have outvotes every tolerance.  All of them, so
        that the ladder's rungs are of one kind: a settled model may leave more than one that was bent.
        """
        if self.settled(self.current, tell) is self.current:
            return
        calms = [self.settled(step.fit, tell) for step in self.steps]  # tell may raise to stop: then all stay
        before, self.steps = self.steps, []
        for step, calm in zip(before, calms):
            if calm is step.fit:
                self.steps.append(step)
            else:
                self._append(calm, self._rung(step.rung.change, calm), step.added, step)

    def settled(self, found: Fit, tell: Progress = lambda text: None) -> Fit:
        """A fit made anew as what it leaves asks for; itself where it is at the floor, or is so already."""
        if found in self.calm.values() or at_floor(self.data, found):
            return found
        if found not in self.calm:
            tell("calibrating with the residual as the noise")
            self.calm[found] = settled(self.data, found, tell)
        return self.calm[found]

    def to_store(self) -> Story:
        """The same with no more than its steps need: what they were settled from is told apart no more."""
        fits = {step.fit for step in self.steps}
        return replace(
            self,
            steps=[replace(step, settled_from=None) for step in self.steps],
            calm={one: one for one in [*self.calm.values()] if one in fits},
            shown={found: one for found, one in [*self.shown.items()] if found in fits},
        )

    @property
    def undo_is_at_once(self) -> bool:
        """Whether nothing is simulated by it: with other faults, errors are told in other floors."""
        return len(self.steps) < 2 or self.steps[-2].fit.faults == self.current.faults

    def undo(self) -> bool:
        """Takes the last step back; False where there is none."""
        if len(self.steps) == 1:
            return False
        faults = self.steps.pop().fit.faults
        if faults != self.current.faults:
            as_now = takewhile(lambda step: step.fit.faults == self.current.faults, reversed(self.steps))
            self._tell_in_floors_of([*as_now][-1].fit)
        return True

    @property
    def bare(self) -> int:
        """The number of steps before the first effect: the calibrated model, and its faults."""
        return next((i for i, step in enumerate(self.steps) if step.added), len(self.steps))

    def hold_out(self, held: Data) -> None:
        """Held-out recordings as they are read from now on; all steps are told in their errors."""
        self.held = held
        told = (self._rung(one.rung.change, one.fit) for one in self.steps)
        self.steps = [replace(one, rung=rung) for one, rung in zip(self.steps, told)]

    def take_over(self, other: Story) -> None:
        """Goes on as another story of the same recordings, by another model; its warnings come last."""
        self.data, self.held, self.steps = other.data, other.held, other.steps
        self.turned = other.turned
        self.ties, self.calm, self.shown = other.ties, other.calm, other.shown
        self.refused = {**self.refused, **other.refused}
        self.warnings += other.warnings

    def back_to_before(self, key: str) -> None:
        """Takes an effect back, and all that was done since it was added."""
        while any(one.key == key for one in self.added):
            self.undo()

    def restart(self) -> None:
        """Takes all effects back."""
        del self.steps[self.bare :]

    def _tell_in_floors_of(self, found: Fit) -> None:
        """All errors from now on: how far the model is from its three-phase twin depends on the faults."""
        self.data, self.held = in_floors_of(found, self.data, self.held)
        told = (self._rung(one.rung.change, one.fit) for one in self.steps)
        self.steps = [replace(one, rung=rung, settled_from=one) for one, rung in zip(self.steps, told)]

    def _append(self, found: Fit, rung: Rung, added: Sequence[Added], settled_from: Step | None = None) -> None:
        # All with the last model's values: what is added later moves what was there.
        self.steps.append(Step(found, rung, tuple(refreshed(one, found.calibration) for one in added), settled_from))

    def _rung(self, change: Change, found: Fit) -> Rung:
        return rung_of(change, found, self.data, self.held)


# --- the first model of a discovery: calibrated to the recordings, before any effect ----------------------------------

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
