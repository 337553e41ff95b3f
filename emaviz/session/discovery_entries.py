"""Discoveries as they went: their steps, what of them is shown, and what a session stores."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any

import msgspec
import numpy as np

from ema_model.challenges import Challenge
from ema_model.comparison.explain import Explanation
from ema_model.comparison.result import Comparison
from ema_model.discovery import Candidate, Story, begun, result_of
from ema_model.discovery.history import Step
from ema_model.discovery.refit import Trial, with_drops
from ema_model.discovery.result import Experiment
from ema_model.discovery.rounds import Refits, Rounds
from ema_model.discovery.snapshot import Assessment, Look, assessed, known_of, look_at, refined
from ema_model.discovery.words import effect_title
from ema_model.effects import CATALOGUE
from ema_model.errors import InputError
from ema_model.quantities import in_sentence, number
from ema_model.result import restored, stored
from emaviz.session.discovery_source import DiscoverySource, Recipe, SavedStory, story_of
from emaviz.session.jobs import Signal, Tell, aside
from emaviz.session.session_file import Inputs, Room, digest

# --- candidates refitted in the model of a story, each once -----------------------------------------------------------
# Candidates refitted in the model of a story, each once; and the two between which a test would have to decide.

_MOST_FOLLOWED = 8  # times that a fit is begun anew where the one before has ended


class Trials:
    """Those of one story, kept."""

    def __init__(self) -> None:
        self._known: dict[tuple[Step, str], Trial] = {}

    def of(self, story: Story, candidate: Candidate, tell: Tell) -> Trial:
        """A candidate in the last model of a story."""
        key = (story.steps[-1], candidate.name)
        known = self._known.get(key)
        if known is None or known.candidate.settings != candidate.settings:
            known = self._known[key] = story.trial(candidate, tell)
        return known

    def take(self, story: Story, trials: Sequence[Trial]) -> None:
        """Those of the last model that are known."""
        self._known |= {(story.steps[-1], one.candidate.name): one for one in trials}

    def followed(self, story: Story, trial: Trial, tell: Tell) -> Trial:
        """A user's effect, fitted again from where its parameters went to a bound: their scale is the user's guess."""
        check_value(trial)
        name = trial.candidate.name
        for _ in range(_MOST_FOLLOWED):
            fitted = trial.fit.calibration.parameters
            if not any(one.at_bound for path, one in fitted.items() if path.startswith(f"effects.{name}.")):
                break
            settings = dict(trial.fit.calibration.actuator.effects[name])
            again = story.trial(replace(trial.candidate, settings=settings), tell)
            if again.fit.chi2 >= trial.fit.chi2:
                break
            trial = again
        return trial


def check_value(trial: Trial) -> None:
    """Raises InputError for a refitted model that has no value somewhere: whatever failed stays out of the story."""
    if not all(np.all(np.isfinite(values)) for one in trial.fit.calibration.signals for values in one.values()):
        title = in_sentence(effect_title(trial.candidate.name))
        raise InputError(
            f"with {title} the model has no value somewhere in these recordings, as in a division by zero; it was not "
            "added"
        )


def undecided(story: Story, known: Mapping[Step, Assessment]) -> tuple[Story, list[Candidate]] | None:
    """The last step at which two candidates were worth a refit, as a story that ends there, and the best two."""
    for at in range(len(story.steps), 0, -1):
        found = known_of(story.steps[at - 1], known)
        worth = [one for one in found.candidates if Look.is_worth(one)] if found else []
        if len(worth) > 1:
            return Story(story.data, story.held, story.steps[:at]), worth[:2]
    return None


# --- a story and all that belongs to it -------------------------------------------------------------------------------
# A story and all that belongs to it: what is known of its steps, what it was made from, how it is written down.


@dataclass(eq=False)
class Telling:
    """One story as it is told on the page."""

    story: Story
    recipe: Recipe  # of its recordings
    known: dict[Step, Assessment] = field(default_factory=dict)  # so that a step back is at once
    trials: Trials = field(default_factory=Trials)  # so that nothing is fitted twice
    rounds: Rounds = field(default_factory=Rounds)  # beside its models
    refitted: dict[Step, Refits] = field(default_factory=dict)
    first: Sequence[Candidate] = ()  # of the first search, with what their refits gave
    experiment: Experiment | None = None

    @property
    def is_assessed(self) -> bool:
        """Whether it is known what may be missing from the last model."""
        return known_of(self.story.steps[-1], self.known) is not None

    def assess(self) -> None:
        """Looks at what the last model leaves; takes a second, and the first time a compilation."""
        self.rounds.begin(self.story)
        found = self.known[self.story.steps[-1]] = assessed(self.story, self.rounds)
        self.first = self.first or found.candidates

    @property
    def is_refined(self) -> bool:
        """Whether the most probable candidates are refitted beside the last model."""
        known = known_of(self.story.steps[-1], self.known)
        return known is not None and known.is_refined

    @property
    def refits(self) -> Refits | None:
        """Beside the last model, while they are kept."""
        return known_of(self.story.steps[-1], self.refitted)

    def refine(self, tell: Tell, shown: Callable[[Assessment], None]) -> None:
        """Refits the most probable candidates; shown is given what is known after each few."""
        step = self.story.steps[-1]
        seen = known_of(step, self.known)
        assert seen is not None, "it is assessed before"
        found, refits = refined(self.story, seen, self.rounds, tell, shown)
        self.known[step], self.refitted[step] = found, refits
        self.trials.take(self.story, [one.trial for one in refits.contenders])
        shown(found)

    def add(self, trial: Trial, alike: Sequence[str], tell: Tell) -> None:
        """Takes a trial for the next model, fitted to its end; alike: what cannot be told from it."""
        known = known_of(self.story.steps[-1], self.known)
        self.story.add(trial, ties=alike)
        if known is not None and trial.candidate.name in known.signatures and not trial.faults:
            self.story.set_probability(self.story.added[-1].key, known.probability(trial.candidate.name))
        self.story.finish(tell)
        if self.first and trial.candidate.predicted_drop:
            self.first = with_drops(self.first, [trial])

    def look(self) -> Look:
        """A picture of the story as it stands."""
        story = self.story
        found = result_of(story, self.first, self._unknown(), self.experiment)
        return look_at(story, found, known_of(story.steps[-1], self.known), known_of(story.steps[0], self.known))

    def _unknown(self) -> Explanation | None:
        """What is left by the last model; with a torque of no name in it, what that one stands in for."""
        steps = self.story.steps
        nameless = (i for i, step in enumerate(steps) if any(one.name not in CATALOGUE for one in step.added))
        known = known_of(steps[next(nameless, len(steps)) - 1], self.known)
        return known.left.explanation if known is not None else None

    def forget_scores(self) -> None:
        """What each candidate was scored and refitted with is made anew by the next step."""
        self.trials, self.rounds, self.refitted = Trials(), Rounds(), {}

    def stored(self, look: Look) -> dict[str, Any]:
        """With its last picture; plain values and arrays.  InputError while a step changes it."""
        story = self.story.to_store()
        if len(story.steps) < look.steps:
            raise InputError("a step is running; save the session once it has ended")
        story.steps = story.steps[: look.steps]
        known = {to: known_of(step, self.known) for step, to in zip(self.story.steps, story.steps)}
        of_steps = {step: one for step, one in known.items() if one is not None}
        return stored(StoredStory(story, of_steps, self.first, self.experiment, look))


@dataclass(frozen=True, eq=False)
class StoredStory:
    """A story as a session's file has it: all of its steps, and what is known of each."""

    story: Story
    known: dict[Step, Assessment]
    first: Sequence[Candidate]
    experiment: Experiment | None
    look: Look

    @classmethod
    def of(cls, given: Any) -> StoredStory:
        """What `Telling.stored` gave; InputError for what is damaged, or of another version."""
        return restored(given, cls, StoredStory._check)

    def _check(self) -> None:
        """Whatever is raised says that parts do not fit each other."""
        look = self.look
        _ = look.found.to_dict(), str(look.found.document), look.removable, look.primary
        blocks = sum(one.blocks for one in look.found.plant.windows)  # which are drawn at once
        if (
            blocks != len(look.counts)
            or len(look.residuals.time_s) != len(look.counts)
            or not 0 < len(self.story.steps) == look.steps
        ):
            raise ValueError("parts that do not fit each other")

    def told(self, recipe: Recipe) -> Telling:
        """As it was, without what each candidate was scored with."""
        return Telling(self.story, recipe, self.known, first=self.first, experiment=self.experiment)


