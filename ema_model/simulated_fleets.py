"""Fleets of one type of actuator, made for tests and for teaching: units that differ in what is drawn, and is known.

A fleet is drawn from a seed; its recordings are the three-phase model's, with sensors' noise.
`python -m ema_model.simulated_fleets FOLDER [SEED]` makes one there, or tells the truth of the one there.
"""

from __future__ import annotations

import base64
import binascii
import json
import sys
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator, load_actuator, parse_actuator, save_actuator
from ema_model.actuator.file import as_toml
from ema_model.commands import command
from ema_model.errors import InputError
from ema_model.files.opened import shown
from ema_model.files.written import whole_file
from ema_model.fleet.block import linearised, pooled, unit_of
from ema_model.recordings import Measurement, write_measurement
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_reference

# --- how well the recordings of one unit tell each of its parameters, and which are only known together ---------------
# It is what a fit of that unit alone leaves open, at the file's values, with the file's tolerances as all else that
# is known: the covariance is (G + 1)⁻¹ in tolerances, G as of `fleet.block`.

_LENGTH_S = 0.4
RUNS = {
    "chirp": Run(command("chirp"), _LENGTH_S),
    "step": Run(command("step", {"final_rad": 0.05}), _LENGTH_S),
    "loaded": Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 5.0}), _LENGTH_S, load_torque_Nm=20.0),
}

Array = NDArray[np.float64]

_ROUNDS = 8  # of twins: their spread is known to a tenth
_KNOWN = 0.4  # of a tolerance, up to which a parameter is told by itself
_SHOWS = 0.2  # of it, up to which one shows at all, were all others known
_TOGETHER = 0.7  # correlation from which on two that are not told by themselves are only known together


@dataclass(frozen=True)
class Own:
    """One parameter, or one of those that are only known together."""

    parameter: str  # "section.parameter"
    together: tuple[str, ...]  # with itself, in the file's order
    sigma: float  # of the file's tolerance: what is not known of it, were the others of `together` known


def own(actuator: Actuator, runs: tuple[str, ...]) -> tuple[Own, ...]:
    """Of each parameter that shows in these runs."""
    return _own(as_toml(actuator), runs)


@lru_cache(maxsize=4)
def _own(text: str, runs: tuple[str, ...]) -> tuple[Own, ...]:
    actuator = parse_actuator(text, "the fleet's actuator")
    unit = unit_of("", list(recorded(actuator, 0, runs=runs).values()), actuator)
    part = linearised(unit, np.zeros(len(unit.parameters)), rounds=_ROUNDS)
    return _told(unit.parameters, pooled([part])[0].information)


def _told(names: Sequence[str], information: Array) -> tuple[Own, ...]:
    whole = information + np.eye(len(information))
    covariance = np.linalg.inv(whole)
    sigma = np.sqrt(np.diag(covariance))
    alone = 1.0 / np.sqrt(np.diag(whole))
    correlation = np.abs(covariance / np.outer(sigma, sigma))
    found = []
    for i, name in enumerate(names):
        mates = [i]
        if sigma[i] > _KNOWN:
            mates = [j for j in range(len(names)) if j == i or (sigma[j] > _KNOWN and correlation[i, j] > _TOGETHER)]
        rest = [j for j in range(len(names)) if j == i or j not in mates]
        of_group = float(np.sqrt(np.linalg.inv(whole[np.ix_(rest, rest)])[rest.index(i), rest.index(i)]))
        if of_group <= _KNOWN and alone[i] <= _SHOWS and not name.startswith("sensors."):
            found.append(Own(name, tuple(names[j] for j in mates), of_group))
    return tuple(found)


# --- a fleet: what its units share, and in which parameters which of them differ --------------------------------------

FEWEST, MOST = 2, 20  # units
MOST_DIFFERING = 3  # parameters
_WORST = 1.5  # tolerances, that what all units share is off by at most
_FARTHEST = 4.5  # tolerances, that a unit may be off by
_TWO_UNITS = 0.3  # share of parameters that differ in two units alike, where there are six units or more


