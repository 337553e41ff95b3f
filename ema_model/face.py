"""The package in a few functions, as `import ema_model as em` has them.

Recordings are files' names, or measurements that were read or simulated, one or several; they are of one actuator,
without one the thesis's.  Every function raises InputError, with one line, for what it cannot take.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ema_model import comparison, discovery, recordings
from ema_model.actuator import Actuator, load_actuator
from ema_model.actuator import save_actuator as save_actuator
from ema_model.commands import command as command_of
from ema_model.comparison import Comparison
from ema_model.discovery import Discovery
from ema_model.effects import find
from ema_model.errors import InputError as InputError
from ema_model.faults import vector
from ema_model.identification.objective import Objective
from ema_model.identification.run import ROBUST, Identification
from ema_model.identification.run import identify as identified
from ema_model.recordings import Measurement
from ema_model.recordings.health.card import Health, health_of
from ema_model.recordings.recording_set import long_enough
from ema_model.simulation import plant
from ema_model.simulation.run import Run
from ema_model.simulation.sensors import Sensors
from ema_model.units.compare import compare_units as compared_units
from ema_model.units.result import UnitsCompared

One = str | os.PathLike[str] | Measurement
Recordings = One | Sequence[One]


def read(path: str | os.PathLike[str], actuator: Actuator | None = None, mapping: Sequence[str] = ()) -> Measurement:
    """A recording in SI, as the model needs it; mapping: texts such as "time_s=t[ms]" for columns of other names."""
    return recordings.read(path, actuator or load_actuator(), mapping)


def health(of: One, actuator: Actuator | None = None) -> Health:
    """What a recording's own numbers say of its sampling, its sensors, its signs and the drive's limits."""
    actuator = actuator or load_actuator()
    return health_of(_read(of, actuator)[0], actuator)


def simulate(
    command: str = "chirp",
    actuator: Actuator | None = None,
    *,
    settings: Mapping[str, float] | None = None,
    faults: Mapping[str, float] | None = None,
    effects: Mapping[str, Mapping[str, float]] | None = None,
    load_torque_Nm: float = 0.0,
    duration_s: float = 0.5,
    sample_rate_Hz: float = 10_000.0,
    noise_A: float = 0.0,
    encoder_bits: int = 0,
    seed: int = 0,
) -> Measurement:
    """One run of the Reference Model, or of the Monitor Model where an actuator has none, as sensors record it.

    settings: of the command; faults: k1 … k8 by name, in [0, 1]; effects: settings by effect; noise_A: rms;
    encoder_bits: per motor turn, 0 is a perfect one.  It bears the command's name.
    """
    run = Run(command_of(command, settings or {}), duration_s, sample_rate_Hz, load_torque_Nm)
    hidden = {name: find(name).settings(dict(given)) for name, given in (effects or {}).items()}
    clean = plant.simulate(run, actuator or load_actuator(), vector(dict(faults or {})), hidden)
    return replace(Sensors(noise_A, encoder_bits).record(clean, seed), name=command)


def compare(
    of: Recordings, actuator: Actuator | None = None, *, holdout: Recordings = (), **options: Any
) -> Comparison:
    """Where the model fails; options as of `ema_model.comparison.compare`."""
    actuator = actuator or load_actuator()
    return comparison.compare(_read(of, actuator), actuator, holdout=_read(holdout, actuator), **options)


def compare_units(
    units: Mapping[str, Recordings],
    actuator: Actuator | None = None,
    *,
    holdout: Mapping[str, Recordings] | None = None,
    **options: Any,
) -> UnitsCompared:
    """What units of one type differ in, by their names; options as of `ema_model.units.compare.compare_units`."""
    actuator = actuator or load_actuator()
    fitted, held = ({name: _read(of, actuator) for name, of in given.items()} for given in (units, holdout or {}))
    return compared_units(fitted, actuator, holdout=held, **options)


def discover(
    of: Recordings, actuator: Actuator | None = None, *, holdout: Recordings = (), **options: Any
) -> Discovery:
    """Which physical effects are missing; options as of `ema_model.discovery.discover`."""
    actuator = actuator or load_actuator()
    return discovery.discover(_read(of, actuator), actuator, holdout=_read(holdout, actuator), **options)


def identify(
    of: Recordings, actuator: Actuator | None = None, algorithm: str = ROBUST, **options: Any
) -> Identification:
    """The faults k1 … k8, with how sure that is; options as of `ema_model.identification.run.steps`."""
    actuator = actuator or load_actuator()
    return identified(Objective(_read(of, actuator), actuator), algorithm, **options)


def _read(of: Recordings, actuator: Actuator) -> list[Measurement]:
    several = [of] if isinstance(of, str | os.PathLike | Measurement) else of
    found = long_enough(
        several,
        lambda one: one if isinstance(one, Measurement) else recordings.read(one, actuator),
        lambda line: warnings.warn(line, stacklevel=5),
    )
    return [one for _, one in found]
