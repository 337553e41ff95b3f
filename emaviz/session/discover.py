"""Discovering without a screen."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import save_actuator
from ema_model.discovery import Candidate, Story, verified
from ema_model.discovery.fingerprints import Preview as Room
from ema_model.discovery.fingerprints import preview as room_for
from ema_model.discovery.history import Step
from ema_model.discovery.next_experiment import next_experiment
from ema_model.discovery.refit import Trial
from ema_model.discovery.result import Experiment
from ema_model.discovery.search import search
from ema_model.discovery.snapshot import Look
from ema_model.discovery.words import effect_title, verification
from ema_model.effects import CATALOGUE
from ema_model.effects.user import Expression, UserEffect, parse
from ema_model.errors import InputError, quoted
from ema_model.exports.replay import EXACT, TargetProof
from ema_model.faults import NAMES
from ema_model.files.written import whole_file
from ema_model.quantities import in_sentence
from emaviz.session.compare import Comparing
from emaviz.session.data_folder import DataFolder
from emaviz.session.discovery_entries import Entries, Entry, Shown, Telling, undecided
from emaviz.session.discovery_source import NOTHING, DiscoverySource, Sealing
from emaviz.session.explore import Session
from emaviz.session.jobs import Job, Signal, Tell, Worker, aside
from emaviz.session.session_file import Inputs, Provenance

Array = NDArray[np.float64]

# --- what the page hears of a discovery, besides its job --------------------------------------------------------------


@dataclass
class DiscoverEvents:
    """What the screen listens to; called on the threads that work, so listeners only hand over."""

    looked: Signal[[Look | None]] = field(default_factory=Signal)  # the story has changed
    unsuggested: Signal[[]] = field(default_factory=Signal)  # no test tells the candidates apart
    revealed: Signal[[]] = field(default_factory=Signal)
    previewed: Signal[[Any]] = field(default_factory=Signal)  # `discovery_own.Preview`
    unpreviewed: Signal[[str]] = field(default_factory=Signal)  # why a torque has no preview
    kept: Signal[[Path]] = field(default_factory=Signal)  # a report, a recording, a model
    verified: Signal[[Path, str]] = field(default_factory=Signal)  # a kept model, and how good it is


# --- a user's own torque before it is in the model: the text as it is typed, and what its values would change ---------


@dataclass(frozen=True)
class Typed:
    """A text as it stands: the expression, if it is one, and what is to be said of it."""

    expression: Expression | None
    line: str


@dataclass(frozen=True, eq=False)
class Preview:
    """What a torque with these values would change, as a candidate of a picture of the story."""

    look: Look
    candidate: Candidate
    rmse: float  # with it, in floors


def typed(text: str) -> Typed:
    """Reads what stands in the field; never raises, and never runs any of it."""
    if not text.strip():
        return Typed(None, "")
    try:
        found = parse(text)
    except InputError as error:
        return Typed(None, f"✗ {error}")
    used = ", ".join(found.variables) or "no variable"
    free = ", ".join(found.parameters) or "none"
    return Typed(found, f"✓ uses {used}; parameters to fit: {free}")


class OwnPreview:
    """Holds a torque against what a story's last model leaves; the first time, a torque is compiled."""

    def __init__(self) -> None:
        self._room: tuple[Step, Room] | None = None

    def of(self, story: Story, look: Look, effect: UserEffect, settings: Mapping[str, float]) -> Preview:
        """What a torque with these settings would change; `look` is a picture of that story as it stands.

        Raises InputError where the torque has no value somewhere in these recordings, or settings out of range.
        """
        if look.assessment is None:
            raise InputError("one moment: the residual is still being analysed")
        full = effect.settings(dict(settings))
        change = self.change(story, effect.name, full)
        if not np.all(np.isfinite(change)):
            raise InputError("with these values the torque has no value somewhere, as in a division by zero")
        signatures = {**look.assessment.signatures, effect.name: change}
        shown = replace(look, assessment=replace(look.assessment, signatures=signatures))
        candidate = Candidate(effect.name, 0.0, full)
        return Preview(shown, candidate, shown.error_with(candidate))

    def change(self, story: Story, name: str, settings: Mapping[str, float]) -> Array:
        """What a torque with these settings would change in the last model, over the floor: (values,)."""
        step, known = story.steps[-1], self._room
        if known is None or known[0] is not step or known[1].name != name:
            known = self._room = (step, room_for(story.data, story.current, name, settings))
        return known[1].change(settings)


