"""What flights tell of the unit's base parameters, so that it can be taken out of k̂."""

from __future__ import annotations

import numpy as np
import pytest
from support.flights import flights

from ema_model import faults
from ema_model.estimation.problem import to_vector
from ema_model.simulated_lives import WORN_AT, accuracy, base_of, drawn, worn_life
from ema_model.tracking.flights import Unit, growth
from ema_model.tracking.track import Tracker, track

HEALTHY = to_vector(faults.HEALTHY)
ONE_SIDED = np.arange(8) < 5


def told(life, base=2):
    unit = Unit(base, ONE_SIDED, HEALTHY)
    for i, one in enumerate(life):
        unit.add(i + 1.0, one.k, one.own, one.common)
    return unit


def by_command(i):
    """Three commands in turn, in each of which u moves k1 and k3 otherwise."""
    row = np.zeros((8, 2))
    row[0], row[2] = (
        ((0.05, 0.0), (0.0, 0.05), (-0.03, 0.03))[i % 3],
        ((0.02, 0.03), (-0.03, 0.02), (0.0, -0.05))[i % 3],
    )
    return row


@pytest.mark.parametrize("wear", [0.0, 0.002])
@pytest.mark.parametrize("seed", range(3))
def test_commands_tell_what_the_unit_adds_whatever_wears(wear, seed):
    u = np.random.default_rng(seed).standard_normal(2)  # as `flights` draws it
    mean, covariance = told(flights(wear * np.arange(90), 0.005, seed=seed, common=by_command)).known((0,))
    sigma = np.sqrt(np.diag(covariance))
    assert np.all(np.abs(mean - u) < 3.0 * sigma) and np.all(sigma < 0.3)


def test_where_parts_began_tells_it_too():
    """The same in all flights: it stands in k1 and k3 alone, of which one may not be counted."""

    def common(i):
        row = np.zeros((8, 1))
        row[0] = row[2] = 0.2
        return row

    life = flights(np.zeros(30), 0.005, base=1, seed=4, common=common)
    u, unit = np.random.default_rng(4).standard_normal(1), told(life, 1)
    for apart in ((), (0,)):
        mean, covariance = unit.known(apart)
        assert np.abs(mean - u) < 3.0 * np.sqrt(covariance[0, 0]) < 1.2
    assert unit.known((0, 2))[1][0, 0] > 0.9, "nothing else tells of it"


def test_nothing_is_told_where_the_unit_adds_nothing():
    mean, covariance = told(flights(0.003 * np.arange(60))).known()
    np.testing.assert_allclose(mean, 0.0, atol=1e-9)
    assert np.all(np.diag(covariance) >= 1.0)


def test_a_copy_is_left_as_it_is():
    life = flights(np.zeros(40), common=by_command)
    unit = told(life[:20])
    kept = unit.copy()
    before = kept.known()
    unit.replaced(0)
    unit.add(21.0, life[20].k, life[20].own, life[20].common)
    np.testing.assert_array_equal(kept.known()[0], before[0])
    np.testing.assert_array_equal(kept.known()[1], before[1])


@pytest.mark.parametrize("fault", ["k1", "k2", "k3", "k8"])
def test_wear_is_not_taken_for_the_unit(fault):
    """Sensitivities grow with wear, and harder flights have others and wear more."""
    off = []
    place = faults.NAMES.index(fault)
    for seed in range(6):
        life = worn_life("accelerating", seed, 1.0, fault)
        last = (life.repaired or life.flights) - 1
        usable = [one if not one.excluded else None for one in drawn(life)[:last]]
        unit = Unit(15, ONE_SIDED, HEALTHY)
        for i, one in enumerate(usable):
            if one is not None:
                unit.add(i + 1.0, one.k, one.own, one.common)
        mean, covariance = unit.known((place,))
        row = next(one for one in reversed(usable) if one is not None).common[place]
        off.append(row @ (mean - base_of(life, 15)) / np.sqrt(row @ covariance @ row))
    assert np.sqrt(np.mean(np.square(off))) < 1.6


def test_a_replaced_part_is_seen_through_changing_commands():
    """What the unit adds in other commands hid a step of that size, until it was known."""
    k1 = np.concatenate([0.0015 * np.arange(80), 0.0015 * np.arange(40)])
    one = track(flights(k1, 0.005, common=by_command, seed=2), {"k1": 0.4}).faults["k1"]
    assert [jump.flight for jump in one.jumps] == ["f080"]


def test_the_answer_is_the_laws_where_all_is_known():
    """Even wear, nothing that the unit adds, little noise: the way that is left over the rate."""
    one = track(flights(0.002 * np.arange(150), 0.001), {"k1": 0.5}).faults["k1"]
    assert one.remaining_flights is not None
    assert one.remaining_flights.p50 == pytest.approx((0.5 - 0.298) / 0.002, rel=0.05)
    assert 60.0 < one.remaining_flights.p05 < 101.0 < one.remaining_flights.p95 < 125.0


def test_what_the_unit_adds_is_taken_out_of_k():
    life = flights(0.002 * np.arange(100), 0.005, common=by_command, seed=1)
    one, raw = track(life, {"k1": 0.4}).faults["k1"], np.array([flight.k[0] for flight in life])
    true = 0.002 * np.arange(100)
    assert np.std(one.k - true) < 0.5 * np.std(raw - true)
    assert one.level_interval90[0] < 0.198 < one.level_interval90[1] and one.level == pytest.approx(0.198, abs=0.02)


def test_intervals_hold_lives_of_a_few_seeds():
    held = []
    for seed in range(8):
        life = worn_life("linear", seed)
        tracker, last = Tracker({life.fault: life.threshold}, seed), life.flights - 1
        for i, flight in enumerate(drawn(life)):
            tracker.add(flight)
            if i % 15 == 14 and (life.repaired or 0) + 20 < i < last and tracker.has_trend(life.fault):
                left = tracker.look().faults[life.fault].remaining_flights
                held += [left.p05 <= last - i <= left.p95] if left else []
    assert len(held) > 40 and 0.75 <= np.mean(held)


# --- by what a sensitivity to the base parameters grows with the k that it belongs to ---------------------------------


def test_it_grows_as_identifications_of_worn_actuators_have_it():
    """Backlash, of all profiles: identified with the fault, over identified without."""
    k = np.zeros((2, 8))
    k[1, 1] = WORN_AT
    healthy, worn = growth(k)[:, 1]
    found = np.linalg.norm(accuracy().common[[0, 2], :, 1], axis=2)
    assert worn > 20.0 * healthy
    np.testing.assert_allclose(found[1] / found[0], worn / healthy, rtol=0.1)


def test_noise_beyond_the_range_counts_as_its_end():
    np.testing.assert_array_equal(growth(np.full(8, -0.5)), growth(np.zeros(8)))
    np.testing.assert_array_equal(growth(np.full(8, 1.5)), growth(np.ones(8)))
