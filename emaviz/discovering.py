"""The session's part of Discover: which recordings, the story so far, and its steps on the compute thread."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ema_model.comparison.result import Explanation
from ema_model.discovery import Candidate, Story, begun, result_of, walk
from ema_model.discovery.experiments import next_experiment
from ema_model.discovery.result import Experiment
from ema_model.discovery.story import Step, with_drops
from ema_model.discovery.trial import Trial
from ema_model.discovery.unknown import curve_for
from ema_model.effects import CATALOGUE, find
from ema_model.errors import InputError
from ema_model.user_effects import UserEffect
from emaviz.comparing import Comparing
from emaviz.discovery_keep import keep
from emaviz.discovery_look import Assessment, Look, assessed, look_at
from emaviz.discovery_run import DiscoverEvents, DiscoveryRun, Tell
from emaviz.discovery_source import NOTHING, DiscoverySource
from emaviz.session import Session
from emaviz.worker import Worker

_MOST_FOLLOWED = 8  # times that a fit is begun anew where the one before has ended


class Discovering:
    """A story, told in steps; one step runs at a time, and a stopped one leaves the story as it was."""

    def __init__(self, session: Session, comparing: Comparing) -> None:
        self.session, self.comparing = session, comparing
        self.folder = comparing.folder
        self.events = DiscoverEvents()
        self.source = DiscoverySource(comparing)
        self.look: Look | None = None
        self.experiment: Experiment | None = None
        self.run = DiscoveryRun(session, self.events, self._stopped)
        self._story: Story | None = None
        self._known: dict[Step, Assessment] = {}  # so that a step back is at once
        self._trials: dict[tuple[Step, str], Trial] = {}  # so that nothing is fitted twice
        self._first: Sequence[Candidate] = ()
        self._files = Worker("emaviz-discovery-files", comparing._on_error)

    def close(self) -> None:
        """Ends the threads."""
        self.run.stop()
        self._files.close()

    # --- what is asked ----------------------------------------------------------------------------------------------

    @property
    def running(self) -> bool:
        """Whether a step runs."""
        return self.run.running

    def choose(self, name: str) -> None:
        """A challenge by its name, or Compare's recordings with any other; the story so far is put away."""
        if self.running:
            raise InputError("a step is running; stop it first")
        self.source.choose(name)
        self._story, self.look, self.experiment, self._known, self._trials = None, None, None, {}, {}
        _tell(self.events.looked, None)

    # --- steps ------------------------------------------------------------------------------------------------------

    def start(self) -> bool:
        """Calibrates the model, and looks for what may be missing; False while another long run goes on."""
        if not self.source.ready:
            raise InputError(NOTHING)

        def job(tell: Tell) -> None:
            tell("reading")
            given = self.source.read()
            story = begun(given.fitted, given.actuator, given.held, given.signals, tell)
            self._story, self._first, self.experiment = story, (), None
            self.source.revealed = False
            self._known, self._trials = {}, {}
            self._assess(tell)

        return self.run.begin("Calibrating the model", job)

    def add(self, name: str) -> bool:
        """The best of that effect into the model, refitted; then looks again."""
        look = self._seen()
        candidate = look.candidate(name)
        if candidate is None:
            raise InputError(f"{name[:60]}: no candidate; choose a card")
        return self._add(candidate, look)

    def add_own(self, effect: UserEffect, start: Mapping[str, float]) -> bool:
        """A user's own torque into the model, its parameters fitted from these values."""
        look = self._seen()
        if any(one.key == effect.name for one in look.added):
            raise InputError("this expression is in the model already; remove it there, or change it")
        return self._add(Candidate(effect.name, 0.0, effect.settings(dict(start))), look)

    def _add(self, candidate: Candidate, look: Look) -> bool:
        story, title = self._story, find(candidate.name).title
        assert story is not None
        alike = look.assessment.alike.get(candidate.name, ()) if look.assessment else ()

        def job(tell: Tell) -> None:
            tell("fitting; a combination of effects is compiled on its first use, which takes some seconds")
            trial = self._trial(story, candidate, tell)
            if candidate.name not in CATALOGUE:
                trial = _followed(story, trial, tell)
            self._take(trial, alike, tell)

        return self.run.begin(f"Adding {title.lower()}", job)

    def add_curve(self) -> bool:
        """What is left as a torque curve over the variable that explains it best."""
        look, story = self._seen(), self._story
        assert story is not None
        left = look.assessment.left.explanation if look.assessment else None
        if left is None:
            raise InputError("no variable explains what is left, so that there is no curve to add")

        def job(tell: Tell) -> None:
            trial = curve_for(story.data, story.held, story.current, left, tell)
            if trial is None:
                raise InputError("a torque curve does not pay here: the error would not fall, or only by chance")
            self._take(trial, (), tell)

        return self.run.begin("Adding the curve", job)

    def remove(self, key: str) -> bool:
        """One of the added effects out of the model again, refitted."""
        story = self._story
        self._seen()
        if story is None or all(one.key != key for one in story.added):
            raise InputError(f"{key[:60]} is not in the model")

        def job(tell: Tell) -> None:
            tell("fitting without it")
            smaller = story.without(key, tell)
            tell("measuring the new model's error")
            story.remove(key, smaller)
            self._assess(tell)

        return self.run.begin(f"Removing {find(key).title.lower()}", job)

    def find_all(self) -> bool:
        """Adds what pays, a step after another, as `emaviz discover` does."""
        self._seen()
        story = self._story
        assert story is not None

        def job(tell: Tell) -> None:
            def told(text: str) -> None:
                tell(text)
                if self.look is None or self.look.steps != len(story.steps):
                    self._show(story)  # a step further: the ladder grows

            walk(story, told)
            self._assess(tell)

        return self.run.begin("Finding all that is missing", job)

    def undo(self) -> None:
        """The last step back, at once."""
        self._seen()
        story = self._story
        assert story is not None
        if not story.undo():
            raise InputError("there is no step to take back")
        self._show(story)
        if story.steps[-1] not in self._known:  # of a walk that went on at once
            self.run.begin("Looking again", self._assess)

    def suggest(self) -> bool:
        """Looks for the test that tells the best candidates apart."""
        self._seen()
        story, found = self._story, self._undecided()
        assert story is not None
        if found is None:
            raise InputError("there were no two candidates between which a test would have to decide")
        base, pair = found

        def job(tell: Tell) -> None:
            trials: list[Trial] = []
            for one in pair:
                tell(f"fitting {find(one.name).title.lower()}")
                trials.append(self._trial(base, one, tell))
            tell("simulating the tests that the actuator allows")
            self.experiment = next_experiment(base.data, trials[0].fit, trials[1].fit)
            self._show(story)
            if self.experiment is None:
                _tell(self.events.unsuggested)

        return self.run.begin("Looking for the best next test", job)

    def stop(self) -> None:
        """Ends the step that runs, as soon as its present simulation is done; the story stays as it was."""
        self.run.stop()

    # --- on the compute thread --------------------------------------------------------------------------------------

    def _stopped(self) -> str:
        story, look = self._story, self.look
        if story is not None and (look is None or look.steps != len(story.steps)):
            self._show(story)  # what was added before it was stopped
        return "Stopped; the model is as the ladder shows it." if story else "Stopped."

    def _take(self, trial: Trial, alike: Sequence[str], tell: Tell) -> None:
        tell("measuring the new model's error")  # the last moment to stop
        story = self._story
        assert story is not None
        story.add(trial, ties=alike)
        if self._first:
            self._first = with_drops(self._first, [trial]) if trial.candidate.predicted_drop else self._first
        self._assess(tell)

    def _assess(self, tell: Tell) -> None:
        """Shows the model as it is now, then what may be missing from it."""
        story = self._story
        assert story is not None
        self._show(story)
        step = story.steps[-1]
        if step not in self._known:
            tell("looking at what is left; the library of effects is compiled on its first use")
            found = assessed(story)
            self._known[step] = found
            self._first = self._first or found.candidates
            self._show(story)

    def _show(self, story: Story) -> None:
        known = self._known.get(story.steps[-1])
        found = result_of(story, self._first, self._unknown(story), self.experiment)
        self.look = look_at(story, found, known)
        _tell(self.events.looked, self.look)

    def _unknown(self, story: Story) -> Explanation | None:
        """What is left by the last model; with a torque of no name in it, what that one stands in for."""
        at = next(
            (i for i, step in enumerate(story.steps) if any(one.name not in CATALOGUE for one in step.added)),
            len(story.steps),
        )
        known = self._known.get(story.steps[at - 1])
        return known.left.explanation if known is not None else None

    def _seen(self) -> Look:
        if self.running:
            raise InputError("a step is running; wait for it, or stop it")
        if self.look is None or self._story is None:
            raise InputError("there is no calibrated model yet; press Start")
        return self.look

    def _undecided(self) -> tuple[Story, list[Candidate]] | None:
        """The last step at which two candidates were worth a refit, as a story that ends there, and the best two."""
        story = self._story
        assert story is not None
        for at in range(len(story.steps), 0, -1):
            known = self._known.get(story.steps[at - 1])
            worth = [one for one in known.candidates if Look.is_worth(one)] if known else []
            if len(worth) > 1:
                return Story(story.data, story.held, story.steps[:at]), worth[:2]
        return None

    def _trial(self, story: Story, candidate: Candidate, tell: Tell) -> Trial:
        """A candidate in the last model of a story, refitted once."""
        key = (story.steps[-1], candidate.name)
        known = self._trials.get(key)
        if known is None or known.candidate.settings != candidate.settings:
            known = self._trials[key] = story.trial(candidate, tell)
        return known

    # --- what stays -------------------------------------------------------------------------------------------------

    def keep(self, suffix: str) -> None:
        """Writes the report (.html), the recording (.rrd) or the improved model (.toml) into the data folder, soon."""
        self._files.post(f"keep {suffix}", lambda: self._keep(suffix))

    def _keep(self, suffix: str) -> None:
        if self.look is None:
            raise InputError("nothing is discovered yet; press Start first")
        _tell(self.events.kept, keep(self.look, self.folder, suffix))


def _followed(story: Story, trial: Trial, tell: Tell) -> Trial:
    """A user's effect, fitted again from where its parameters went to a bound: their scale is the user's guess."""
    name = trial.candidate.name
    for _ in range(_MOST_FOLLOWED):
        fitted = trial.fit.calibration.parameters
        if not any(one.at_bound for path, one in fitted.items() if path.startswith(f"effects.{name}.")):
            break
        again = story.trial(replace(trial.candidate, settings=dict(trial.fit.calibration.actuator.effects[name])), tell)
        if again.fit.chi2 >= trial.fit.chi2:
            break
        trial = again
    return trial


def _tell(listeners: list[Callable[..., None]], *values: Any) -> None:
    for listener in listeners:
        listener(*values)
