"""Discoveries as they went: their steps, what of them is shown, and what a session saves."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from itertools import pairwise
from typing import Any

import msgspec
import numpy as np

from ema_model.actuator.write import as_toml
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
from ema_model.effects import CATALOGUE, catalogue_name
from ema_model.errors import InputError
from ema_model.estimation.model_fit import fit
from ema_model.faults import NAMES
from ema_model.quantities.numbers import number
from ema_model.quantities.titles import in_sentence
from emaviz.session.discover.source import DiscoverySource, Recipe, SavedStep, SavedStory, actuator_of, story_of
from emaviz.session.inputs import Inputs, Provenance
from emaviz.session.jobs import RESTED, Job, Signal, Stopped, Tell, aside

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


# --- a discovery's steps in what JSON can hold, and the same steps taken again from their fitted values ---------------

_DAMAGED = "the session's steps of Discover are damaged; save it anew"

Progress = Callable[[str], None]


def steps_of(story: Story) -> tuple[SavedStep, ...]:
    """Each step after the calibration."""
    return tuple(
        SavedStep(
            as_toml(step.fit.actuator),
            dict(step.fit.starts),
            tuple(step.fit.faults),
            _rivals(story, before, step),
        )
        for before, step in pairwise(story.steps)
    )


def take_again(story: Story, steps: Sequence[SavedStep], tell: Progress, shown: Callable[[], None]) -> None:
    """Takes saved steps after the calibration; each fit begins where it ended then.  shown() follows each step.

    Raises InputError for steps that make no sense, with the steps before them taken.
    """
    for i, one in enumerate(steps, 1):
        tell(f"step {i} of {len(steps)}")
        _take(story, one, lambda text, i=i: tell(f"step {i} of {len(steps)}: {text}"))
        shown()


def _take(story: Story, saved: SavedStep, tell: Progress) -> None:
    model, before = actuator_of(saved.model), story.current.actuator
    own = {path: one for path, one in model.tolerances.items() if path.startswith("effects.")}
    others = {path: one for path, one in before.tolerances.items() if not path.startswith("effects.")}
    found = fit(
        story.data,
        replace(before, effects=model.effects, tolerances={**others, **own}),
        saved.starts,
        tell,
        saved.faults,
    )
    more = tuple(name for name in found.faults if name not in story.current.faults)
    less = [name for name in story.current.faults if name not in found.faults]
    rivals = [one for one in saved.same_as if one in (*CATALOGUE, *NAMES) and one not in model.effects]
    new = [key for key in model.effects if key not in before.effects]
    gone = [key for key in before.effects if key not in model.effects]
    if more and not (new or gone or less):
        story.add(Trial(Candidate(more[0], 0.0, {}), {}, found, story.current.chi2 - found.chi2, more), rivals)
    elif less and not (new or gone or more):
        story.remove(less[0], found)
    elif more or less:
        raise InputError(_DAMAGED)
    elif len(gone) == 1 and not new:
        story.remove(gone[0], found)
    elif len(gone) == len(new) == 1:
        story.swap(gone[0], Trial(Candidate(new[0], 0.0, {}), {new[0]: {}}, found, story.current.chi2 - found.chi2))
    elif new and not gone:
        effects = {key: dict(model.effects[key]) for key in new}
        name = catalogue_name(new[0])
        trial = Trial(Candidate(name, 0.0, effects[new[0]]), effects, found, story.current.chi2 - found.chi2)
        check_value(trial)
        story.add(trial, rivals)
    else:
        raise InputError(_DAMAGED)
    story.finish(tell)  # as it was when it was added: the floor may be another


def _rivals(story: Story, before: Step, step: Step) -> tuple[str, ...]:
    """What cannot be told from that which a step adds."""
    effects = {name for one in step.added if one.key not in _keys(before) for name in one.same_as}
    faults = {story.ties[name] for name in step.fit.faults if name not in before.fit.faults and name in story.ties}
    return tuple(sorted(effects | faults))


def _keys(step: Step) -> set[str]:
    return {one.key for one in step.added}


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
    first: Sequence[Candidate] = ()  # of the first search, with what their refits gave
    experiment: Experiment | None = None

    @property
    def is_assessed(self) -> bool:
        """Whether it is known what may be missing from the last model."""
        return known_of(self.story.steps[-1], self.known) is not None

    def assess(self) -> None:
        """Looks at what the last model leaves; takes a second, and the first time a compilation."""
        found = self.known[self.story.steps[-1]] = assessed(self.story, self.rounds)
        self.first = self.first or found.candidates

    @property
    def refits(self) -> Refits | None:
        """Beside the last model, once they are known."""
        known = known_of(self.story.steps[-1], self.known)
        return known.refits if known is not None else None

    def refine(self, tell: Tell, shown: Callable[[Assessment], None]) -> None:
        """Refits the most probable candidates; shown is given what is known after each few."""
        step = self.story.steps[-1]
        seen = known_of(step, self.known)
        assert seen is not None, "it is assessed before"
        found = self.known[step] = refined(self.story, seen, self.rounds, tell, shown)
        assert found.refits is not None
        self.trials.take(self.story, [one.trial for one in found.refits.contenders])
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

    def saved(self) -> SavedStory:
        """The steps, and what they were made from."""
        return SavedStory(self.recipe, steps_of(self.story), self.experiment)


# --- all discoveries of a session -------------------------------------------------------------------------------------
# All discoveries of a session: each keeps its story, so that one goes from one to the other without computing.

_MOST_NAMES = 2  # of recordings, in an entry's words


@dataclass(eq=False)
class Entry:
    """One discovery.  One that a session's file brought has no story until its steps are taken again."""

    number: int
    recipe: Recipe
    told: Telling | None = None
    look: Look | None = None
    challenge: Challenge | None = None
    revealed: bool = False
    at: datetime = field(default_factory=datetime.now)
    brought: SavedStory | None = None  # what the file says, while there is no story
    inputs: Inputs | None = None  # of the story

    def saved(self) -> SavedStory:
        """As a session's file has it."""
        if self.told is None:
            assert self.brought is not None, "it was told here, or brought"
            return self.brought
        return msgspec.structs.replace(self.told.saved(), revealed=self.revealed, says=self.result)

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
            return self.brought.says[:80] if self.brought is not None else "not opened yet"
        added = len(self.look.removable)
        return f"{f'{added} added' if added else 'calibrated'}, {number(self.look.rmse)} × floor"

    @property
    def words(self) -> str:
        """A line to choose it by."""
        return f"{self.number} · {self.subject} · {self.result} · {self.at:%H:%M}"


