"""The session's part of Discover: which recordings, the story so far, and its steps on the compute thread."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ema_model.discovery import Candidate, begun, verified, walk
from ema_model.discovery.next_experiment import next_experiment
from ema_model.discovery.refit import Trial
from ema_model.discovery.result import Experiment
from ema_model.discovery.snapshot import Look
from ema_model.discovery.unknown import curve_for
from ema_model.discovery.words import verification
from ema_model.effects import CATALOGUE, find
from ema_model.effects.user import UserEffect
from ema_model.errors import InputError, quoted
from ema_model.quantities.titles import in_sentence
from emaviz.session.compare.comparing import Comparing
from emaviz.session.discover.entries import Entries, Entry
from emaviz.session.discover.events import DiscoverEvents
from emaviz.session.discover.keep import keep
from emaviz.session.discover.own_effect import OwnPreview
from emaviz.session.discover.progress import Telling
from emaviz.session.discover.record import checked, experiment_of, take_again
from emaviz.session.discover.refits import check_value, undecided
from emaviz.session.discover.sealing import Sealing
from emaviz.session.discover.source import NOTHING, DiscoverySource, files_of
from emaviz.session.job import Job, Tell
from emaviz.session.session import Session
from emaviz.session.worker import Worker

_MOST_BROUGHT = 50  # discoveries beside the shown one, of a session's file
_KEPT = ("recipe", "steps", "experiment", "revealed", "says")


class Discovering:
    """A story, told in steps; one step runs at a time, and a stopped one leaves the story as it was."""

    def __init__(self, session: Session, comparing: Comparing) -> None:
        self.session, self.comparing = session, comparing
        self.folder = comparing.folder
        self.events = DiscoverEvents()
        self.source = DiscoverySource(comparing)
        self.sealing = Sealing(session, comparing.folder)
        self.look: Look | None = None
        self.job = Job(session.worker, on_stop=self._stopped, on_divergence="the model stays as it was")
        self.entries = Entries(self.source)
        self._told: Telling | None = None
        self._restoring: dict[str, Any] | None = None  # what a session brought, until its steps are taken again
        self._own = OwnPreview()
        self._files = Worker("emaviz-discovery-files", comparing._on_error)

    def close(self) -> None:
        """Ends the threads."""
        self.job.stop()
        self._files.close()

    # --- what is asked ----------------------------------------------------------------------------------------------

    @property
    def running(self) -> bool:
        """Whether a step runs."""
        return self.job.running

    def choose(self, name: str) -> None:
        """A challenge by its name, or Compare's recordings with ""; the story so far stays among the entries."""
        self._leave()
        self.source.choose(name)
        self.events.looked(None)

    def show(self, entry: Entry) -> None:
        """Another discovery, as it was left; InputError while a step runs."""
        if entry is self.entries.current:
            return
        self._leave()
        if entry.told is None:
            self._take_again(entry)
            return
        self.source.recall(entry.recipe, entry.challenge, entry.revealed)
        self.entries.current, self._told, self.look = entry, entry.told, entry.look
        self.events.looked(self.look)

    def _leave(self) -> None:
        if self.running:
            raise InputError("a step is running; stop it first")
        self.job.stop()  # one that waits to begin
        self.entries.leave()
        self._told = self.look = self._restoring = None

    # --- steps ------------------------------------------------------------------------------------------------------

    def start(self) -> bool:
        """Calibrates the model, and looks for what may be missing; False while another long run goes on."""
        if not self.source.ready:
            raise InputError(NOTHING)

        def job(tell: Tell) -> None:
            told = self._begin(self.source.recipe(), tell)
            self._restoring = None  # what a session brought is put away
            self._assess(told, tell)
            while told.take_faults(tell):
                self._assess(told, tell)

        return self.job.begin("Calibrating the model", job)

    def add(self, name: str) -> bool:
        """The best of that effect into the model, refitted; then looks again."""
        told, look = self._seen()
        candidate = look.candidate(name)
        if candidate is None:
            raise InputError(f"{quoted(name, 60)}: no candidate; choose a card")
        return self._add(candidate, told, look)

    def add_own(self, effect: UserEffect, start: Mapping[str, float]) -> bool:
        """A user's own torque into the model, its parameters fitted from these values."""
        told, look = self._seen()
        if any(one.key == effect.name for one in look.added):
            raise InputError("this expression is in the model already; remove it there, or change it")
        return self._add(Candidate(effect.name, 0.0, effect.settings(dict(start))), told, look)

    def _add(self, candidate: Candidate, told: Telling, look: Look) -> bool:
        alike = look.assessment.alike.get(candidate.name, ()) if look.assessment else ()

        def job(tell: Tell) -> None:
            tell("fitting; a combination of effects is compiled on its first use, which takes some seconds")
            trial = told.trials.of(told.story, candidate, tell)
            if candidate.name not in CATALOGUE:
                trial = told.trials.followed(told.story, trial, tell)
            self._take(told, trial, alike, tell)

        return self.job.begin(f"Adding {in_sentence(find(candidate.name).title)}", job)

    def preview_own(self, effect: UserEffect, settings: Mapping[str, float]) -> None:
        """Tells soon what a user's torque with these values would change; of several requests the last one counts."""

        def job() -> None:
            told, look = self._told, self.look
            if told is None or look is None or look.steps != len(told.story.steps) or look.assessment is None:
                return
            try:
                self.events.previewed(self._own.of(told.story, look, effect, settings))
            except (InputError, FloatingPointError) as error:
                self.events.unpreviewed(str(error))

        self.session.worker.post("own torque", job)

    def add_curve(self) -> bool:
        """What is left as a torque curve over the variable that explains it best."""
        told, look = self._seen()
        story, left = told.story, look.assessment.left.explanation if look.assessment else None
        if left is None:
            raise InputError("no variable explains the residual, so that there is no curve to add")

        def job(tell: Tell) -> None:
            trial = curve_for(story.data, story.held, story.current, left, tell)
            if trial is None:
                raise InputError("a torque curve does not pay here: the error would not fall, or only by chance")
            self._take(told, trial, (), tell)

        return self.job.begin("Adding the curve", job)

    def remove(self, key: str) -> bool:
        """One of the added effects out of the model again, refitted."""
        told, look = self._seen()
        if all(one.key != key for one in look.added):
            raise InputError(f"{quoted(key, 60)} is not in the model")

        def job(tell: Tell) -> None:
            tell("fitting without it")
            smaller = told.story.without(key, tell)
            tell("measuring the new model's error")
            told.story.remove(key, smaller)
            self._assess(told, tell)

        return self.job.begin(f"Removing {in_sentence(find(key).title)}", job)

    def find_all(self) -> bool:
        """Adds what pays, a step after another, as `emaviz discover` does."""
        told, _ = self._seen()

        def job(tell: Tell) -> None:
            def say(text: str) -> None:
                tell(text)
                if self.look is None or self.look.steps != len(told.story.steps):
                    self._show(told)  # a step further: the ladder grows

            walk(told.story, say)
            self._assess(told, tell)

        return self.job.begin("Finding all that is missing", job)

    def undo(self) -> None:
        """The last step back, at once."""
        told, _ = self._seen()
        if not told.story.undo():
            raise InputError("there is no step to take back")
        self._show(told)
        if not told.is_assessed:  # of a walk that went on at once
            self.job.begin("Looking again", lambda tell: self._assess(told, tell))

    @property
    def experiment(self) -> Experiment | None:
        """The test that was suggested last."""
        return None if self._told is None else self._told.experiment

    def suggest(self) -> bool:
        """Looks for the test that tells the best candidates apart."""
        told, _ = self._seen()
        found = undecided(told.story, told.known)
        if found is None:
            raise InputError("there were no two candidates between which a test would have to decide")
        base, pair = found

        def job(tell: Tell) -> None:
            trials: list[Trial] = []
            for one in pair:
                tell(f"fitting {in_sentence(find(one.name).title)}")
                trials.append(told.trials.of(base, one, tell))
            tell("simulating the tests that the actuator allows")
            told.experiment = next_experiment(base.data, trials[0].fit, trials[1].fit)
            self._show(told)
            if told.experiment is None:
                self.events.unsuggested()

        return self.job.begin("Looking for the best next test", job)

    # --- on the compute thread --------------------------------------------------------------------------------------

    def _stopped(self) -> str:
        told, look = self._told, self.look
        if told is not None and (look is None or look.steps != len(told.story.steps)):
            self._show(told)  # what was added before it was stopped
        return "Stopped; the model is as the ladder shows it." if told else "Stopped."

    def _begin(self, recipe: Mapping[str, Any], tell: Tell) -> Telling:
        tell("reading")
        given = self.source.read(recipe)
        told = Telling(begun(given.fitted, given.actuator, given.held, given.signals, tell), recipe)
        self.entries.begin(told)
        self._told, self.look, self.source.revealed = told, None, False
        return told

    def _take(self, told: Telling, trial: Trial, alike: Sequence[str], tell: Tell) -> None:
        check_value(trial)
        tell("measuring the new model's error")  # the last moment to stop
        told.add(trial, alike)
        self._assess(told, tell)

    def _assess(self, told: Telling, tell: Tell) -> None:
        """Shows the model as it is now, then what may be missing from it."""
        self._show(told)
        if not told.is_assessed:
            tell("analysing the residual; the library of effects is compiled on its first use")
            told.assess()
            self._show(told)

    def _show(self, told: Telling) -> None:
        self.look = told.look()
        if self.entries.current is not None:
            self.entries.current.look = self.look
        self.events.looked(self.look)

    def _seen(self) -> tuple[Telling, Look]:
        if self.running:
            raise InputError("a step is running; wait for it, or stop it")
        if self.look is None or self._told is None:
            raise InputError("there is no calibrated model yet; press Start")
        return self._told, self.look

    # --- a session --------------------------------------------------------------------------------------------------

    def saved(self) -> dict[str, Any] | None:
        """Every discovery, the one that is shown (else the last) first and the rest as its "others"; None without one.

        In what JSON can hold.
        """
        current = self.entries.current or (self.entries.all[-1] if self.entries.all else None)
        others = [one.saved() for one in self.entries.all if one is not current]
        if self._restoring is not None:
            first = self._restoring
        elif current is None:
            return None
        else:
            if current is self.entries.current:
                current.revealed = self.source.revealed
            first = current.saved()
        return {**first, "others": others} if others else first

    def files(self) -> list[str]:
        """Names in the data folder of what the saved stories are of."""
        saved = self.saved()
        return [] if saved is None else [
            name for one in (saved, *saved.get("others", ())) for name in files_of(one["recipe"])
        ]  # fmt: skip

    def restore(self, saved: Any, names: Mapping[str, str]) -> None:
        """Takes the steps of a session's story again, once no other long run goes on; InputError if it is none.

        names: the files' names of now by those of then.
        """
        if self.running:
            raise InputError("a step of Discover is running; stop it, and load the session again")
        if saved is None:
            return self.choose("")
        stories = [saved, *(saved.get("others") or () if isinstance(saved, dict) else ())]
        for one in stories:
            if not isinstance(one, dict) or not isinstance(one.get("recipe"), dict):
                raise InputError("the session's part of Discover is damaged; save it anew")
            checked(one.get("steps"))
            experiment_of(one.get("experiment"))
            self.source.checked(one["recipe"], names)
        self._leave()
        for one in stories[1:][:_MOST_BROUGHT]:
            self.entries.bring({key: one.get(key) for key in _KEPT if key in one}, names)
        first = {key: value for key, value in saved.items() if key != "others"}
        self._take_again(self.entries.bring(first, names))

    def _take_again(self, entry: Entry) -> None:
        """The steps of one that a session's file brought; its fits begin where they ended then."""
        saved = entry.brought or {}
        steps, experiment = checked(saved.get("steps")), experiment_of(saved.get("experiment"))
        recipe = self.source.take(saved["recipe"], entry.names)
        self.entries.current = entry
        self._told = self.look = None
        self._restoring = {**saved, "recipe": dict(recipe)}
        self.events.looked(None)

        def job(tell: Tell) -> None:
            try:
                told = self._begin(recipe, tell)
                self._assess(told, tell)  # the first step's cards are what the report ranks
                take_again(told.story, steps, tell, lambda: self._show(told))
                told.experiment, self.source.revealed = experiment, bool(saved.get("revealed"))
            finally:
                self._restoring = None
            self._assess(told, tell)

        wanted = {*recipe.get("fitted", ()), *recipe.get("held", ())}
        self.job.begin_when_free(
            "Taking the session's steps again", job, lambda: wanted <= self.comparing.opened.keys()
        )

    # --- what stays -------------------------------------------------------------------------------------------------

    def keep(self, suffix: str) -> None:
        """Writes the report (.html), the recording (.rrd) or the improved model (.toml) into the data folder, soon."""
        self._files.post(f"keep {suffix}", lambda: self._keep(suffix))

    def _keep(self, suffix: str) -> None:
        if self.look is None:
            raise InputError("nothing is discovered yet; press Start first")
        found = self.look.found
        path = keep(self.look, self.folder, suffix)
        self.events.kept(path)
        if suffix == ".toml":
            self.events.verified(path, verification(found, verified(found, path)))
