"""Lives that are made: their laws, what is common to a unit's flights, and both forms of the same life."""

from __future__ import annotations

import numpy as np
import pytest
from support.studied import studied

from ema_model import faults
from ema_model.actuator import load_actuator
from ema_model.errors import InputError
from ema_model.estimation.problem import to_vector
from ema_model.identification.fit import refine, setting
from ema_model.identification.search import Objective
from ema_model.identification.uncertainty import uncertainty
from ema_model.simulated_lives import LAWS, base_of, drawn, healthy_life, recorded, unit_of, worn_life


def worn_k(life):
    return life.k[:, faults.NAMES.index(life.fault)]


@pytest.mark.parametrize("law", LAWS)
def test_a_life_ends_in_the_flight_that_crosses(law):
    repaired = lengths = 0
    for seed in range(40):
        life = worn_life(law, seed)
        healthy = faults.BY_NAME[life.fault].healthy
        share = (worn_k(life) - healthy) / (life.threshold - healthy)
        assert share[-1] >= 1.0 and np.all(share[:-1] < 1.0)
        jumps = np.flatnonzero(np.diff(share) < 0.0) + 1
        assert list(jumps) == ([] if life.repaired is None else [life.repaired])
        repaired += life.repaired is not None
        lengths += life.flights
        steps = np.diff(share[life.repaired or 0 :])
        still = steps[: max(0, life.onset - (life.repaired or 0) - 1)]
        assert np.all(still == 0.0) and (law == "onset") == bool(len(still))
        assert 0.85 < life.usable.mean() <= 1.0
    assert 3 <= repaired <= 20 and 150 < lengths / 40 < 350


def test_wear_varies_as_asked_and_by_law():
    severities = np.concatenate([worn_life("linear", seed, 1.0).severity for seed in range(20)])
    assert severities.std() / severities.mean() == pytest.approx(1.0, abs=0.05)
    late = []
    for law in ("linear", "accelerating"):
        steps = [np.diff(worn_k(life)[life.repaired or 0 :]) for life in (worn_life(law, s) for s in range(30))]
        late.append(np.mean([np.abs(s[-20:]).mean() / np.abs(s).mean() for s in steps]))
    assert late[0] == pytest.approx(1.0, abs=0.15) and late[1] > 1.3


def test_no_such_law():
    with pytest.raises(InputError, match="no wear law 'cubic'; there are linear"):
        worn_life("cubic", 0)


def test_drawn_flights_share_what_is_the_units():
    """Of a healthy unit k̂ − common · u is noise of the covariance that is stated, flight by flight."""
    own, units = [], []
    for seed in range(20):
        life = healthy_life(seed, 60)
        flights = drawn(life)
        kept = [one for one in flights if not one.excluded]
        assert [one.name for one in flights] == sorted(one.name for one in flights)
        assert len(kept) == life.usable.sum()
        u = base_of(life, kept[0].common.shape[1])
        own += [(one.k - to_vector(faults.HEALTHY) - one.common @ u) / np.sqrt(np.diag(one.own)) for one in kept]
        units.append(np.mean([one.k[0] for one in kept]))
    np.testing.assert_allclose(np.std(own, axis=0), 1.0, atol=0.1)
    assert np.std(units) > 0.02, "units differ by far more than flights do"


def test_a_recorded_flight_is_told_as_drawn_ones_are():
    """What an identification of the recording says is in the parts that the drawn form takes."""
    actuator, life = load_actuator(), worn_life("linear", 3, fault="k1")
    number = next(i for i in range(10, 30) if life.usable[i])
    (name, recording), *none = recorded(life, actuator, range(number, number + 1))
    assert name == f"flight_{number + 1:04d}" and not none
    assert unit_of(life, actuator).motor.inertia_kgm2 != actuator.motor.inertia_kgm2
    sure = uncertainty(
        found := refine(setting(Objective([recording], actuator), parameters_known=False), life.k[number]), found.k
    )
    assert sure.adequate
    np.testing.assert_allclose(sure.own + sure.common @ sure.common.T, sure.covariance, atol=1e-6)
    like = drawn(life)[number]
    for given in (sure, like):
        assert 1e-3 < np.sqrt(given.own[0, 0]) < 0.1
        assert np.linalg.norm(given.common[0]) > np.sqrt(given.own[0, 0]), "the unit's part is the larger"
    total = np.sqrt(np.diag(sure.covariance))
    assert abs(sure.unbounded[0] - life.k[number, 0]) < 4.0 * total[0]


# --- the study of lives, assets/plans/lives.toml: no false trends, and intervals that hold the life that remains ------


@pytest.mark.study
@pytest.mark.parametrize("law", LAWS)
def test_intervals_hold_the_remaining_life(law):
    rows = studied("lives")[law]
    held = [low <= true <= high for row in rows for true, low, high in zip(row["true"], row["p05"], row["p95"])]
    assert len(held) > 4 * len(rows), "most lives are told before they end"
    assert 0.85 <= np.mean(held) <= 0.95


@pytest.mark.study
def test_a_healthy_life_has_no_trend():
    rows = studied("lives")["healthy"]
    assert sum(bool(row["trends"]) for row in rows) <= max(1, 0.01 * len(rows))