# --- all discoveries of a session -------------------------------------------------------------------------------------
# All discoveries of a session: each keeps its story, so that one goes from one to the other without computing.

_MOST_NAMES = 2  # of recordings, in an entry's words


@dataclass(eq=False)
class Entry:
    """One discovery.  One whose story is not kept, or could not be brought by a session's file, is begun anew."""

    number: int
    recipe: Recipe
    told: Telling | None = None
    look: Look | None = None
    challenge: Challenge | None = None
    revealed: bool = False
    at: datetime = field(default_factory=datetime.now)
    inputs: Inputs | None = None  # of the story
    says: str = "not opened yet"  # while there is no picture
    lost: str = ""  # why its story is not here
    steps_digest: str = ""  # likewise, of its steps

    def saved(self) -> SavedStory:
        """As a session's file says it; the story stands beside."""
        steps = self.steps_digest
        if self.told is not None and self.look is not None:
            ladder = [(one.change, one.rmse, one.holdout_rmse) for one in self.look.found.ladder]
            steps = digest((ladder, self.told.experiment))
        return SavedStory(self.recipe, self.revealed, self.result, self.number, self.at, self.inputs, steps)

    @property
    def subject(self) -> str:
        """What was recorded."""
        if self.challenge is not None:
            return self.challenge.title
        names = [name.rpartition("/")[2] for name in self.recipe.fitted]
        more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
        return (", ".join(names[:_MOST_NAMES]) + more) or self.recipe.challenge or "recordings"

    @property
    def result(self) -> str:
        """Steps and error: '2 added, 1.02 × floor'."""
        if self.look is None:
            return self.says
        added = len(self.look.removable)
        return f"{f'{added} added' if added else 'calibrated'}, {number(self.look.rmse)} × floor"

    @property
    def words(self) -> str:
        """A line to choose it by."""
        return f"{self.number} · {self.subject} · {self.result} · {self.at:%H:%M}"


