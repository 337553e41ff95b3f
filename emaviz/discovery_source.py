"""What a discovery is made from: a challenge, or the recordings and the actuator of Compare, some of them held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ema_model.actuator import Actuator, load_actuator
from ema_model.challenges import Challenge, challenges, folder
from ema_model.challenges.truth import Truth, read_truth
from ema_model.errors import InputError
from ema_model.measurement import Measurement
from ema_model.recordings import read_recording
from emaviz.comparing import USUAL, Comparing

COMPARED = "The recordings of Compare"
NOTHING = "no recording to fit is chosen; open one on Compare, or choose a challenge"


@dataclass(frozen=True)
class Material:
    """What `ema_model.discovery.begun` is given."""

    fitted: Sequence[Measurement]
    held: Sequence[Measurement]
    actuator: Actuator
    signals: Sequence[str] | None


class DiscoverySource:
    """The choice; only `read` reads files."""

    def __init__(self, comparing: Comparing) -> None:
        self.challenges: dict[str, Challenge] = {one.name: one for one in challenges()}
        self.challenge: Challenge | None = None  # else the recordings of Compare
        self.revealed = False  # the challenge's truth
        self.held_out: set[str] = set()  # of Compare's recordings, by name
        self._comparing = comparing

    def choose(self, name: str) -> None:
        """A challenge by its name, or Compare's recordings with any other."""
        self.challenge, self.revealed = self.challenges.get(name), False

    def hold_out(self, name: str, held: bool) -> None:
        """Whether one of Compare's recordings is kept from the fit, to judge by."""
        self.held_out = self.held_out | {name} if held else self.held_out - {name}

    @property
    def compared(self) -> dict[str, Measurement]:
        """Compare's recordings whose columns are known, by name."""
        opened = self._comparing.opened
        return {name: one.measurement for name, one in opened.items() if one.measurement is not None}

    @property
    def ready(self) -> bool:
        """Whether there is something to start with."""
        return self.challenge is not None or any(name not in self.held_out for name in self.compared)

    def read(self) -> Material:
        """Reads what is chosen; InputError where nothing is left to fit."""
        if self.challenge is not None:
            actuator = load_actuator()
            fitted, held = (
                [read_recording(file, actuator) for file in files]
                for files in (self.challenge.training, self.challenge.holdout)
            )
            return Material(fitted, held, actuator, None)
        comparing, known = self._comparing, self.compared
        if comparing.window_s is not None:
            known = {name: one.selected(comparing.window_s) for name, one in known.items()}
        fitted = [one for name, one in known.items() if name not in self.held_out]
        if not fitted:
            raise InputError(NOTHING)
        actuator, weights = comparing.actuator, comparing.weights
        freed = {path: replace(one, free=path in comparing.free) for path, one in actuator.tolerances.items()}
        signals = None if weights == USUAL else [actuator.axes.signal(name) for name in weights]
        held = [known[name] for name in known if name in self.held_out]
        return Material(fitted, held, replace(actuator, tolerances=freed), signals)

    def reveal(self) -> Truth:
        """What is hidden in the challenge."""
        if self.challenge is None:
            raise InputError("only a challenge has something to reveal; choose one above")
        truth = read_truth(folder() / "truth" / f"{self.challenge.name}.toml")
        self.revealed = True
        return truth
