"""What is said of the flights of a unit: trends, jumps, remaining life, and nothing where there is nothing."""

from __future__ import annotations

import re

import numpy as np
import pytest
from support.flights import flights

from ema_model.errors import InputError
from ema_model.simulated_lives import drawn, healthy_life, worn_life
from ema_model.tracking.flights import Flight
from ema_model.tracking.track import Tracker, track


def test_a_steady_drift_is_told_with_the_life_that_remains():
    result = track(flights(0.002 * np.arange(100)), {"k1": 0.4})
    one = result.faults["k1"]
    assert one.trend and one.drift == pytest.approx(0.002, rel=0.15) and one.level == pytest.approx(0.2, abs=0.02)
    left = one.remaining_flights
    assert left is not None and left.p05 < 100 < left.p95 and left.p50 == pytest.approx(100, rel=0.3)
    chances = [soon.probability for soon in left.crossing]
    assert chances == sorted(chances) and chances[0] < 0.01 and chances[-1] > 0.9
    others = [name for name, other in result.faults.items() if other.trend]
    assert others == ["k1"] and "k1 friction drifts" in str(result)
    assert "None" not in str(result) and "None" not in result._repr_html_(), "of k1 there is no reason to say"
    document = result.to_dict()["faults"]["k1"]
    assert document["remaining_flights"]["p05"] == left.p05 and document["trend"] is True


def test_without_evidence_there_is_no_trend_and_no_life():
    result = track(flights(np.full(120, 0.2)), {"k1": 0.4})
    one = result.faults["k1"]
    assert not one.trend and one.remaining_flights is None and one.reason == "no trend; remaining life not defined"
    assert one.level == pytest.approx(0.2, abs=0.01) and "no trend" in str(result)


def test_what_the_unit_adds_moves_no_trend():
    """Commands change from flight 60 on, and with them what the base parameters add to k1."""

    def common(i):
        row = np.zeros((8, 2))
        row[0] = (0.05, 0.0) if i < 60 else (0.0, 0.05)
        return row

    assert not track(flights(np.zeros(120), common=common, seed=3)).faults["k1"].trend
    blind = [
        Flight(one.name, one.k, one.own, np.zeros((8, 2))) for one in flights(np.zeros(120), common=common, seed=3)
    ]
    seen = track(blind).faults["k1"]
    assert seen.trend or seen.jumps, "not told, it would be taken for one"


@pytest.mark.parametrize("seed", range(4))
def test_sensitivities_that_grow_with_the_command_move_no_trend(seed):
    """Harder commands over the life: k̂ rises with what the unit adds, while nothing wears."""

    def common(i):
        row = np.zeros((8, 2))
        row[0], row[1] = (0.02 + 0.04 * i / 119, 0.004 * (i % 3)), (0.0002 + 0.0004 * i / 119, 0.0)
        return row

    life = flights(np.zeros(120), sigma=0.003, seed=seed, common=common)
    assert not any(one.trend for one in track(life).faults.values())


@pytest.mark.parametrize(("law", "seed"), [("accelerating", 7), ("onset", 3), ("onset", 5)])
def test_backlash_is_told_though_its_sensitivity_grows_with_it(law, seed):
    """A play that is 15 % off adds to k2 in proportion to it; a unit that is 7 σ off is no reason for all its wear."""
    life = worn_life(law, seed, fault="k2")
    begin = life.repaired or 0
    onset, end = max(life.onset, begin), life.flights
    tracker, first = Tracker({"k2": life.threshold}), end
    for i, flight in enumerate(drawn(life)):
        tracker.add(flight)
        if i >= begin + 5 and first == end and tracker.has_trend("k2"):
            first = i
    assert onset - 1 <= first < onset + 0.2 * (end - onset)


def test_a_replaced_part_is_seen_and_judged_anew():
    k1 = np.concatenate([0.003 * np.arange(80), 0.003 * np.arange(60)])
    result = track(flights(k1), {"k1": 0.4})
    one = result.faults["k1"]
    assert [(jump.flight, jump.replaced) for jump in one.jumps] == [("f080", True)]
    assert one.trend and one.remaining_flights is not None
    assert one.remaining_flights.p05 < (0.4 - k1[-1]) / 0.003 < one.remaining_flights.p95
    after = track(flights(k1)[:84], {"k1": 0.4}).faults["k1"]
    assert not after.trend and after.level < 0.05


