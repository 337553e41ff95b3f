"""Which orders of an effect are claimed, and what happens to an effect that rested on one that is taken out."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from ema_model.discovery.candidates.harmonics import Further
from ema_model.discovery.refit import Trial
from ema_model.discovery.result import Added, Candidate
from ema_model.discovery.steps import claim, dropped

OUTDONE = "a curve over the motor angle tells more"


def trial(orders: int, drop: float) -> Trial:
    """A refit of so many orders of cogging."""
    effects = {f"cogging_torque_{i}": {"order": 6.0 * (i + 1)} for i in range(orders)}
    candidate = Candidate("cogging_torque", {"order": 6.0}, drop)
    return Trial(candidate, effects, SimpleNamespace(actuator=None), drop)


@pytest.fixture
def of_cogging(monkeypatch):
    """Claims on cogging of one order or of three, where `outdone` counts how many orders a curve outdoes."""
    alone, together = trial(1, 900.0), trial(3, 1500.0)
    monkeypatch.setattr(claim, "_chosen", lambda story, accepted: (alone, []))
    monkeypatch.setattr(claim, "further_orders", lambda *args: Further(True, together))
    asked: list[int] = []

    def ask(steady: bool, outdone: int, left: float = 1.0, then: float = 1.0, unseen: float | None = None):
        """left, then: the error of one order and of three, in floors; unseen: that of three in what was held out."""
        asked.clear()
        held = None if unseen is None else object()
        monkeypatch.setattr(claim, "holdout_error", lambda held, fit: left if fit is alone.fit else unseen)
        monkeypatch.setattr(claim, "ratio", lambda data, fit: left if fit is alone.fit else then)

        def spoken(data, before, after, keys, settled):
            asked.append(1 if after is alone.fit else 3)
            return OUTDONE if asked[-1] <= outdone else ""

        monkeypatch.setattr(claim, "against", spoken)
        current = SimpleNamespace(actuator=SimpleNamespace(leaves_out_reversals=steady))
        story = SimpleNamespace(data=None, held=held, current=current, refused={})
        return claim.claimed(story, [alone], lambda text: None), story.refused, list(asked)

    return ask, alone, together


def test_in_inverse_dynamics_further_orders_count_where_one_alone_is_outdone(of_cogging):
    ask, alone, together = of_cogging
    assert ask(steady=True, outdone=1) == ((alone, [], together), {}, [1, 3])
    assert ask(steady=True, outdone=0) == ((alone, [], None), {}, [1]), "one that is enough needs no more"
    far = {"steady": True, "outdone": 0, "left": 20.0}
    assert ask(**far, then=3.0, unseen=4.0) == ((alone, [], together), {}, [3]), "here one is not enough"
    for then, unseen in ((3.0, None), (3.0, 15.0), (15.0, 4.0)):
        assert ask(**far, then=then, unseen=unseen) == ((alone, [], None), {}, [1]), "what was not fitted must agree"


def test_in_a_closed_loop_all_orders_are_judged_before_one(of_cogging):
    ask, alone, together = of_cogging
    assert ask(steady=False, outdone=1) == ((alone, [], together), {}, [3])


def test_where_a_curve_outdoes_all_orders_nothing_is_claimed(of_cogging):
    ask, _, _ = of_cogging
    for steady in (False, True):
        found, refused, asked = ask(steady, outdone=3)
        assert found is None and refused == {"cogging_torque": OUTDONE} and sorted(asked) == [1, 3]


@dataclass(frozen=True)
class Named:
    """A fit."""

    name: str


@pytest.mark.parametrize(("more", "is_claimed"), [(30.0, False), (24.0, True), (-50.0, True)])
def test_an_effect_by_orders_is_not_claimed_where_another_law_of_them_tells_more(monkeypatch, more, is_claimed):
    """Friction by place, outdone by a curve, and a ripple of the current that imitates it.

    more: evidence by which the friction of two orders tells more than the ripple of one; its second order costs 15.
    """
    friction, ripple = (
        Trial(Candidate(name, {"order": 6.0}, drop), {name: {}}, Named(name), drop)
        for name, drop in (("position_dependent_friction", 900.0), ("torque_ripple", 880.0))
    )
    two = Trial(friction.candidate, {"position_dependent_friction_2": {}}, Named("of two"), 950.0)
    further = {friction.fit: Further(True, two), ripple.fit: Further(True, None)}
    monkeypatch.setattr(claim, "_chosen", lambda story, accepted: (accepted[0], []))
    monkeypatch.setattr(claim, "_further", lambda story, best, tell: further[best.fit])
    monkeypatch.setattr(claim, "price", lambda data, current, trial: 30.0 if trial is two else 15.0)
    told = {("torque_ripple", "of two"): more}
    monkeypatch.setattr(claim, "evidence", lambda data, small, large: told[small.name, large.name])
    monkeypatch.setattr(claim, "against", lambda data, before, after, *rest: "" if after is ripple.fit else OUTDONE)
    current = SimpleNamespace(actuator=SimpleNamespace(leaves_out_reversals=False))
    story = SimpleNamespace(data=None, held=None, current=current, refused={})
    found = claim.claimed(story, [friction, ripple], lambda text: None)
    assert found == ((ripple, [], None) if is_claimed else None)
    told_more = "position-dependent friction, which is not claimed, tells more by such orders"
    refused = {"position_dependent_friction": OUTDONE} | ({} if is_claimed else {"torque_ripple": told_more})
    assert story.refused == refused


class Grown:
    """A model with these effects, that can lose them."""

    def __init__(self, *names: str) -> None:
        self.added = tuple(Added(name, {}, 2.0, 1.0, 2.0, 1.0, (), name) for name in names)
        self.refused: dict[str, str] = {}
        self.data, self.base = SimpleNamespace(), "bare"

    @property
    def current(self) -> str:
        return "with " + " ".join(one.name for one in self.added)

    def without(self, key, tell=None) -> str:
        return "with " + " ".join(one.name for one in self.added if one.key != key)

    def settled(self, found, tell=None):
        return found

    def remove(self, key, found=None) -> None:
        assert found in (None, self.without(key))
        self.added = tuple(one for one in self.added if one.key != key)


BOTH = ["viscous_drift", "hinge_moment"]


@pytest.mark.parametrize(
    "stands, needed, left", [(True, 1.0, BOTH), (False, 1.9, ["viscous_drift"]), (False, 2.1, BOTH)]
)
def test_what_rested_on_an_effect_that_is_taken_out_is_judged_again(monkeypatch, stands, needed, left):
    """Of three effects the second is bent away; the third came after it, the first before.

    needed: times the error that is left without the third.
    """
    story, judged = Grown("viscous_drift", "current_bias", "hinge_moment"), []

    def again(data, before, after, keys, settled):
        judged.append((keys, before, after))
        return "" if stands else "it tells nothing by itself"

    bent = {"current_bias": "its sign turned"}
    monkeypatch.setattr(dropped, "still_against", lambda data, base, current, key: bent.get(key, ""))
    monkeypatch.setattr(dropped, "against", again)
    monkeypatch.setattr(dropped, "ratio", lambda data, found: 1.0 if "hinge_moment" in found else needed)
    dropped.drop_doubtful(story, lambda text: None)
    assert [one.name for one in story.added] == left
    assert judged == [(["hinge_moment"], "with viscous_drift", "with viscous_drift hinge_moment")]
    assert story.refused == bent | ({} if left == BOTH else {"hinge_moment": "it tells nothing by itself"})


@pytest.mark.parametrize(
    "ratio, share, names", [(2.5, 0.96, ["current_sensor_bias"]), (2.5, 0.94, []), (1.5, 0.96, []), (1.5, 0.99, [])]
)
def test_far_above_the_floor_what_tells_as_much_cannot_be_told_apart(monkeypatch, ratio, share, names):
    """share: of what the best effect tells, that another tells; near the floor the evidence alone decides."""
    monkeypatch.setattr(claim, "ratio", lambda data, found: ratio)
    monkeypatch.setattr(claim, "evidence", lambda data, small, large: 15.0)
    monkeypatch.setattr(claim, "price", lambda data, current, trial: 8.0)
    trials = [
        Trial(Candidate(name, {}, drop), {name: {}}, SimpleNamespace(), drop)
        for name, drop in (("asymmetric_friction", 1000.0), ("current_sensor_bias", 1000.0 * share))
    ]
    best, others = claim._chosen(SimpleNamespace(data=None, held=None, current=None), trials)
    assert best is trials[0] and [one.candidate.name for one in others] == names


def test_of_what_cannot_be_told_apart_the_one_that_keeps_parameters_nearer_the_file_is_named_first(monkeypatch):
    monkeypatch.setattr(claim, "ratio", lambda data, found: 1.0)
    monkeypatch.setattr(claim, "evidence", lambda data, small, large: -260.0)
    monkeypatch.setattr(claim, "price", lambda data, current, trial: 8.0)
    trials = [
        Trial(Candidate(name, {}, drop), {name: {}}, SimpleNamespace(), drop)
        for name, drop in (("current_sensor_gain", 950.0), ("computation_delay", 630.0))
    ]
    best, others = claim._chosen(SimpleNamespace(data=None, held=None, current=None), trials)
    assert best is trials[1] and others == [trials[0]]


def test_of_what_tells_as_much_the_one_with_fewer_parameters_is_named_first(monkeypatch):
    """Over a short travel an eccentric sensor, of two parameters, tells as much as a gain does, and a little more."""
    monkeypatch.setattr(claim, "ratio", lambda data, found: 1.0)
    monkeypatch.setattr(claim, "evidence", lambda data, small, large: 3.0)
    monkeypatch.setattr(claim, "price", lambda data, current, trial: 8.0 * (1 + ("eccentric" in trial.candidate.name)))
    trials = [
        Trial(Candidate(name, {}, drop), {name: {}}, SimpleNamespace(), drop)
        for name, drop in (("position_sensor_eccentricity", 953.0), ("position_sensor_gain", 950.0))
    ]
    best, others = claim._chosen(SimpleNamespace(data=None, held=None, current=None), trials)
    assert best is trials[1] and others == [trials[0]]


@pytest.mark.parametrize(
    ("held", "first", "tied"), [(0.97, 1, True), (0.7, 1, False), (1.02, 0, True), (1.3, 0, False)]
)
def test_far_above_the_floor_what_was_not_fitted_tells_apart(monkeypatch, held, first, tied):
    """held: the error that load-dependent friction leaves there, of the one that bus voltage sag leaves."""
    monkeypatch.setattr(claim, "ratio", lambda data, found: 90.0)
    monkeypatch.setattr(claim, "evidence", lambda data, small, large: 5.0)
    left = {"bus_voltage_sag": 135.0, "load_dependent_friction": 135.0 * held}
    monkeypatch.setattr(claim, "holdout_error", lambda held, found: left[found.name])
    trials = [
        Trial(Candidate(name, {}, drop), {name: {}}, SimpleNamespace(name=name), drop)
        for name, drop in (("bus_voltage_sag", 1000.0), ("load_dependent_friction", 750.0))
    ]
    best, rest = claim._chosen(SimpleNamespace(data=None, held=object(), current=None), trials)
    assert best is trials[first]
    assert rest == ([trials[1 - first]] if tied else [])


@pytest.mark.parametrize(
    ("names", "cosine", "is_one"),
    [
        (("saturating_friction", "friction_zone"), 0.88, True),
        (("friction_zone", "quadratic_drag"), 0.88, True),
        (("saturating_friction", "friction_zone"), 0.8, False),
        (("saturating_friction", "quadratic_drag"), 0.95, False),
        (("friction_zone", "hinge_moment"), 0.95, False),
        (("saturating_friction", "cogging_torque"), 0.95, False),
    ],
)
def test_laws_of_place_and_of_speed_are_one_where_they_change_the_same(names, cosine, is_one):
    """cosine: between what the two change of the residual."""
    before = np.array([3.0, -2.0])
    changes = np.array([1.0, 0.0]), 0.7 * np.array([cosine, np.sqrt(1.0 - cosine**2)])
    best, other = (
        Trial(Candidate(name, 100.0, {}), {name: {}}, SimpleNamespace(residual=before + change), 100.0)
        for name, change in zip(names, changes)
    )
    story = SimpleNamespace(current=SimpleNamespace(residual=before))
    assert claim._one_motion(story, best, other) == claim._one_motion(story, other, best) == is_one


@pytest.mark.parametrize(("short_of", "first"), [(3.0, "hinge_moment"), (30.0, "pendulum_load")])
def test_of_an_effect_and_a_term_of_its_series_that_tells_as_much_it_is_the_term(monkeypatch, short_of, first):
    """short_of: evidence by which the spring tells less than the weight of an arm, of which it is a term."""
    monkeypatch.setattr(claim, "ratio", lambda data, found: 1.0)
    monkeypatch.setattr(claim, "evidence", lambda data, small, large: short_of)
    monkeypatch.setattr(claim, "price", lambda data, current, trial: 8.0)
    trials = [
        Trial(Candidate(name, drop, {}), {name: {}}, SimpleNamespace(), drop)
        for name, drop in (("pendulum_load", 1000.0), ("hinge_moment", 1000.0 - short_of))
    ]
    best, others = claim._chosen(SimpleNamespace(data=None, held=None, current=None), trials)
    assert best.candidate.name == first and len(others) == (short_of < 10.0)
    assert claim.of_other_parts(trials[1], trials[:1]) == [], "the series is no other cause than its term"
    assert claim.without_series(trials) == trials[1:]
