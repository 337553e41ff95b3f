"""What was known after each flight, and what came then."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.flights import flights

from ema_model.errors import InputError
from ema_model.tracking.track import Came, History, headline, hindsight, track
from ema_model.tracking.trends import LEAST_FLIGHTS
from emaviz.views import tracking

ALL = flights(0.004 * np.arange(120))
AT = 0.4  # k1, which is there after flight 100 or so


@pytest.fixture(scope="module")
def history():
    found = History({"k1": AT})
    assert [*found.follow(ALL)][-1] == len(ALL)
    return found


def test_a_look_is_what_was_known_that_day(history):
    assert [*history.looks] == [*range(LEAST_FLIGHTS, len(ALL) + 1)]
    then, alone = history.looks[60], track(ALL[:60], {"k1": AT})
    assert (
        str(then) == str(alone) and then.faults["k1"].remaining_flights.p50 == alone.faults["k1"].remaining_flights.p50
    )
    assert history.last is history.looks[len(ALL)]


def test_flights_that_arrive_cost_their_own_looks_alone(history):
    growing = History({"k1": AT})
    assert [*growing.follow(ALL[:100])][-1] == 100
    before = growing.looks[50]
    assert [*growing.follow(ALL)] == [*range(101, 121)]
    assert growing.looks[50] is before and str(growing.last) == str(history.last)
    assert [*growing.follow([replace(ALL[0], name="other"), *ALL[1:20]])][-1] == 20
    assert max(growing.looks) == 20 and growing.looks[20].flights[0].name == "other"


def test_what_came_stands_beside_what_was_said(history):
    crossed = history.crossed("k1")
    assert crossed == pytest.approx(101, abs=4)
    assert history.came(60, "k1") == Came(crossed - 60, 60) and history.came(110, "k1") == Came(None, 10)
    then = history.looks[60].faults["k1"]
    assert hindsight(then, history.came(60, "k1")).endswith(f"{crossed - 60} flights later, within the 90 % interval")
    assert hindsight(then, Came(5, 60)).endswith("5 flights later, before the 90 % interval")
    assert hindsight(then, Came(100, 100)).endswith("100 flights later, after the 90 % interval")
    assert hindsight(then, Came(None, 1)) == "what came: not so far, 1 flight later"
    assert "longer than the 90 % interval" in hindsight(then, Came(None, 100))
    assert hindsight(then, Came(None, 0)) == "" and hindsight(history.looks[60].faults["k2"], Came(None, 9)) == ""
    assert headline(history.looks[60]).startswith("k1 friction drifts")
    assert headline(history.last).endswith(f"and has reached {AT:g}"), "no flights are left"
    assert headline(history.looks[8]).startswith("No trend")


def test_before_there_are_enough_there_is_no_look():
    few = History()
    assert [*few.follow(ALL[: LEAST_FLIGHTS - 1])] and few.last is None and few.crossed("k1") is None
    with pytest.raises(InputError, match="no such fault"):
        History({"k9": 0.1})


@pytest.mark.parametrize("far", [1.0, 50.0])
def test_the_band_of_the_predicted_life_stays_within_its_axis(history, far):
    said = {
        n: look.faults["k1"].remaining_flights
        for n, look in history.looks.items()
        if look.faults["k1"].remaining_flights
    }
    first = min(said)
    look, one = history.looks[first], history.looks[first].faults["k1"]
    left = replace(said[first], p95=far * sorted(left.p95 for left in said.values())[len(said) // 2])
    odd = History(history.thresholds)
    odd.looks = history.looks | {
        first: replace(look, faults={**look.faults, "k1": replace(one, remaining_flights=left)})
    }
    odd.flights = history.flights
    figure = tracking.predicted_life(odd, "k1", 100)
    low, high = figure.layout.yaxis.range
    assert all(low <= value <= high for trace in figure.data for value in trace.y if value is not None)
    cut = any("are cut" in one.text for one in figure.layout.annotations)
    assert cut or far < 50.0, "one that says little does not press the others flat"