def test_a_small_step_back_is_seen_once_more_flights_follow():
    """Three flights on either side seldom tell a step of seven times the noise, six do; and none is where none was."""
    soon, later = [], []
    for seed in range(8):
        k1 = np.concatenate([np.full(50, 0.105), np.zeros(30)])
        life = flights(k1, sigma=0.015, seed=seed)
        soon += track(life[:53]).faults["k1"].jumps
        later += track(life[:57]).faults["k1"].jumps
        assert not track(flights(np.full(57, 0.105), sigma=0.015, seed=seed)).faults["k1"].jumps
    assert len(soon) < 4 and len(later) > 5
    assert all(one.flight in ("f049", "f050", "f051") and one.replaced for one in later)
    assert np.mean([one.before - one.after for one in later]) == pytest.approx(0.105, abs=0.02)


def test_a_jump_is_told_without_what_the_unit_adds():
    """Measured, k4 stood below 0 before its part was replaced, and as far above it in truth."""
    life = worn_life("onset", 63001, 0.5)
    seen = track(drawn(life)[:130]).faults["k4"]
    (one,) = seen.jumps
    assert life.repaired == 103 and one.flight == "flight_0103"
    assert one.replaced and one.before > 0.06 and abs(one.after) < 0.03 and not seen.trend


def test_a_drift_that_may_be_none_has_no_end_but_a_least_life():
    """After 64 of its flights this life's drift may be as good as none: no middle of what remains is told."""
    life = worn_life("onset", 63025, 1.0)
    tracker = Tracker({life.fault: life.threshold}, life.seed)
    for flight in drawn(life)[:254]:
        tracker.add(flight)
    one = tracker.look().faults[life.fault]
    assert one.trend and one.remaining_flights is None
    least = int(
        re.fullmatch(r"more than (\d+) flights remain \(95 %\); it may never reach its threshold", one.reason)[1]
    )
    assert 10 < least < 1000


def test_flights_that_do_not_fit_are_left_out_and_many_of_them_end_the_trust():
    life = flights(0.003 * np.arange(80))
    bad = [Flight(one.name, np.full(8, 9.0), one.own, one.common, "does not fit") for one in life]
    some = [bad[i] if i % 7 == 3 else one for i, one in enumerate(life)]
    result = track(some, {"k1": 0.5})
    assert result.trusted and result.faults["k1"].trend and len(result.usable) == 80 - 11
    assert "left out: f003" in str(result)
    lost = track([*life[:72], *bad[72:]], {"k1": 0.5})
    assert not lost.trusted and lost.faults["k1"].remaining_flights is None and "Discover" in lost.warnings[0]


def test_noise_larger_than_stated_is_seen():
    life = flights(np.zeros(200), sigma=0.02)
    brave = [Flight(one.name, one.k, one.own / 16.0, one.common) for one in life]
    assert not any(one.trend for one in track(brave).faults.values())


def test_a_gain_may_drift_to_either_side():
    for sign in (-1.0, 1.0):
        life = []
        for i, one in enumerate(flights(np.zeros(80))):
            k = one.k.copy()
            k[7] += sign * 0.002 * i
            life.append(Flight(one.name, k, one.own, one.common))
        here, away = (track(life, {"k8": 0.5 + side * sign * 0.3}).faults["k8"] for side in (1.0, -1.0))
        assert here.trend and here.remaining_flights is not None and here.drift == pytest.approx(sign * 0.002, rel=0.2)
        assert away.trend and away.remaining_flights is None and "away" in away.reason


@pytest.mark.parametrize("law", ["linear", "accelerating", "onset"])
def test_drawn_lives_are_told_before_they_end(law):
    life = worn_life(law, 7)
    tracker, told = Tracker({life.fault: life.threshold}), []
    for i, flight in enumerate(drawn(life)):
        tracker.add(flight)
        if i % 40 == 39 and tracker.has_trend(life.fault):
            told.append(tracker.look().faults[life.fault].remaining_flights)
    assert told and any(one is not None for one in told)


def test_healthy_lives_have_no_trend():
    for seed in range(6):
        assert not any(one.trend or one.jumps for one in track(drawn(healthy_life(seed, 150))).faults.values())


@pytest.mark.parametrize(
    ("thresholds", "words"),
    [
        ({"k9": 0.1}, "no such fault"),
        ({"k7": 0.1}, "direction of k6"),
        ({"k1": 0.0}, "healthy"),
        ({"k1": 2.0}, "0 … 1"),
    ],
)
def test_impossible_thresholds(thresholds, words):
    with pytest.raises(InputError, match=words):
        Tracker(thresholds)


def test_too_few_flights():
    with pytest.raises(InputError, match="1 of 1 flights"):
        track(flights([0.0]))
