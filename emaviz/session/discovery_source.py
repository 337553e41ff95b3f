"""What a discovery is made of: recordings, a challenge, a sealed plant, and its truth."""

from __future__ import annotations

import math
import secrets
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from ema_model.actuator import Actuator, load_actuator
from ema_model.actuator.actuator import sentences
from ema_model.actuator.file import as_toml
from ema_model.challenges import Challenge, challenges, folder, opened, sealed_challenge
from ema_model.challenges.challenge import SUFFIX
from ema_model.challenges.truth import SENSORS, Truth, read_truth, seal, unseal
from ema_model.comparison.result import Comparison
from ema_model.discovery import Discovery
from ema_model.discovery.result import Added
from ema_model.discovery.words import effect_title, fitted_of, value
from ema_model.effects import CATALOGUE, find
from ema_model.errors import InputError
from ema_model.faults import BY_NAME, NAMES, named
from ema_model.files.opened import CHALLENGE_RECORDING_BYTES
from ema_model.quantities import amount, in_sentence
from ema_model.recordings import Measurement, read
from ema_model.recordings.measurement import Sensors
from ema_model.text import Document, Lines, Remark, Remarks, Severity
from emaviz.session.compare import USUAL, Comparing
from emaviz.session.data_folder import DataFolder, sanitised
from emaviz.session.explore import Session
from emaviz.session.jobs import Job, Signal, Tell
from emaviz.session.session_file import Inputs, digest, listed, version_of
from emaviz.session.settings import Settings, taken

# --- what a session's file says of a discovery ------------------------------------------------------------------------
# What a session's file says of a discovery: what it was made from, and what came of it; its story stands beside.


class Recipe(msgspec.Struct, frozen=True):
    """From which the same story can be begun again: a challenge, else recordings of Compare as they were asked then."""

    challenge: str = ""  # its name, or its sealed file's in the data folder
    fitted: tuple[str, ...] = ()  # names in the data folder
    held: tuple[str, ...] = ()
    window_s: tuple[float, float] | None = None
    signals: tuple[str, ...] | None = None
    actuator: str = ""  # its file's text

    def __post_init__(self) -> None:
        if self.window_s is not None and not all(map(math.isfinite, self.window_s)):
            raise InputError("a window has finite edges")

    @property
    def files(self) -> list[str]:
        """Names in the data folder; a challenge that comes with the app has none there, which does no harm."""
        return [name for name in (self.challenge, *self.fitted, *self.held) if name]

    def renamed(self, names: Mapping[str, str]) -> Recipe:
        """With the files' names of now, by those of then."""
        fitted, held = (tuple(names.get(name, name) for name in part) for part in (self.fitted, self.held))
        challenge = names.get(self.challenge, self.challenge)
        return msgspec.structs.replace(self, challenge=challenge, fitted=fitted, held=held)


class SavedStory(msgspec.Struct, frozen=True):
    """One discovery; with the first of a session, the others."""

    recipe: Recipe
    revealed: bool = False  # the challenge's truth
    says: Annotated[str, msgspec.Meta(max_length=80)] = "not opened yet"
    number: Annotated[int, msgspec.Meta(ge=0, lt=1_000_000)] = 0
    at: datetime | None = None
    inputs: Inputs | None = None  # of the story
    steps_digest: str = ""  # by which the same steps are known again
    others: tuple[SavedStory, ...] = ()

    def renamed(self, names: Mapping[str, str]) -> SavedStory:
        """With the files' names of now, by those of then."""
        inputs = None if self.inputs is None else self.inputs.renamed(names)
        return msgspec.structs.replace(self, recipe=self.recipe.renamed(names), inputs=inputs, others=())


def story_of(saved: Any) -> SavedStory:
    """As it was saved; InputError if it makes no sense."""
    return taken(SavedStory, saved, "part of Discover")


# --- seals what Explore hides in its plant as a challenge for somebody else, on the compute thread --------------------

_MOST_SEED = 1_000_000


