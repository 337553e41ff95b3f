"""What a discovery is made from: a challenge, or the recordings and the actuator of Compare, some of them held out."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ema_model.actuator import Actuator, load_actuator
from ema_model.actuator.write import as_toml
from ema_model.challenges import Challenge, challenges, folder, opened, sealed_challenge
from ema_model.challenges.sealing import unseal
from ema_model.challenges.truth import Truth, read_truth
from ema_model.errors import InputError
from ema_model.files.limits import CHALLENGE_RECORDING_BYTES
from ema_model.recordings import Measurement, read
from emaviz.session.compare.comparing import USUAL, Comparing
from emaviz.session.discover.saved_story import Recipe
from emaviz.session.inputs import Inputs, digest, listed, version_of

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
        self.held_out: set[str] = set()  # of Compare's recordings, by name
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

    def hold_out(self, name: str, held: bool) -> None:
        """Whether one of Compare's recordings is kept from the fit, to judge by."""
        self.held_out = self.held_out | {name} if held else self.held_out - {name}

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

    def checked(self, recipe: Recipe) -> Recipe:
        """The same; InputError for a challenge that is not there."""
        self._challenge(recipe.challenge)
        return recipe

    def take(self, recipe: Recipe) -> None:
        """Chooses what a recipe says."""
        self.choose(recipe.challenge)
        self.held_out = set(recipe.held)

    def recall(self, recipe: Recipe, challenge: Challenge | None, revealed: bool) -> None:
        """Chooses again what a story was made from, without reading anything."""
        self.challenge, self.chosen, self.revealed = challenge, recipe.challenge, revealed
        self.held_out = set(recipe.held)

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