@dataclass(frozen=True)
class Difference:
    """A parameter in which some units are not as the others."""

    units: tuple[int, ...]  # from 0
    parameter: str  # "section.parameter"
    together: tuple[str, ...]  # the parameters with which it is only known together, itself among them
    change: float  # in the file's tolerances


@dataclass(frozen=True, eq=False)
class Fleet:
    """A fleet and its truth."""

    seed: int
    actuator: Actuator  # as its file says
    size: float  # of the differences, in σ of what a unit's recordings tell of the parameter
    spread: float  # 1 σ, of a tolerance, by which all units scatter in all parameters
    runs: tuple[str, ...]  # that each unit was asked for, besides the one to hold out
    names: tuple[str, ...]
    parameters: tuple[str, ...]
    x: Array  # (units, parameters), in tolerances from the file
    differences: tuple[Difference, ...]

    def unit(self, number: int) -> Actuator:
        """One of its units as it truly is."""
        values = {
            path: self.actuator.value(path) + self.actuator.tolerances[path].sigma * float(off)
            for path, off in zip(self.parameters, self.x[number])
        }
        return self.actuator.with_values(values)


def draw(
    actuator: Actuator,
    seed: int,
    *,
    units: int | None = None,
    differing: int | None = None,
    size: float = 5.0,
    spread: float = 0.0,
    runs: tuple[str, ...] = tuple(RUNS),
) -> Fleet:
    """A fleet of `units`, whose `differing` parameters differ by `size` σ; both are drawn where they are not given.

    runs: of `RUNS`; the fewer, the more parameters are only known together.  Where all units scatter, σ is the scatter
    and what the recordings leave open together.  Raises InputError for numbers that no fleet has, and for an actuator
    without a three-phase model.
    """
    random = np.random.default_rng([seed, 50])
    count = int(random.integers(FEWEST, MOST + 1)) if units is None else units
    several = int(random.integers(1, MOST_DIFFERING + 1)) if differing is None else differing
    if not (FEWEST <= count <= MOST and 0 <= several <= MOST_DIFFERING):
        raise InputError(f"a fleet has {FEWEST} to {MOST} units and 0 to {MOST_DIFFERING} parameters that differ")
    if not (1.0 <= size <= 10.0 and 0.0 <= spread <= 0.5):
        raise InputError("size is from 1 to 10 σ, spread from 0 to 0.5 of a tolerance")
    if not actuator.has_reference_model:
        raise InputError(f"{actuator.name}: has no three-phase reference model, which fleets are made by")
    paths = tuple(path for path, one in actuator.tolerances.items() if one.free and not path.startswith("sensors."))
    shared = np.clip(random.standard_normal(len(paths)), -_WORST, _WORST)
    x = shared + spread * random.standard_normal((count, len(paths)))
    known = list(own(actuator, runs))
    differences: list[Difference] = []
    for _ in range(several):
        left = [one for one in known if size * np.hypot(one.sigma, spread) <= _FARTHEST - _WORST]
        if not left:
            raise InputError("too few parameters are told so well; ask for fewer that differ, or by a lesser size")
        one: Own = left[int(random.integers(len(left)))]
        together = count >= 6 and random.random() < _TWO_UNITS
        which = sorted(int(i) for i in random.choice(count, 2 if together else 1, replace=False))
        change = float(random.choice([-1.0, 1.0])) * size * float(np.hypot(one.sigma, spread))
        x[which, paths.index(one.parameter)] += change
        differences.append(Difference(tuple(which), one.parameter, one.together, change))
        known = [other for other in known if not set(other.together) & set(one.together)]
    names = tuple(f"unit_{number:02d}" for number in range(1, count + 1))
    return Fleet(seed, actuator, size, spread, runs, names, paths, x, tuple(differences))


# --- the recordings of a fleet ----------------------------------------------------------------------------------------
# The recordings of a fleet: the same commands for each unit, as a test bench gives them, and one to hold out.
#
# Each recording starts a little elsewhere in the encoder's step and in the play, so that no two are alike to the last
# digit and the chopping's ripple is another in each.

SENSORS = Sensors(current_noise_A=0.45, encoder_bits=12)
UNSEEN = {
    "unseen": Run(command("multisine", {"amplitude_rad": 8e-3, "frequencies_Hz": (2.0, 6.0, 14.0)}), _LENGTH_S),
}
_KEPT = ("time_s", "command_rad", "user_position_rad", "motor_position_rad", "current_A", "load_torque_Nm")
_START_RAD = 1e-2  # 1 σ, of the motor