class Sealing:
    """Takes the plant as the session's settings have it when it is asked."""

    def __init__(self, session: Session, folder: DataFolder) -> None:
        self.session, self.folder = session, folder
        self.job = Job(session.worker)
        self.sealed: Signal[[Path]] = Signal()  # a challenge is in the data folder

    def seal(self, title: str, story: str) -> bool:
        """Makes and writes the challenge soon; False, and nothing is begun, while another long run goes on.

        Raises InputError for a title or a story that is missing.
        """
        for what, text in (("title", title), ("story", story)):
            if not text.strip():
                raise InputError(f"the challenge has no {what} yet; write one")
        settings, actuator = self.session.settings, self.session.actuator
        truth = truth_of(settings, actuator, secrets.randbelow(_MOST_SEED))
        path = self.folder.place(sanitised(title.strip() + SUFFIX))
        sensors, load = sensors_of(settings), settings.load_torque_Nm

        def work(tell: Tell) -> None:
            tell("simulating; a combination of effects is compiled on its first use")
            seal(truth, path, title, story, actuator, sensors=sensors, load_torque_Nm=load, on_progress=tell)

        def done() -> str:
            self.sealed(path)
            return f"Kept in the data folder: {self.folder.name_of(path)}"

        return self.job.begin("Sealing", work, done)


def truth_of(settings: Settings, actuator: Actuator, seed: int) -> Truth:
    """What the settings hide in the plant: its effects, and the faults that are not healthy."""
    k, told = settings.k, []
    faults = named(k)
    for name, given in settings.effects.items():
        order = f" of order {given['order']:g}" if "order" in given else ""
        told.append(f"{in_sentence(find(name).title)}{order}")
    told += [sentences(k, actuator)[NAMES.index(name)] for name in faults]
    answer = (
        f"Hidden: {'; '.join(told)}." if told else "Nothing is hidden: the plant is the model's, within tolerances."
    )
    effects = {name: dict(given) for name, given in settings.effects.items()}
    return Truth("", seed, answer, effects, faults=faults)


def sensors_of(settings: Settings) -> Sensors:
    """Those that are set; where they are perfect, those of the shipped challenges, since no rig has such."""
    given = settings.sensors
    return Sensors(given.current_noise_A or SENSORS.current_noise_A, given.encoder_bits or SENSORS.encoder_bits)


# --- a discovery beside the truth that a challenge hides, in words ----------------------------------------------------

_NEAR = 0.25  # of the true value, within which a strength counts as found where its interval misses it


# What of the model's parameters tells a fault that is slight enough to pass for it.
_OF_FAULT = {"k1": "friction", "k2": "backlash", "k8": "position_gain"}


def agrees(truth: Truth, found: Discovery, added: tuple[Added, ...]) -> bool:
    """Whether the answer names exactly what is hidden: the effects, or a torque of its own for an unknown one."""
    named = {one.name for one in added if one.name in CATALOGUE and not one.stands_for}
    own = any(one.name not in CATALOGUE for one in added)
    seen = all(_sees(found, fault) for fault in truth.faults)
    return named == set(truth.effects) and own == bool(truth.torque) and seen and not _invented(truth, found)


def _sees(found: Discovery, fault: str) -> bool:
    told = _OF_FAULT.get(fault)
    return fault in found.faults or (told is not None and any(told in p for p in found.parameters_outside_tolerance))


def _invented(truth: Truth, found: Discovery) -> list[str]:
    """Faults that were named and are not there; a phase belongs to its modulus."""
    return [name for name in found.faults if name not in truth.faults and name != "k7"]


def _fault(fault: str, k: ArrayLike, found: Discovery) -> Remark:
    index = NAMES.index(fault)
    what = f"{in_sentence(BY_NAME[fault].title)} fault: {sentences(k, found.plant.actuator)[index]}"
    if fault in found.faults:
        own, true = found.faults[fault], float(np.asarray(k)[index])
        low, high = own.interval90
        near = low <= true <= high or abs(own.value - true) <= _NEAR * abs(true - BY_NAME[fault].healthy)
        return _row(near, what, f"{fault} {true:g} in truth, {value(own)} found")
    good = _sees(found, fault)
    return _row(good, what, "its parameter is outside its tolerance" if good else "not found; try Identify")