WHOLE = 3  # discoveries that are gone back to without computing: what each has scored takes 150 MB


class Entries:
    """The discoveries, the oldest first, and which one is shown.

    Those shown last are whole; of the others there is what a session's file has, and their steps are taken again.
    """

    def __init__(self, source: DiscoverySource) -> None:
        self._source = source
        self.all: list[Entry] = []
        self.current: Entry | None = None
        self._whole: list[Entry] = []  # the one shown last is the last

    def begin(self, told: Telling) -> Entry:
        """A new one, or the one that was brought and is taken again now, is shown."""
        entry = self.current
        if entry is None or entry.told is not None:
            self.leave()
            entry = self._new(told.recipe)
        entry.told, entry.look, entry.brought, entry.revealed = told, None, None, False
        entry.challenge = self._source.challenge
        self.show(entry)
        return entry

    def show(self, entry: Entry) -> None:
        """One that is whole is shown."""
        self.current = entry
        self._whole = [*(one for one in self._whole if one is not entry and one.told is not None), entry]
        for one in self._whole[:-WHOLE]:
            one.brought = one.saved()
            one.told = one.look = None
        self._whole = self._whole[-WHOLE:]

    def bring(self, saved: SavedStory) -> Entry:
        """One of a session's file; it may be here."""
        if known := next((one for one in self.all if one.saved() == saved), None):
            return known
        entry = self._new(saved.recipe)
        entry.brought = saved
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
        """A story as it was left, at once."""
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
        if told.refits is not None or look is None or not look.promising:
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