def recorded(
    actuator: Actuator, seed: int, unit: int = 0, runs: Iterable[str] = (*RUNS, *UNSEEN)
) -> dict[str, Measurement]:
    """The recordings of one unit by name; FloatingPointError if the model diverges."""
    every = {**RUNS, **UNSEEN}
    transmission = actuator.transmission
    half_play = 0.5 * transmission.backlash_rad / transmission.gear_ratio
    found = {}
    for number, name in enumerate(every):
        random = np.random.default_rng([seed, 52, unit, number])
        start, play = _START_RAD * random.standard_normal(), half_play * random.uniform(-1.0, 1.0)
        if name in runs:
            clean = simulate_reference(
                every[name],
                actuator,
                start_rad=start * transmission.gear_ratio,
                start_play_rad=play,
            )
            one = SENSORS.record(clean, int(random.integers(2**62)))
            found[name] = Measurement({key: one[key] for key in _KEPT if key in one}, name=name)
    return found


# --- a fleet as a folder ----------------------------------------------------------------------------------------------
# A fleet as a folder: UNIT/RECORDING.parquet, the actuator's file, and what differs, packed so that none reads it.
#
# Nothing that compares units may read the truth.

TRUTH, ACTUATOR = "truth.sealed", "actuator.toml"
_MOST_BYTES = 100_000


def write(fleet: Fleet, folder: Path) -> None:
    """Into a folder that must be empty, or is made; InputError where that cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise InputError(f"{shown(folder)}: is not empty; name another folder")
        for name in fleet.names:
            (folder / name).mkdir()
    except OSError as error:
        raise InputError(f"{shown(folder)}: cannot be made ({error.strerror}); name another folder") from None
    save_actuator(fleet.actuator, folder / ACTUATOR)
    for number, name in enumerate(fleet.names):
        for run, one in recorded(fleet.unit(number), fleet.seed, number, (*fleet.runs, *UNSEEN)).items():
            write_measurement(one, folder / name / f"{run}.parquet")
    with whole_file(folder / TRUTH) as draft:
        draft.write_bytes(base64.b64encode(zlib.compress(json.dumps(told(fleet)).encode(), 9)))


def told(fleet: Fleet) -> list[dict[str, object]]:
    """What differs, in plain values: units by name, the parameter, by how much of the file's value."""
    found = []
    for one in fleet.differences:
        value, sigma = fleet.actuator.value(one.parameter), fleet.actuator.tolerances[one.parameter].sigma
        share = one.change * sigma / value if value else None
        units = [fleet.names[i] for i in one.units]
        found.append({"units": units, "parameter": one.parameter, "change": one.change * sigma, "share": share})
    return found


def read_truth(folder: Path) -> list[dict[str, object]]:
    """What `told` said when the folder was written; InputError for one that has none."""
    try:
        unpacking = zlib.decompressobj()
        text = unpacking.decompress(base64.b64decode((folder / TRUTH).read_bytes(), validate=True), _MOST_BYTES)
        return list(json.loads(text))
    except (OSError, binascii.Error, zlib.error, ValueError, RecursionError):
        raise InputError(f"{shown(folder / TRUTH)}: no truth of a fleet can be read there; name its folder") from None


# --- as a program -----------------------------------------------------------------------------------------------------


def main() -> int:
    """SEED: a whole number from 0; units and differences are drawn from it."""
    arguments = sys.argv[1:]
    try:
        if not 1 <= len(arguments) <= 2 or (len(arguments) == 2 and not arguments[1].isdecimal()):
            raise InputError("python -m ema_model.simulated_fleets FOLDER [SEED], SEED a whole number from 0")
        folder = Path(arguments[0])
        if len(arguments) == 2 or not (folder / TRUTH).exists():
            write(draw(load_actuator(), int(arguments[1]) if len(arguments) == 2 else 0), folder)
            print(folder)
        else:
            for one in read_truth(folder):
                print(one)
    except InputError as error:
        print(f"fleets: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