def document_of(truth: Truth, found: Discovery, added: tuple[Added, ...]) -> Document:
    """Whether they agree, the truth in words, then effect by effect."""
    good = agrees(truth, found, added)
    verdict = Remark(f"Your answer {'agrees' if good else 'differs'}", "this is what was hidden", _severity(good))
    rows = [_effect(name, given, found, added) for name, given in truth.effects.items()]
    rows += [_fault(fault, truth.k, found) for fault in truth.faults]
    for name in _invented(truth, found):
        rows.append(_row(False, f"the fault {BY_NAME[name].label}", "is not hidden here"))
    if truth.torque:
        own = next((one for one in added if one.name not in CATALOGUE), None)
        what = f"an effect outside the library: T = {truth.torque}"
        how = f"found as {in_sentence(effect_title(own.name))}" if own else "not found: add the residual's curve"
        rows.append(_row(own is not None, what, how))
    for one in added:
        if one.name in CATALOGUE and one.name not in truth.effects:
            tied = [name for name in one.same_as if name in truth.effects or name in truth.faults]
            if one.stands_for:
                why = "a parameter outside its tolerance; nothing of the kind is hidden"
            elif tied:
                why = f"cannot be told from {in_sentence(effect_title(tied[0]))} by these recordings"
            else:
                why = "is not hidden here"
            rows.append(_row(False, in_sentence(effect_title(one.name)), why))
    if not rows:
        rows.append(_row(True, "nothing is hidden", "and you added nothing"))
    return Document([Remarks([verdict]), Lines([truth.answer]), Remarks(rows)])


def _effect(name: str, given: dict[str, float], found: Discovery, added: tuple[Added, ...]) -> Remark:
    title = in_sentence(effect_title(name))
    order = given.get("order")
    own = [one for one in added if one.name == name]
    one = next((one for one in own if order is None or one.chosen.get("order") == order), own[0] if own else None)
    if one is None:
        return _row(False, title, "not found")
    first = find(name, found.actuator.axes).parameters[0]
    fitted = fitted_of(found, one, first.name)
    low, high = fitted.interval90
    inside = low <= given[first.name] <= high
    near = inside or abs(fitted.value - given[first.name]) <= _NEAR * abs(given[first.name])
    told = f"{in_sentence(first.title)} {amount(given[first.name], first.unit)} in truth, {value(fitted)} found"
    if order is not None:
        told += f"; order {order:g} in truth, {one.chosen.get('order', 0.0):g} found"
    return _row(near and (order is None or one.chosen.get("order") == order), title, told)


def _row(good: bool, what: str, how: str) -> Remark:
    return Remark(what[:1].upper() + what[1:], how, _severity(good))


def _severity(good: bool) -> Severity:
    return "good" if good else "bad"


# --- what a discovery is made from ------------------------------------------------------------------------------------
# What a discovery is made from: a challenge, or the recordings and the actuator of Compare, some of them held out.

COMPARED = "The measurements of Compare"
NOTHING = "no measurement to fit is chosen; open one on Compare, or choose a challenge"


@dataclass(frozen=True)
class Material:
    """What `ema_model.discovery.begun` is given."""

    fitted: Sequence[Measurement]
    held: Sequence[Measurement]
    actuator: Actuator
    signals: Sequence[str] | None


