"""What was found in looking for the physics that units lack."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ema_model.actuator import Actuator
from ema_model.discovery import Added, Discovery
from ema_model.text import InWords
from ema_model.units.result import UnitsCompared


@dataclass(frozen=True)
class Lack:
    """An effect that some units lack, each by its own recordings, fitted and held out."""

    effect: str
    by_unit: Mapping[str, Added]  # of those that lack it
    same_as: tuple[str, ...]  # effects that no unit's recordings tell from it

    @property
    def units(self) -> tuple[str, ...]:
        """Those that lack it."""
        return tuple(self.by_unit)


@dataclass(frozen=True, repr=False, eq=False)
class UnitsDiscovered(InWords):
    """The answer."""

    units: tuple[str, ...]
    lacks: tuple[Lack, ...]  # those that all units lack first
    discoveries: Mapping[str, Discovery]  # of each unit, the last one
    compared: UnitsCompared  # with what all units lack in the model
    actuator: Actuator  # the file's, with what all units lack
    held_out: frozenset[str]  # units with recordings that were not fitted

    def is_of_all(self, one: Lack) -> bool:
        """Whether all units lack it."""
        return len(one.by_unit) == len(self.units)

    @property
    def unexplained(self) -> tuple[str, ...]:
        """Units of which more than the floor is left, that no effect explains."""
        return tuple(
            name
            for name, one in self.discoveries.items()
            if one.verdict in ("unknown_effect", "partly_explained") and not one.at_floor
        )

    @property
    def undecided(self) -> tuple[str, ...]:
        """Units of which nothing can be said: not converged, not repeatable, or of recordings that tell nothing."""
        nothing = ("not_converged", "not_repeatable", "uninformative")
        return tuple(name for name, one in self.discoveries.items() if one.verdict in nothing)