# --- what stays of a discovery in the data folder: the report, the recording for Rerun, the improved model ------------


def keep(look: Look, folder: DataFolder, suffix: str) -> Path:
    """Writes a report (.html), a recording (.rrd) or an actuator (.toml) under a new name; returns where it is."""
    found = look.found
    where = folder.actuators if suffix == ".toml" else folder.recordings
    path = folder.fresh(where, "discover", suffix)
    configuration = {
        "fitted": ", ".join(look.reach),
        "held out": ", ".join(look.held) or "–",
        "actuator": found.actuator.name,
    }
    if suffix == ".toml":
        save_actuator(found.actuator, path)
    else:
        from emaviz.views.report import export  # rerun and the report's figures take half a second of the app's start

        export(found, path, configuration)
    return path


def home(look: Look, folder: DataFolder, tell: Tell) -> tuple[Path, str]:
    """A .zip with the improved model for every tool that is there, its loss in words beside; and a line of it."""
    from ema_model.exports.export import at_hand, export  # takes a while, and few ask for it

    names, lines = at_hand()
    path = folder.fresh(folder.recordings, "home", ".zip")
    with TemporaryDirectory(prefix=".home-", dir=folder.recordings) as scratch:
        out = Path(scratch) / "model"
        result = export(look.found.actuator, names, look.found.plant.recorded, out, on_progress=tell)
        save_actuator(look.found.actuator, out / f"{result.one.name}.toml")
        (out / "LOSS.txt").write_text("\n".join([str(result), *lines, ""]), encoding="utf-8")
        with whole_file(path) as draft, zipfile.ZipFile(draft, "w", zipfile.ZIP_DEFLATED) as archive:
            for file in sorted(out.iterdir()):
                archive.write(file, file.name)
    parts = [f"{one.title} {_nearness(one)}" for one in result.targets]
    return path, "; ".join([*parts, *lines])


def _nearness(one: TargetProof) -> str:
    """'as the model', or how much further off than ours it is."""
    if one.difference <= EXACT:
        return "as the model"
    ratios = [signal.rmse / signal.rmse_ours for signal in one.signals.values() if signal.rmse_ours > 0.0]
    return f"{max(ratios):.2f} times our error" if ratios else f"within {100.0 * one.difference:.2g} %"


# --- the session's part of Discover: which recordings, the story so far, and its steps on the compute thread ----------


