"""The life that remains as the tracking tells it, beside an exponential fit, a particle filter, and two oracles.

    python tests/benchmarks/lives.py [--seeds 30] [--first 60000]

Lives are drawn as in the plan `lives`; all are asked after the same flights: those at λ between the one in which the
tracking declares a trend and the end.  The peers are given the same k since the last jump that the tracking found,
without what it found the unit's base parameters to add.  The oracles are given k since the last repair, the law and
how unevenly flights wear; of the unit's base parameters they have what all eight k of its flights tell, as the tracking
has.  "oracle" knows the law's exponent and its onset, too; "law alone" knows of what range they are drawn.  "bound" is
"oracle" given k without what base parameters add, which nobody can know.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from dataclasses import replace

import numpy as np
from life_oracles import Law, adds, oracle
from life_peers import Array, Quantiles, exponential_fit, particle_filter

from ema_model import faults
from ema_model.campaign.kinds import ALPHA, LAMBDA, LAMBDAS, Told, places
from ema_model.estimation.problem import ECCENTRICITY, to_vector
from ema_model.simulated_lives import LAWS, ONSET, POWER, Life, base_of, drawn, worn_life
from ema_model.tracking.flights import Flight, Unit
from ema_model.tracking.track import Tracker

WAYS = ("emaviz", "exponential fit", "particle filter", "law alone", "oracle", "bound")
VARIATIONS = (0.5, 1.0)
POWERS, MOST_ONSETS = 7, 24  # that an oracle of the law alone tries


def answers(life: Life) -> dict[str, list[Told]]:
    """What each way tells at λ = 0 and at each of LAMBDAS; nothing where no trend is declared before the end."""
    last, flights = life.flights - 1, drawn(life)
    tracker = Tracker({life.fault: life.threshold}, life.seed)
    looks: list[int] = []
    told: dict[str, list[Told]] = {name: [] for name in WAYS}
    for i, flight in enumerate(flights):
        tracker.add(flight)
        if not looks and tracker.has_trend(life.fault) and (life.repaired or 0) <= i < last:
            looks = places(i, last, (0.0, *LAMBDAS))
        if i in looks:
            for name, quantiles in after(life, flights[: i + 1], tracker).items():
                told[name] += [Told(i, float(last - i), *quantiles)] * looks.count(i)
    return told


def after(life: Life, flights: list[Flight], tracker: Tracker) -> dict[str, Quantiles]:
    """By way, 5, 50 and 95 % of the flights that remain."""
    one = tracker.look().faults[life.fault]
    healthy = faults.BY_NAME[life.fault].healthy
    sign = 1.0 if life.threshold > healthy else -1.0
    numbered = [(i + 1.0, flight) for i, flight in enumerate(flights) if not flight.excluded]
    begin = next((i for i, (_, f) in enumerate(numbered) if one.jumps and f.name == one.jumps[-1].flight), 0)
    at = np.array([number for number, _ in numbered])
    given = at[begin:], sign * (one.k[begin:] - healthy), one.sigma[begin:]
    now, threshold = float(len(flights)), sign * (life.threshold - healthy)
    left = one.remaining_flights
    return {
        "emaviz": (np.nan,) * 3 if left is None else (left.p05, left.p50, left.p95),
        "exponential fit": exponential_fit(*given, now, threshold),
        "particle filter": particle_filter(*given, now, threshold, life.seed),
        **_oracles(life, numbered, now, threshold, sign * healthy, sign),
    }


def _oracles(
    life: Life, numbered: list, now: float, threshold: float, healthy: float, sign: float
) -> dict[str, Quantiles]:
    ways: list[int] = [*ECCENTRICITY] if life.fault == "k6" else [faults.NAMES.index(life.fault)]
    end = to_vector(life.k[-1])[ways]
    way = np.zeros(len(faults.NAMES))
    way[ways] = end / np.hypot(*end) if life.fault == "k6" else sign
    first = life.repaired or 0
    since = [(number, flight) for number, flight in numbered if number > first]
    at = np.array([number for number, _ in since])
    mean, covariance = _unit(life, numbered, ways).known(tuple(ways))
    common = np.array([way @ flight.common for _, flight in since]).reshape(-1, len(mean))
    k = np.array([way @ flight.k for _, flight in since]) - healthy
    sigma = np.array([np.sqrt(way @ flight.own @ way) for _, flight in since])
    law = Law(life.power, max(0, life.onset - first), life.variation, 0.0 if life.fault == "k8" else 0.05)
    laws = _all_of(life.law, law, int(now) - first)
    fair: Array = k - common @ mean
    unit = adds(fair, sigma, common @ np.linalg.cholesky(covariance))
    true = k - common @ base_of(life, len(mean))
    return {
        "law alone": oracle(at, fair, sigma, now, threshold, laws, first + 1, unit),
        "oracle": oracle(at, fair, sigma, now, threshold, [law], first + 1, unit),
        "bound": oracle(at, true, sigma, now, threshold, [law], first + 1),
    }


def _all_of(name: str, law: Law, flown: int) -> list[Law]:
    """What a life of a law may be, as `ema_model.simulated_lives` draws it, of which so many flights were seen."""
    if name == "accelerating":
        return [replace(law, power=power) for power in np.linspace(*POWER, POWERS).tolist()]
    if name == "onset":
        onsets = np.unique(np.linspace(8, max(flown, 8), MOST_ONSETS).astype(int))
        low, high = ONSET
        return [
            replace(law, onset=onset, shortest=onset * (1 - high) / high, longest=onset * (1 - low) / low)
            for onset in onsets.tolist()
        ]
    return [law]


def _unit(life: Life, numbered: list, ways: list[int]) -> Unit:
    """What all k of all flights tell of the unit, the repair being known."""
    place = np.arange(len(faults.NAMES))
    unit = Unit(numbered[0][1].common.shape[1], place < 5, np.where(place == 7, faults.HEALTHY[7], 0.0))
    waiting = life.repaired is not None
    for number, flight in numbered:
        if waiting and number > (life.repaired or 0):
            waiting = False
            for i in ways:
                unit.replaced(i)
        unit.add(number, flight.k, flight.own, flight.common)
    return unit


def main() -> None:
    """Prints a table of each law."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=30, help="of each law and each of two variations of wear")
    parser.add_argument("--first", type=int, default=60000)
    asked = parser.parse_args()
    print("| law | way | 90 % holds, % | undefined | α-λ | cumulative relative accuracy, mean / median |")
    print("|---|---|---|---|---|---|")
    for law in LAWS:
        lives = [
            answers(worn_life(law, seed, variation))
            for variation in VARIATIONS
            for seed in range(asked.first, asked.first + asked.seeds)
        ]
        seen = [one for one in lives if one["emaviz"]]
        measured = defaultdict(list)
        for life in seen:
            for name in WAYS:
                told = life[name]
                defined = [one for one in told if one.defined]
                middle = told[1 + LAMBDAS.index(LAMBDA)]
                measured[name, "held"] += [one.p05 <= one.true <= one.p95 for one in defined]
                measured[name, "undefined"] += [not one.defined for one in told]
                measured[name, "alpha"].append(middle.defined and middle.relative_accuracy >= 1.0 - ALPHA)
                accuracies = [one.relative_accuracy for one in told[1:] if one.defined]
                measured[name, "cra"] += [np.mean(accuracies)] if accuracies else []
        for name in WAYS:
            held, undefined, alpha, cra = (measured[name, one] for one in ("held", "undefined", "alpha", "cra"))
            print(
                f"| {law}, {len(seen)} of {len(lives)} lives | {name} | {100.0 * np.mean(held):.1f} | "
                f"{sum(undefined)} of {len(undefined)} | {np.mean(alpha):.2f} | "
                f"{np.mean(cra):.2f} / {np.median(cra):.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