WHOLE = 3  # discoveries that go on at once: what each has scored takes 150 MB
KEPT = 12  # that are gone back to, with all of their steps: each takes tens of MB
_MOST_BROUGHT = 50  # by a session's file
_MOST_TEXT = 3_500_000  # that stories are in it, beside their arrays: of fifty steps


class Entries:
    """The discoveries, the oldest first, and which one is shown.

    Those shown last are whole; of the others nothing is missing but what each candidate was scored with.
    """

    def __init__(self, source: DiscoverySource) -> None:
        self._source = source
        self.all: list[Entry] = []
        self.current: Entry | None = None
        self._kept: list[Entry] = []  # the one shown last is the last

    def begin(self, told: Telling) -> Entry:
        """A new one, or the one that has no story, is shown."""
        entry = self.current
        if entry is None or entry.told is not None:
            self.leave()
            entry = self._new(told.recipe)
        entry.told, entry.look, entry.revealed, entry.lost = told, None, False, ""
        entry.recipe, entry.challenge = told.recipe, self._source.challenge
        self.show(entry)
        return entry

    def show(self, entry: Entry) -> None:
        """One is shown."""
        self.current = entry
        self._keep(entry)

    def _keep(self, entry: Entry) -> None:
        self._kept = [*(one for one in self._kept if one is not entry and one.told is not None), entry]
        for one in self._kept[:-KEPT]:
            one.says, one.told, one.look = one.result, None, None
            one.lost = f"the last {KEPT} are kept"
        self._kept = self._kept[-KEPT:]
        for one in self._kept[:-WHOLE]:
            if one.told is not None:
                one.told.forget_scores()

    def saved(self) -> dict[str, Any] | None:
        """For a session's file: the one that is shown (else the last), and the rest as its others; None without one."""
        current = self.current or (self.all[-1] if self.all else None)
        if current is None:
            return None
        if current is self.current:
            current.revealed = self._source.revealed
        room, rest = Room(_MOST_TEXT), [one for one in reversed(self.all) if one is not current]
        first, *others = (self._saved(one, room) for one in (current, *rest))
        return {**first, "others": others}

    def _saved(self, entry: Entry, room: Room) -> dict[str, Any]:
        told, look = entry.told, entry.look
        found = None
        if told is not None and look is not None:
            with suppress(InputError):  # there is no room for it, or a step changes it
                found = room.take(told.stored(look))
        return {**msgspec.to_builtins(entry.saved()), "story": found}

    def bring(self, saved: Any, names: Mapping[str, str]) -> Entry:
        """Those of a session's file; the one that is to be shown.  InputError, and none of them, if it is damaged.

        names: the files' names of now by those of then.
        """
        told = story_of(saved)
        given = [(told, saved), *zip(told.others, saved.get("others", ()))]
        found = [(one.renamed(names), whole) for one, whole in given[: 1 + _MOST_BROUGHT]]
        challenges = [self._source.challenge_of(one.recipe) for one, _ in found]
        brought = [self._brought(one, whole.get("story"), its) for (one, whole), its in zip(found, challenges)]
        self.all.sort(key=lambda one: one.number)
        return brought[0]

    def _brought(self, saved: SavedStory, story: Any, challenge: Challenge | None) -> Entry:
        """One of a file; it may be here."""
        if known := next((one for one in self.all if one.saved() == saved), None):
            return known
        entry = self._new(saved.recipe)
        if saved.number and all(one.number != saved.number for one in self.all):
            entry.number = saved.number
        entry.challenge, entry.revealed, entry.inputs = challenge, saved.revealed, saved.inputs
        entry.at, entry.says, entry.steps_digest = saved.at or entry.at, saved.says, saved.steps_digest
        if story is None:
            entry.lost = "its steps are not in this session"
            return entry
        try:
            found = StoredStory.of(story)
        except InputError as error:
            entry.lost = str(error)
        else:
            entry.told, entry.look = found.told(saved.recipe), found.look
            self._keep(entry)
        return entry

    def leave(self) -> None:
        """Something else is shown; what the source says of the present one is remembered."""
        if self.current is not None and self.current.told is not None:
            self.current.revealed = self._source.revealed
        self.current = None

    def _new(self, recipe: Recipe) -> Entry:
        entry = Entry(1 + max((one.number for one in self.all), default=0), recipe)
        self.all.append(entry)
        return entry