class Discovering:
    """A story, told in steps; one step runs at a time, and a stopped one leaves the story as it was."""

    def __init__(self, session: Session, comparing: Comparing) -> None:
        self.session, self.comparing = session, comparing
        self.folder = comparing.folder
        self.events = DiscoverEvents()
        self.source = DiscoverySource(comparing)
        self.sealing = Sealing(session, comparing.folder)
        self.job = Job(session.worker, on_stop=self._stopped, on_divergence="the model stays as it was")
        reading = comparing.asking
        self.provenance = Provenance(
            "the discovery", "Start", self.source.inputs, self.job, reads=lambda: bool(reading.reading)
        )
        self.entries = Entries(self.source)
        self._shown = Shown(self.source, self.entries, self.events.looked)
        self.job.began.connect(lambda _: self._shown.rest())
        self._own = OwnPreview()
        self._files = Worker("emaviz-discovery-files", comparing.on_error)
        # a thread of their own: a new expression is compiled for seconds, in which a slider and a Stop are answered
        self._previews = Worker("emaviz-discovery-previews", comparing.on_error)

    def close(self) -> None:
        """Ends the threads."""
        self.job.stop()
        self._files.close()
        self._previews.close()

    # --- what is asked ----------------------------------------------------------------------------------------------

    @property
    def look(self) -> Look | None:
        """The last picture of the story; None while there is none."""
        return self._shown.look

    @property
    def running(self) -> bool:
        """Whether a step runs."""
        return self.job.running

    @property
    def is_refining(self) -> bool:
        """Whether candidates that are known are being refitted, which gives way to a step that is asked for."""
        return self.job.running and self._shown.is_refining

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
        self.source.recall(entry.recipe, entry.challenge, entry.revealed)
        if entry.told is None:
            self.provenance.lose(entry.inputs or Inputs(entry.subject), entry.lost)
        else:
            self.provenance.take(entry.inputs)
        self._shown.recall(entry)

    def _leave(self) -> None:
        if self.running:
            raise InputError("a step is running; stop it first")
        self.job.stop()  # one that waits to begin
        self._shown.leave()
        self.provenance.clear()

    # --- steps ------------------------------------------------------------------------------------------------------

    @property
    def is_of_compare(self) -> bool:
        """Whether what is shown is of Compare's recordings as they are chosen now."""
        of = self.provenance.of
        return (
            self.source.challenge is None
            and self.look is not None
            and of is not None
            and not of.changed(self.source.inputs())
        )

    def follow_compare(self) -> None:
        """Chooses Compare's recordings, unless they are what is shown; `go_on` then begins."""
        if not self.is_of_compare:
            self.choose("")

    def go_on(self) -> bool:
        """Begins to look for what is missing, unless that is known; False while another long run goes on."""
        return self.is_of_compare or self.start()

    def start(self) -> bool:
        """Calibrates the model, and looks for what may be missing; False while another long run goes on."""
        if not self.source.ready:
            raise InputError(NOTHING)
        inputs, compared = self.source.inputs(), self.source.finished

        def job(tell: Tell) -> None:
            told = self._shown.begin(self.source.recipe(), tell, compared)
            if self.entries.current is not None:
                self.entries.current.inputs = inputs
            self.provenance.take(inputs)
            self._shown.assess(told, tell)
            self._shown.refine(told, tell)

        title = "Calibrating the model" if compared is None else "Looking for what is missing"
        return self.provenance.begin(lambda: self.job.begin(title, job), inputs)

    def add(self, name: str) -> bool:
        """The best of that effect, or that fault, into the model, refitted; then looks again.

        As of every step: False while another long run goes on, refits of candidates too, which end then.
        """
        if self._gives_way():
            return False
        told, look = self._seen()
        candidate = look.candidate(name)
        if candidate is None:
            raise InputError(f"{quoted(name, 60)}: no candidate; choose a card")
        return self._add(candidate, told, look)

    def add_own(self, effect: UserEffect, start: Mapping[str, float]) -> bool:
        """A user's own torque into the model, its parameters fitted from these values."""
        if self._gives_way():
            return False
        told, look = self._seen()
        if any(one.key == effect.name for one in look.added):
            raise InputError("this expression is in the model already; remove it there, or change it")
        return self._add(Candidate(effect.name, 0.0, effect.settings(dict(start))), told, look)

    def _add(self, candidate: Candidate, told: Telling, look: Look) -> bool:
        alike = look.assessment.alike.get(candidate.name, ()) if look.assessment else ()

        def job(tell: Tell) -> None:
            is_users = candidate.name not in CATALOGUE and candidate.name not in NAMES
            if is_users:
                aside(
                    lambda: self._own.change(told.story, candidate.name, candidate.settings),
                    tell,
                    "compiling it beside the model's effects, which takes some seconds the first time",
                )
            tell("fitting; a combination of effects is compiled on its first use, which takes some seconds")
            trial = told.trials.of(told.story, candidate, tell)
            if is_users:
                trial = told.trials.followed(told.story, trial, tell)
            self._shown.take(told, trial, alike, tell)

        return self.job.begin(f"Adding {in_sentence(effect_title(candidate.name))}", job)

    def preview_own(self, effect: UserEffect, settings: Mapping[str, float]) -> None:
        """Tells soon what a user's torque with these values would change; of several requests the last one counts."""

        def job() -> None:
            told, look = self._shown.told, self.look
            if told is None or look is None or look.steps != len(told.story.steps) or look.assessment is None:
                return
            try:
                self.events.previewed(self._own.of(told.story, look, effect, settings))
            except (InputError, FloatingPointError) as error:
                self.events.unpreviewed(str(error))

        self._previews.post("own torque", job)

    def add_curve(self) -> bool:
        """What is left as a torque curve over the variable that explains it best."""
        if self._gives_way():
            return False
        told, look = self._seen()
        story, left = told.story, look.assessment.left.explanation if look.assessment else None
        if left is None:
            raise InputError("no variable explains the residual, so that there is no curve to add")

        def job(tell: Tell) -> None:
            trial = story.curve(left, tell)
            if trial is None:
                raise InputError(
                    "a torque curve makes these recordings no more probable: the error would fall by chance alone"
                )
            self._shown.take(told, trial, (), tell)

        return self.job.begin("Adding the curve", job)

    def remove(self, key: str) -> bool:
        """One of the added effects or faults out of the model again, refitted."""
        if self._gives_way():
            return False
        told, look = self._seen()
        if key not in look.removable:
            raise InputError(f"{quoted(key, 60)} is not in the model")

        def job(tell: Tell) -> None:
            tell("fitting without it")
            smaller = told.story.without(key, tell)
            tell("measuring the new model's error")
            told.story.remove(key, smaller)
            self._shown.assess(told, tell)
            self._shown.refine(told, tell)

        return self.job.begin(f"Removing {in_sentence(effect_title(key))}", job)

    def find_all(self) -> bool:
        """Adds all that is missing, a step after another, as `emaviz discover` does."""
        if self._gives_way():
            return False
        told, _ = self._seen()

        def job(tell: Tell) -> None:
            def say(text: str) -> None:
                tell(text)
                if self._shown.is_behind:
                    self._shown.show(told)  # a step further: the ladder grows

            told.rounds.begin(told.story)
            search(told.story, say, rounds=told.rounds, refits=told.refits)
            self._shown.assess(told, tell)

        return self.job.begin("Finding all that is missing", job)

    def undo(self) -> None:
        """The last step back: at once, but for what has to be looked at again."""
        told, _ = self._seen()
        if len(told.story.steps) < 2:
            raise InputError("there is no step to take back")
        if told.story.undo_is_at_once:
            told.story.undo()
            self._shown.show(told)
            if not told.is_assessed:  # of a walk that went on at once
                self.job.begin("Looking again", lambda tell: self._shown.assess(told, tell))
            return

        def job(tell: Tell) -> None:
            tell("measuring the error without the fault")
            told.story.undo()
            self._shown.assess(told, tell)

        self.job.begin("Taking the step back", job)

    @property
    def experiment(self) -> Experiment | None:
        """The test that was suggested last."""
        return None if self._shown.told is None else self._shown.told.experiment

    def suggest(self) -> bool:
        """Looks for the test that tells the best candidates apart."""
        if self._gives_way():
            return False
        told, _ = self._seen()
        found = undecided(told.story, told.known)
        if found is None:
            raise InputError("there were no two candidates between which a test would have to decide")
        base, pair = found

        def job(tell: Tell) -> None:
            trials: list[Trial] = []
            for one in pair:
                tell(f"fitting {in_sentence(effect_title(one.name))}")
                trials.append(told.trials.of(base, one, tell))
            tell("simulating the tests that the actuator allows")
            first, second = trials
            told.experiment = next_experiment(base.data, first, second)
            self._shown.show(told)
            if told.experiment is None:
                self.events.unsuggested()

        return self.job.begin("Looking for the best next test", job)

    # --- on the compute thread --------------------------------------------------------------------------------------

    def _stopped(self) -> str:
        told = self._shown.told
        if told is not None and self._shown.is_behind:
            self._shown.show(told)  # what was added before it was stopped
        return "Stopped; the model is as the ladder shows it." if told else "Stopped."

    def _gives_way(self) -> bool:
        """Whether candidates are being refitted: that is stopped, and a step begins once it has ended."""
        refining = self.is_refining
        if refining:
            self.job.stop()
        return refining

    def _seen(self) -> tuple[Telling, Look]:
        if self.running:
            raise InputError("a step is running; wait for it, or stop it")
        if self.look is None or self._shown.told is None:
            raise InputError("there is no calibrated model yet; press Start")
        return self._shown.told, self.look

    # --- a session --------------------------------------------------------------------------------------------------

    def saved(self) -> dict[str, Any] | None:
        """Every discovery with its story: plain values and arrays; None without one."""
        return self.entries.saved()

    def files(self) -> list[str]:
        """Names in the data folder of what they are of."""
        return [name for one in self.entries.all for name in one.recipe.files]

    def restore(self, saved: Any, names: Mapping[str, str]) -> None:
        """Takes the discoveries of a session, and shows one as it was left; InputError for what makes no sense.

        names: the files' names of now by those of then.
        """
        if self.running:
            raise InputError("a step of Discover is running; stop it, and load the session again")
        if saved is None:
            return self.choose("")
        entry = self.entries.bring(saved, names)
        self._leave()
        self.show(entry)

    # --- what stays -------------------------------------------------------------------------------------------------

    def take_home(self) -> bool:
        """Begins to write the model for other tools, each replayed on what was fitted, as a .zip in the data folder."""
        look = self.look
        if look is None:
            raise InputError("nothing is discovered yet; press Start first")

        def job(tell: Tell) -> None:
            path, told = home(look, self.folder, tell)
            self.events.kept(path)
            self.events.verified(path, told)

        return self.job.begin("Taking the model home", job)

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
