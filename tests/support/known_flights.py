"""A folder of flights whose identification, which takes seconds each, is known beforehand."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ema_model.recordings import Measurement, write_measurement
from ema_model.tracking.flights import Flight

FOLLOWING = "emaviz.session.track"


def recording(path: Path, size: float = 1.0) -> None:
    """A small one, in which nothing is to be found."""
    time = np.arange(0.0, 0.02, 1e-4)
    names = ("command_rad", "user_position_rad", "motor_position_rad", "current_A")
    write_measurement(Measurement({"time_s": time, **{name: size * np.sin(300.0 * time) for name in names}}), path)


def write_flights(folder: Path, count: int) -> Path:
    """flight_00 … of the same recording; returns that one, beside the folder."""
    one = folder.with_name("one.parquet")
    recording(one)
    folder.mkdir()
    for i in range(count):
        shutil.copy(one, folder / f"flight_{i:02d}.parquet")
    return one


def known(flights: Sequence[Flight], asked: list[str]):
    """What stands in for `identified`: the flight of the number in the name; asked: takes the names."""

    def identified(recording, name, actuator, on_iteration=None):
        assert recording.samples > 100
        asked.append(name)
        return replace(flights[int(name[-2:])], name=name)

    return identified