# --- the discoveries in a session's file: what it is given, and what it brings, taken again step by step --------------

_MOST_BROUGHT = 50  # discoveries beside the shown one
_MOST_WAIT_S = 20.0  # for measurements that may never be there
_TITLE = "Taking the session's steps again"


class SavedStories:
    """Saves all entries; takes those of a file."""

    def __init__(
        self,
        job: Job,
        source: DiscoverySource,
        entries: Entries,
        shown: Shown,
        opened: Callable[[], Collection[str]],
        provenance: Provenance,
    ) -> None:
        """opened(): names of the recordings that are open on Compare."""
        self._job, self._source, self._entries, self._shown, self._opened = job, source, entries, shown, opened
        self._provenance = provenance
        self._again: SavedStory | None = None  # what is being taken again, or was when it was stopped

    def forget(self) -> None:
        """What was being taken again is put away."""
        self._again = None

    @property
    def unfinished(self) -> Entry | None:
        """The discovery of a file whose steps are not all taken again."""
        return self._entries.current if self._again is not None else None

    def saved(self) -> SavedStory | None:
        """Every discovery, the one that is shown (else the last) first and the rest as its others; None without one."""
        entries = self._entries
        current = entries.current or (entries.all[-1] if entries.all else None)
        if current is None:
            return self._again
        if current is entries.current:
            current.revealed = self._source.revealed
        first = self._again or current.saved()
        return msgspec.structs.replace(first, others=tuple(one.saved() for one in entries.all if one is not current))

    def files(self) -> list[str]:
        """Names in the data folder of what they are made from."""
        saved = self.saved()
        return [] if saved is None else [name for one in (saved, *saved.others) for name in one.recipe.files]

    def bring(self, saved: Any, names: Mapping[str, str]) -> Entry:
        """The entries of a file; returns the one that is to be shown.  InputError, and none of them, if it is damaged.

        names: the files' names of now by those of then.
        """
        told = story_of(saved)
        first, *others = (
            msgspec.structs.replace(one, recipe=self._source.checked(one.recipe.renamed(names)), others=())
            for one in (told, *told.others)
        )
        for one in others[:_MOST_BROUGHT]:
            self._entries.bring(one)
        return self._entries.bring(first)

    def take_again(self, entry: Entry) -> None:
        """The steps of one that a file brought, once nothing else runs; its fits begin where they ended then."""
        saved, shown = entry.brought or self._again, self._shown
        assert saved is not None, "it has no story yet"
        self._source.take(saved.recipe)
        shown.leave()
        entry.told, entry.look, entry.brought = None, None, saved
        self._entries.current, self._again = entry, saved

        def job(tell: Tell) -> None:
            inputs = self._source.inputs()
            try:
                told = shown.begin(saved.recipe, tell)
                shown.assess(told, tell)  # the first step's cards are what the report ranks
                take_again(told.story, saved.steps, tell, lambda: shown.show(told))
            except Stopped:
                raise  # the rest can be taken later
            except BaseException:
                self._again = None
                raise
            told.experiment, self._source.revealed = saved.experiment, saved.revealed
            self._again, entry.inputs = None, inputs
            self._provenance.take(inputs)
            shown.assess(told, tell)
            shown.refine(told, tell)

        wanted, until = {*saved.recipe.fitted, *saved.recipe.held}, time.perf_counter() + _MOST_WAIT_S

        def waits_for() -> str:
            open_or_late = wanted <= {*self._opened()} or time.perf_counter() > until
            return "" if open_or_late else "its measurements, which are being read"

        def begin() -> bool:
            return self._provenance.begin(lambda: self._job.begin(_TITLE, job))

        self._job.begin_in_turn(_TITLE, begin, waits_for, RESTED)