class DiscoverySource:
    """The choice; only `read`, and `choose` of a sealed challenge, read files."""

    def __init__(self, comparing: Comparing) -> None:
        self.challenges: dict[str, Challenge] = {one.name: one for one in challenges()}
        self.challenge: Challenge | None = None  # else the recordings of Compare
        self.chosen = ""  # the challenge's name, or its sealed file's in the data folder
        self.revealed = False  # the challenge's truth
        self._comparing = comparing

    @property
    def sealed(self) -> list[str]:
        """Names of the sealed challenges in the data folder, the newest first."""
        return self._comparing.folder.challenge_files()

    def choose(self, name: str) -> None:
        """A challenge by its name, a sealed one by its file's, or Compare's recordings with ""; InputError else."""
        self.challenge, self.chosen, self.revealed = self._challenge(name), name, False

    def _challenge(self, name: str) -> Challenge | None:
        if name and name not in self.challenges:
            return sealed_challenge(self._comparing.folder.challenge(name))
        return self.challenges.get(name)

    @property
    def held_out(self) -> set[str]:
        """Names of Compare's recordings that are not fitted, there and here."""
        return self._comparing.held_out

    def hold_out(self, name: str, held: bool) -> None:
        """Whether one of Compare's recordings is kept from the fit, to judge by."""
        self._comparing.hold_out(name, held)

    @property
    def finished(self) -> Comparison | None:
        """Compare's result, if it is of what is chosen here, too."""
        return None if self.challenge is not None else self._comparing.finished

    @property
    def compared(self) -> dict[str, Measurement]:
        """Compare's recordings whose columns are known, by name."""
        known = self._comparing.opened
        return {name: one.measurement for name, one in known.items() if one.measurement is not None}

    @property
    def ready(self) -> bool:
        """Whether there is something to start with."""
        return self.challenge is not None or any(name not in self.held_out for name in self.compared)

    def inputs(self) -> Inputs:
        """What a discovery would take now."""
        comparing = self._comparing
        if self.challenge is not None:
            sealed = self.challenge.sealed
            version = "" if sealed is None else version_of(sealed)
            return Inputs(self.challenge.title, self.chosen, {self.chosen: version or "shipped"})
        known = list(self.compared)
        fitted = [name for name in known if name not in self.held_out]
        options = {
            "the actuator": digest(comparing.actuator),
            "the choice of what may move": listed(sorted(comparing.free)),
            "the window of time": str(comparing.window_s or ""),
            "the choice of signals": listed(list(comparing.weights)),
            "what is held out": listed([name for name in known if name in self.held_out]),
        }
        subject = listed([name.rpartition("/")[2] for name in fitted])
        return Inputs(subject, files={name: comparing.version(name) for name in known}, options=options)

    def recipe(self) -> Recipe:
        """What is chosen now; InputError where nothing is left to fit."""
        if self.challenge is not None:
            return Recipe(self.chosen)
        comparing, known = self._comparing, self.compared
        fitted = [name for name in known if name not in self.held_out]
        if not fitted:
            raise InputError(NOTHING)
        actuator, weights = comparing.actuator, comparing.weights
        freed = {path: replace(one, free=path in comparing.free) for path, one in actuator.tolerances.items()}
        return Recipe(
            fitted=tuple(fitted),
            held=tuple(name for name in known if name in self.held_out),
            window_s=comparing.window_s,
            signals=None if weights == USUAL else tuple(actuator.axes.signal(name) for name in weights),
            actuator=as_toml(replace(actuator, tolerances=freed)),
        )

    def challenge_of(self, recipe: Recipe) -> Challenge | None:
        """The challenge that a recipe names, if one; InputError where it is not there."""
        return self._challenge(recipe.challenge)

    def recall(self, recipe: Recipe, challenge: Challenge | None, revealed: bool) -> None:
        """Chooses again what a story was made from, without reading anything."""
        self.challenge, self.chosen, self.revealed = challenge, recipe.challenge, revealed
        if not recipe.challenge:
            self._comparing.take_held_out(recipe.held)

    def read(self, recipe: Recipe) -> Material:
        """Reads what a recipe says; InputError for files that are gone, or that make no sense."""
        if self.challenge is not None:
            with opened(self.challenge) as challenge:
                actuator = load_actuator(challenge.actuator)
                fitted, held = (
                    [read(file, actuator, max_bytes=CHALLENGE_RECORDING_BYTES) for file in files]
                    for files in (challenge.training, challenge.holdout)
                )
            return Material(fitted, held, actuator, None)
        actuator = actuator_of(recipe.actuator)
        fitted, held = (
            [self._comparing.measurement(name, actuator) for name in part] for part in (recipe.fitted, recipe.held)
        )
        if recipe.window_s is not None:
            window = recipe.window_s
            fitted, held = ([one.selected(window) for one in part] for part in (fitted, held))
        if not fitted:
            raise InputError(NOTHING)
        return Material(fitted, held, actuator, recipe.signals)

    def reveal(self) -> Truth:
        """What is hidden in the challenge."""
        if self.challenge is None:
            raise InputError("only a challenge has something to reveal; choose one above")
        sealed = self.challenge.sealed
        truth = read_truth(folder() / "truth" / f"{self.challenge.name}.toml") if sealed is None else unseal(sealed)
        self.revealed = True
        return truth


def actuator_of(text: str) -> Actuator:
    """The actuator of a file's text; InputError tells what is wrong in it."""
    with tempfile.TemporaryDirectory(prefix="emaviz-actuator-") as name:
        path = Path(name) / "actuator.toml"
        path.write_text(text, encoding="utf-8")
        try:
            return load_actuator(path)
        except InputError as error:
            raise InputError(f"the session's {str(error).replace(f'{name}/', '')}") from None
