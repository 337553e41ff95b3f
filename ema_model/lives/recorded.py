"""The flights of a life as recordings of the three-phase model."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ema_model.actuator import Actuator
from ema_model.lives.life import Life
from ema_model.lives.profiles import PROFILES, SENSORS, profiles_of
from ema_model.recordings import Measurement, write_measurement
from ema_model.simulation.plant import simulate

_BAD_NOISE_A = 6.0  # of a broken wire: the rig records, and nothing can be told


def unit_of(life: Life, actuator: Actuator) -> Actuator:
    """The unit: each base parameter somewhere within its tolerance, once for all its flights."""
    u = base_of(life, len(actuator.tolerances))
    values = {
        path: actuator.value(path) + one.sigma * x
        for x, (path, one) in zip(u, actuator.tolerances.items())
        if not path.startswith("sensors.")
    }
    return actuator.with_values(values)


def base_of(life: Life, count: int) -> np.ndarray:
    """(count,), in σ of the tolerances, within 2.5 σ."""
    return np.clip(np.random.default_rng([life.seed, 43]).standard_normal(count), -2.5, 2.5)


def recorded(life: Life, actuator: Actuator, flights: range | None = None) -> Iterator[tuple[str, Measurement]]:
    """Names ("flight_0007") and recordings, one after another; FloatingPointError if the model diverges."""
    unit, profiles = unit_of(life, actuator), profiles_of(life)
    for i in flights or range(life.flights):
        clean = simulate(PROFILES[profiles[i]].run, unit, life.k[i], {})
        one = SENSORS.record(clean, 100_000 * life.seed + i)
        if not life.usable[i]:
            noise = np.random.default_rng([life.seed, 44, i]).standard_normal(one.samples)
            one = one.with_signals(current_A=np.cumsum(noise) / np.sqrt(one.samples) * _BAD_NOISE_A)
        kept = {name: one[name] for name in ("time_s", "command_rad", "user_position_rad", "motor_position_rad",
                                             "current_A", "load_torque_Nm") if name in one}  # fmt: skip
        yield f"flight_{i + 1:04d}", Measurement(kept, name=f"flight_{i + 1:04d}")


def write(life: Life, actuator: Actuator, folder: Path, flights: range | None = None) -> list[Path]:
    """The same as files in a folder that must be there."""
    found = []
    for name, one in recorded(life, actuator, flights):
        found.append(folder / f"{name}.parquet")
        write_measurement(one, found[-1])
    return found
