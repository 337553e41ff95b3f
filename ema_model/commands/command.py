"""What every command is: settings with units in their names, and the user's position demand over time."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ema_model.errors import InputError
from ema_model.quantities import check_number

Array = NDArray[np.floating]


@dataclass(frozen=True)
class Command(ABC):
    """A position command at the user, rad.  The dataclass's fields are its settings."""

    name: ClassVar[str]
    place: ClassVar[int] = 9  # in lists; those of one place stand by their names
    title: ClassVar[str]

    @abstractmethod
    def at(self, time_s: Array) -> Array:
        """Command, rad, at these times, s; both (n,)."""

    def settings(self) -> dict[str, Any]:
        """The settings by name."""
        return asdict(self)

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            if isinstance(f.default, int | float):
                check_number(value, f"{self.name}: {f.name}")
                if not math.isfinite(value):
                    raise InputError(f"{self.name}: {f.name} must be a finite number, not {value}")
                never_negative = f.name.endswith(("_Hz", "time_s"))
                if never_negative and value < 0.0:
                    raise InputError(f"{self.name}: {f.name} must not be negative, not {value:g}")
