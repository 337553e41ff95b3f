"""The responses that the thesis draws: both models beside each other, the actuator at five severities of a fault."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ema_model.actuator import Actuator
from ema_model.campaign.thesis.cases import BY_NAME, MULTIPLE
from ema_model.commands import command
from ema_model.faults import HEALTHY, vector
from ema_model.recordings import Measurement
from ema_model.simulation.plant import simulate
from ema_model.simulation.run import Run, simulate_monitor

RUNS = {"chirp": Run(command("chirp")), "step": Run(command("step"), 1.0)}  # in 0.5 s, 1 rad is not reached
SIGNALS = ("user_position_rad", "motor_speed_rad_s", "current_A")  # of which it shows severities


@dataclass(frozen=True)
class Pair:
    """Reference and Monitor Model at the same k."""

    name: str
    title: str
    reference: Measurement
    monitor: Measurement

    def rms_difference(self, signal: str) -> float:
        """Monitor − reference, in the signal's unit."""
        return float(np.sqrt(np.mean((self.monitor[signal] - self.reference[signal]) ** 2)))


@dataclass(frozen=True)
class Severity:
    """One value of a fault."""

    title: str
    settings: dict[str, float]


@dataclass(frozen=True)
class Family:
    """A fault at five severities, the first of them healthy or the lowest."""

    name: str
    title: str
    figures: str  # the thesis's
    severities: tuple[Severity, ...]


def _five(name: str, titles: tuple[str, ...], values: tuple[float, ...]) -> tuple[Severity, ...]:
    return tuple(Severity(title, {name: value}) for title, value in zip(titles, values))


_QUARTERS = (0.0, 0.25, 0.5, 0.75, 1.0)
FAMILIES: tuple[Family, ...] = (
    Family("friction", "Friction", "3.27–3.33", _five("k1", ("× 1", "× 1.5", "× 2", "× 2.5", "× 3"), _QUARTERS)),
    Family(
        "backlash",
        "Backlash",
        "3.34–3.41",
        _five(
            "k2",
            ("× 2", "× 5", "× 10", "× 50", "× 100"),
            tuple((factor - 1.0) / 99.0 for factor in (2.0, 5.0, 10.0, 50.0, 100.0)),
        ),
    ),
    Family(
        "short_circuit",
        "Short circuit of phase C",
        "3.43–3.52",
        _five("k5", ("0 %", "25 %", "50 %", "75 %", "98 %"), _QUARTERS),
    ),
    Family(
        "eccentricity",
        "Eccentricity",
        "3.54–3.62",
        _five("k6", ("0 %", "25 %", "50 %", "75 %", "100 %"), _QUARTERS),
    ),
    Family(
        "gain",
        "Proportional gain",
        "3.63–3.70",
        _five("k8", ("× 0.5", "× 0.75", "× 1", "× 1.25", "× 1.5"), _QUARTERS),
    ),
)


def pairs(actuator: Actuator) -> list[Pair]:
    """Healthy and faulty, on the chirp (T 3.17–3.24 has the healthy one)."""
    multiple = BY_NAME[MULTIPLE]
    cases = (("healthy", "Healthy", HEALTHY), ("faulty", multiple.title, multiple.k))
    run = RUNS["chirp"]
    return [
        Pair(name, title, simulate(run, actuator, k, {}), simulate_monitor(run, actuator, k, circuit="thesis"))
        for name, title, k in cases
    ]


def responses(family: Family, run: str, actuator: Actuator) -> dict[str, Measurement]:
    """By severity; `run` of RUNS."""
    return {one.title: simulate(RUNS[run], actuator, vector(one.settings), {}) for one in family.severities}


@dataclass(frozen=True)
class Drawn:
    """All of them."""

    actuator: Actuator
    pairs: list[Pair]
    families: dict[tuple[str, str], dict[str, Measurement]]  # by family and run: by severity


def drawn(actuator: Actuator) -> Drawn:
    """Some sixty simulations, a few seconds."""
    families = {
        (family.name, run): responses(family, run, actuator) for family in FAMILIES for run in ("step", "chirp")
    }
    return Drawn(actuator, pairs(actuator), families)
