"""The first flights of a unit whose end is sealed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ema_model import faults
from ema_model.actuator import Actuator
from ema_model.practice.kinds.kind import Kind, Progress, Revealed, Truth
from ema_model.quantities.titles import in_sentence
from ema_model.recordings import write_measurement
from ema_model.simulated_lives import Life, recorded, worn_life
from ema_model.text import InWords
from ema_model.tracking.track import Tracked


class OneLife(Kind):
    """The truth has a seed, a law and a fault of `ema_model.simulated_lives`, and how many flights are recorded."""

    def make(self, truth: Truth, actuator: Actuator, folder: Path, tell: Progress) -> None:
        """A file for each flight."""
        count = int(truth["flights"])
        for number, (name, one) in enumerate(recorded(_life(truth), actuator, range(count))):
            tell(f"recording {name}", number / count)
            write_measurement(one, folder / f"{name}.parquet")

    def reveal(self, truth: Truth, actuator: Actuator, found: InWords | None) -> Revealed:
        """When it ended, since when it wore, and whether the 90 % interval held it."""
        life, count = _life(truth), int(truth["flights"])
        left = life.flights - count
        name = f"{life.fault} {in_sentence(faults.BY_NAME[life.fault].title)}"
        lines = [
            f"{name} reached {life.threshold:.2g} in flight {life.flights}, {left} flights after the last one recorded"
        ]
        if life.law == "onset":
            lines.append(f"it did not wear before flight {life.onset + 1}")
        if life.repaired is not None:
            lines.append(f"the part was replaced before flight {life.repaired + 1}")
        k = life.k[: count + left, faults.NAMES.index(life.fault)]
        lines.append(f"in truth it was {k[0]:.3f} in the first flight and {k[count - 1]:.3f} in the last one recorded")
        if not isinstance(found, Tracked):
            return Revealed(tuple(lines))
        said = found.faults[life.fault].remaining_flights
        late = left - (len(found.flights) - count)  # as it was to be said after the last flight that was looked at
        return Revealed(tuple(lines), said is not None and bool(np.floor(said.p05) <= late <= np.ceil(said.p95)))

    def command(self, folder: str, thresholds: Mapping[str, float]) -> str:
        """`emaviz track`."""
        return " ".join([f"emaviz track {folder}", *(f"--threshold {k}={at:g}" for k, at in thresholds.items())])


def _life(truth: Truth) -> Life:
    return worn_life(str(truth["law"]), int(truth["seed"]), fault=str(truth["fault"]))


KIND = OneLife()
