"""What a model beside recordings offers, whichever it is: the contract of fits, comparisons and discoveries.

A model holds recordings cut into windows and says what each of them would show, for a population at once.  Nobody
above asks which model it is: what matters of it is said here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.recordings import Measurement
from ema_model.stacks import Stack

Array = NDArray[np.float64]
Signals = dict[str, Array]  # by name
Effects = Mapping[str, Mapping[str, Any]]  # settings by name; numbers, or arrays (n,)


@dataclass(frozen=True, eq=False, kw_only=True)
class Window:
    """One run of a recording, or a part of it, as it is compared.  Block arrays are (blocks,)."""

    name: str
    recording: int  # which of the recordings, from 0
    first: int  # the recording's sample that is its start
    time_s: Array  # (blocks,), middle of each block, as recorded
    measured: Signals  # what is compared, block arrays
    context: Signals  # what else is known of the blocks
    command: Array | None  # (steps,), rad at the user; None where the model takes the measured motion
    samples_per_block: int
    block_s: float  # time between compared values
    values: dict[str, float] = field(default_factory=dict)  # of the actuator, in this recording alone
    lasting: Signals = field(default_factory=dict)  # rms of what sensors are off by, where that lasts: block arrays
    allowed: Signals = field(default_factory=dict)  # of that, what is granted, and not known to be there: block arrays
    beating: Signals = field(default_factory=dict)  # rms of quantisation that no mean takes away: block arrays
    held_s: Signals = field(default_factory=dict)  # how long a reading stays the same: block arrays
    on_grid: frozenset[str] = frozenset()  # signals whose noise is their grid's
    alike: float = 1.0  # over how many blocks a filter of the signals makes their noise alike

    @property
    def blocks(self) -> int:
        """Number of compared values."""
        return len(self.time_s)


@dataclass(frozen=True, eq=False)
class ModelParts:
    """Of which a model is made: where a result is stored, they stand for it."""

    measurements: Sequence[Measurement]
    actuator: Actuator
    effects: Mapping[str, Mapping[str, float]]
    stretches: Sequence[list[slice] | None] | None
    circuit: str
    block_s: float
    own_kernels: bool = False

    def made(self) -> Model:
        """The model; its windows are cut, and its kernels found, once they are asked for."""
        from ema_model.models import ClosedLoop, InverseDynamics, is_inverse  # which are made of this module

        given: dict[str, Any] = {"effects": self.effects, "stretches": self.stretches, "at_once": False}
        if is_inverse(self.measurements, self.actuator):
            return InverseDynamics(self.measurements, self.actuator, **given)
        given |= {"circuit": self.circuit, "block_s": self.block_s, "own_kernels": self.own_kernels}
        return ClosedLoop(self.measurements, self.actuator, **given)


class Model(Protocol):
    """An actuator's model beside recordings; windows are named by their place in `windows`."""

    actuator: Actuator
    effects: dict[str, dict[str, float]]  # besides the actuator's own
    recorded: list[Measurement]

    def made_of(self) -> ModelParts:
        """As `ema_model.result` stores it."""
        ...

    @cached_property
    def stack(self) -> Stack:
        """The kernels."""
        ...

    @cached_property
    def measurements(self) -> list[Measurement]:
        """The recordings on an even grid."""
        ...

    @cached_property
    def windows(self) -> Sequence[Window]:
        """What is compared."""
        ...

    @property
    def simulates_commands(self) -> bool:
        """Whether it follows the command, from a start that is not exactly known; else the motion is given."""
        ...

    def at_longer_steps(self, most_s: float) -> Model:
        """The same, simulated at steps of up to most_s, s, where it has steps and a sample holds whole ones."""
        ...

    def signals(
        self,
        place: int,
        actuator: Actuator | None = None,
        k: ArrayLike | None = None,
        turned_rad: ArrayLike = 0.0,
        play_rad: ArrayLike = 0.0,
        faster_rad_s: ArrayLike = 0.0,
        pull_Nm: ArrayLike = 0.0,
        effects: Effects | None = None,
        *,
        even: bool = False,
    ) -> Signals:
        """What a window's sensors would show, all that is measured there and more: k (n, 8) → (n, blocks) each.

        actuator, k, effects: in place of the model's own.  Parameters of the actuator and of effects, turned_rad (the
        motor's angle at the start, rad, beyond the measured one), play_rad (the same for its place in the play),
        faster_rad_s (for its speed) and pull_Nm (for the torque that the drive asks for) may be arrays (n,).
        even: under the window's mean load and a supply that does not change.
        """
        ...

    def twins(
        self,
        place: int,
        actuator: Actuator,
        k: Array,
        turned_rad: ArrayLike = 0.0,
        play_rad: ArrayLike = 0.0,
        faster_rad_s: ArrayLike = 0.0,
        pull_Nm: ArrayLike = 0.0,
        effects: Effects | None = None,
    ) -> Signals:
        """The measured ones of the model of higher fidelity, `even`, of a few at once: k (n, 8) → (n, blocks) each.

        All else as of `signals`.  Empty where there is none.  Raises FloatingPointError if one diverges.
        """
        ...

    def noise(self, place: int, stated: Mapping[str, float]) -> dict[str, float]:
        """White noise of the measured signals, rms per block; stated: rms per sample, in place of the estimate."""
        ...

    def a_sample_late(self, place: int, k: ArrayLike | None = None) -> Signals:
        """What changes if the command comes a sample later, (blocks,) each; empty where it has no jump."""
        ...

    def between_samples(self, place: int, k: ArrayLike | None = None) -> Signals:
        """What changes if the command goes straight between samples, (blocks,) each; empty where it is known to."""
        ...

    def turning(self, place: int, k: ArrayLike | None = None) -> Signals:
        """What the model is off by where a measured motion turns round, (blocks,) each; empty of a simulated one."""
        ...