# --- the story that is shown: begun, a step further, and looked at anew, on the compute thread ------------------------


class Shown:
    """It, and the last picture of it; both None while there is none."""

    def __init__(self, source: DiscoverySource, entries: Entries, looked: Signal[[Look | None]]) -> None:
        """looked: told each picture."""
        self.told: Telling | None = None
        self.look: Look | None = None
        self.is_refining = False  # the last run has scored the candidates, and refits some of them at its end
        self._source, self._entries, self._looked = source, entries, looked

    @property
    def is_behind(self) -> bool:
        """Whether the story is a step further than its picture."""
        return self.told is not None and (self.look is None or self.look.steps != len(self.told.story.steps))

    def leave(self) -> None:
        """Shows none; the story stays among the entries."""
        self._entries.leave()
        self.told = self.look = None

    def recall(self, entry: Entry) -> None:
        """An entry as it was left, at once."""
        self._entries.show(entry)
        self.told, self.look = entry.told, entry.look
        self._looked(self.look)

    def begin(self, recipe: Recipe, tell: Tell, compared: Comparison | None = None) -> Telling:
        """A story of its own: reads what the recipe says, and calibrates, from a comparison of the same on."""
        tell("reading")
        given = self._source.read(recipe)
        told = Telling(begun(given.fitted, given.actuator, given.held, given.signals, tell, compared), recipe)
        self._entries.begin(told)
        self.told, self.look, self._source.revealed = told, None, False
        return told

    def take(self, told: Telling, trial: Trial, alike: Sequence[str], tell: Tell) -> None:
        """A trial into the model; alike: effects that cannot be told from it."""
        check_value(trial)
        tell("measuring the new model's error")  # the last moment to stop
        told.add(trial, alike, tell)
        self.assess(told, tell)
        self.refine(told, tell)

    def assess(self, told: Telling, tell: Tell) -> None:
        """Shows the model as it is now, then what may be missing from it."""
        self.show(told)
        if not told.is_assessed:
            aside(told.assess, tell, "analysing the residual; the library of effects is compiled on its first use")
            self.show(told)

    def refine(self, told: Telling, tell: Tell) -> None:
        """Refits the most probable candidates, and shows each as it comes; what they stand beside is shown before."""
        look = self.look
        if told.is_refined or look is None or not look.promising:
            return
        self.is_refining = True
        self._looked(look)  # a click may follow from now on
        tell("refitting the most probable candidates")
        told.refine(tell, lambda known: self._take(replace(look, assessment=known)))

    def rest(self) -> None:
        """Another run begins."""
        self.is_refining = False

    def show(self, told: Telling) -> None:
        """A new picture."""
        self._take(told.look())

    def _take(self, look: Look) -> None:
        self.look = look
        if self._entries.current is not None:
            self._entries.current.look = look
        self._looked(look)
