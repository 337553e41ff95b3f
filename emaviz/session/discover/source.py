"""What a discovery is made from: a challenge, or the recordings and the actuator of Compare, some of them held out."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ema_model.actuator import Actuator, load_actuator
from ema_model.actuator.write import as_toml
from ema_model.challenges import Challenge, challenges, folder, opened, sealed_challenge
from ema_model.challenges.sealing import unseal
from ema_model.challenges.truth import Truth, read_truth
from ema_model.errors import InputError
from ema_model.files.limits import CHALLENGE_RECORDING_BYTES
from ema_model.recordings import Measurement, read
from emaviz.session.compare.comparing import USUAL, Comparing
from emaviz.session.settings import number

COMPARED = "The recordings of Compare"
NOTHING = "no recording to fit is chosen; open one on Compare, or choose a challenge"
_DAMAGED = "the session's part of Discover is damaged; save it anew"


@dataclass(frozen=True)
class Material:
    """What `ema_model.discovery.begun` is given."""

    fitted: Sequence[Measurement]
    held: Sequence[Measurement]
    actuator: Actuator
    signals: Sequence[str] | None
    recipe: Mapping[str, Any] = field(default_factory=dict)  # gives the same again: see `DiscoverySource.read`


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

    def recipe(self) -> dict[str, Any]:
        """What is chosen now, in what JSON can hold; InputError where nothing is left to fit."""
        if self.challenge is not None:
            return {"challenge": self.chosen}
        comparing, known = self._comparing, self.compared
        fitted = [name for name in known if name not in self.held_out]
        if not fitted:
            raise InputError(NOTHING)
        actuator, weights = comparing.actuator, comparing.weights
        freed = {path: replace(one, free=path in comparing.free) for path, one in actuator.tolerances.items()}
        return {
            "challenge": "",
            "fitted": fitted,
            "held": [name for name in known if name in self.held_out],
            "window_s": comparing.window_s,
            "signals": None if weights == USUAL else [actuator.axes.signal(name) for name in weights],
            "actuator": as_toml(replace(actuator, tolerances=freed)),
        }

    def checked(self, recipe: Mapping[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
        """A saved recipe with the files' names of now, by those of then in `names`; InputError if it is none."""
        try:
            named = str(recipe["challenge"])
            given = {**recipe, "challenge": names.get(named, named)}
            if not given["challenge"]:
                for which in ("fitted", "held"):
                    given[which] = [names.get(str(name), str(name)) for name in recipe[which]]
        except (KeyError, TypeError, AttributeError):
            raise InputError(_DAMAGED) from None
        self._challenge(given["challenge"])
        return given

    def take(self, recipe: Mapping[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
        """Chooses what a saved recipe says; returns it as of `checked`."""
        given = self.checked(recipe, names)
        self.choose(given["challenge"])
        self.held_out = set(given.get("held", ()))
        return given

    def recall(self, recipe: Mapping[str, Any], challenge: Challenge | None, revealed: bool) -> None:
        """Chooses again what a story was made from, without reading anything."""
        self.challenge, self.chosen, self.revealed = challenge, str(recipe.get("challenge", "")), revealed
        self.held_out = set(recipe.get("held", ()))

    def read(self, recipe: Mapping[str, Any]) -> Material:
        """Reads what a recipe says; InputError for files that are gone, or a recipe that is none."""
        if self.challenge is not None:
            with opened(self.challenge) as challenge:
                actuator = load_actuator(challenge.actuator)
                fitted, held = (
                    [read(file, actuator, max_bytes=CHALLENGE_RECORDING_BYTES) for file in files]
                    for files in (challenge.training, challenge.holdout)
                )
            return Material(fitted, held, actuator, None, recipe)
        try:
            actuator = actuator_of(recipe["actuator"])
            fitted, held = (
                [self._comparing.measurement(str(name), actuator) for name in recipe[which]]
                for which in ("fitted", "held")
            )
            signals = None if recipe["signals"] is None else [str(name) for name in recipe["signals"]]
            window = recipe["window_s"]
            if window is not None:
                first, last = (number(edge, "the window's edge") for edge in window)
                fitted, held = ([one.selected((first, last)) for one in part] for part in (fitted, held))
        except InputError:
            raise
        except (KeyError, TypeError, ValueError):
            raise InputError(_DAMAGED) from None
        if not fitted:
            raise InputError(NOTHING)
        return Material(fitted, held, actuator, signals, recipe)

    def reveal(self) -> Truth:
        """What is hidden in the challenge."""
        if self.challenge is None:
            raise InputError("only a challenge has something to reveal; choose one above")
        sealed = self.challenge.sealed
        truth = read_truth(folder() / "truth" / f"{self.challenge.name}.toml") if sealed is None else unseal(sealed)
        self.revealed = True
        return truth


def files_of(recipe: Mapping[str, Any]) -> list[str]:
    """Names in the data folder of what a recipe is made from."""
    return [name for name in (recipe.get("challenge"), *recipe.get("fitted", ()), *recipe.get("held", ())) if name]


def actuator_of(text: Any) -> Actuator:
    """The actuator of a file's text; InputError tells what is wrong in it."""
    if not isinstance(text, str):
        raise InputError(_DAMAGED)
    with tempfile.TemporaryDirectory(prefix="emaviz-actuator-") as name:
        path = Path(name) / "actuator.toml"
        path.write_text(text, encoding="utf-8")
        try:
            return load_actuator(path)
        except InputError as error:
            raise InputError(f"the session's {str(error).replace(f'{name}/', '')}") from None
