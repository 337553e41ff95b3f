"""A fleet: what its units share, and in which parameters which of them differ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.errors import InputError
from ema_model.fleets.own import Own, own
from ema_model.fleets.recorded import RUNS

Array = NDArray[np.float64]

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
