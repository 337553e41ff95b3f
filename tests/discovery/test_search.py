"""The search by one evidence: its algebra, and that it names what is hidden and nothing else."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.hidden_effects import ACTUATOR, SINE, recorded

from ema_model.discovery import discover, rounds, search, words
from ema_model.discovery.evidence import Unknowns, evidence_of, gains_of
from ema_model.discovery.history import Step, Story
from ema_model.discovery.refit import Trial
from ema_model.discovery.result import Added, Candidate, effect_title
from ema_model.discovery.terms import Evident
from ema_model.estimation.noise import PIECE, NoiseModel
from ema_model.quantities import in_sentence

_COUNT = 6 * PIECE


def _unknowns(columns, sigma=1.0, low=-np.inf, high=np.inf, mean=0.0):
    return Unknowns(columns, *(np.full(columns.shape[1], float(one)) for one in (mean, sigma, low, high)))


@pytest.fixture
def made():
    """The noise model, white noise, the model's own columns and those of two Terms, all as coefficients."""
    rng = np.random.default_rng(7)
    noise = NoiseModel.of([("current_A", slice(0, _COUNT))])
    time = np.linspace(0.0, 1.0, _COUNT)
    own = noise.coefficients(np.stack([np.ones(_COUNT), np.sign(np.sin(9.0 * time))], axis=1))
    terms = [noise.coefficients(np.sin(w * time)[:, None]) for w in (60.0, 140.0)]
    return noise, noise.coefficients(rng.standard_normal(_COUNT)), own, terms


def test_a_term_that_is_there_makes_the_recordings_more_probable_and_its_amount_is_found(made):
    noise, white, own, (term, other) = made
    residual = white - 1.5 * term[:, 0] + 0.7 * own[:, 1]
    plain = evidence_of(noise, residual, _unknowns(own))
    there = evidence_of(noise, residual, _unknowns(own).beside([_unknowns(term, 5.0)]))
    absent = evidence_of(noise, residual, _unknowns(own).beside([_unknowns(other, 5.0)]))
    assert there.log - plain.log > 60.0
    assert there.amounts[-1] == pytest.approx(1.5, abs=0.15)
    assert there.amounts[1] == pytest.approx(-0.7, abs=0.15)
    assert absent.log < plain.log + 2.0


def test_a_term_that_is_not_there_costs_what_is_known_of_it_beforehand(made):
    noise, white, own, (term, _) = made
    plain = evidence_of(noise, white, _unknowns(own)).log
    costs = [plain - evidence_of(noise, white, _unknowns(own).beside([_unknowns(term, s)])).log for s in (1.0, 10.0)]
    assert 1.0 < costs[0] < costs[1]
    assert costs[1] - costs[0] == pytest.approx(np.log(10.0), abs=0.2)  # ten times as much room, a tenth as probable


def test_two_terms_of_the_same_columns_are_as_probable(made):
    noise, white, own, (term, _) = made
    residual = white - 1.5 * term[:, 0]
    one, other = (
        evidence_of(noise, residual, _unknowns(own).beside([_unknowns(scale * term, 5.0 / abs(scale))])).log
        for scale in (1.0, -3.0)
    )
    assert one == pytest.approx(other, abs=1e-3)


def test_an_amount_keeps_to_its_bounds_and_then_tells_nothing(made):
    noise, white, own, (term, _) = made
    residual = white + 1.5 * term[:, 0]  # it would have to be negative
    plain = evidence_of(noise, residual, _unknowns(own)).log
    found = evidence_of(noise, residual, _unknowns(own).beside([_unknowns(term, 5.0, low=0.0)]))
    assert found.amounts[-1] == 0.0
    assert found.log < plain


def test_gains_by_one_step_have_the_order_of_the_whole(made):
    noise, white, own, (term, other) = made
    residual = white - 0.2 * term[:, 0]
    plain = evidence_of(noise, residual, _unknowns(own))
    its = [_unknowns(one, 5.0) for one in (term, other)]
    gains = gains_of(noise, plain, _unknowns(own), its)
    whole = [evidence_of(noise, residual, _unknowns(own).beside([one])).log - plain.log for one in its]
    assert 0.4 * whole[0] < gains[0] < whole[0] + 1.0
    assert gains[1] == pytest.approx(whole[1], abs=1.5)
    assert gains[1] < 0.0 < gains[0]


def test_unknowns_can_be_left_out(made):
    _, _, own, (term, other) = made
    whole = _unknowns(own).beside([_unknowns(term, 2.0), _unknowns(other, 3.0)])
    left = whole.without([1, 2])
    assert left.sigma.tolist() == [1.0, 3.0]
    assert np.array_equal(left.columns, np.hstack([own[:, :1], other]))


# --- discoveries by it, of recordings that the three-phase model made -------------------------------------------------

AMONG = ("cogging_torque", "constant_load", "current_sensor_bias", "stribeck_friction", "torque_ripple")
COMMANDS = [("chirp", {}, 0.5), SINE]


def _found(effects, among=AMONG):
    held = recorded(41, commands=[("sine", {"amplitude_rad": 0.02, "frequency_Hz": 5}, 0.5)], effects=effects)
    fitted = recorded(41, commands=COMMANDS, effects=effects)
    return discover(fitted, ACTUATOR, holdout=held, candidates=among)


def test_a_hidden_effect_is_named_with_how_probable_it_is():
    found = _found({"cogging_torque": {"amplitude_Nm": 0.012, "phase_rad": 0.7}}, among=AMONG[::4])
    assert found.verdict == "effects_found" and [one.name for one in found.effects] == ["cogging_torque"]
    assert found.effects[0].probability == pytest.approx(1.0, abs=0.01)
    assert found.effects[0].parameters["amplitude_Nm"].value == pytest.approx(0.012, rel=0.1)
    assert found.effects[0].chosen["order"] == 12.0 and found.ladder[-1].rmse < 1.1
    document = found.to_dict()
    assert document["effects"][0]["probability"] == found.effects[0].probability
    probable = [one["probability"] for one in document["candidates"]]
    assert probable == sorted(probable, reverse=True) and sum(probable) < 1.0 + 1e-9
    assert "That cogging torque is missing is > 99.9 % probable." in str(found)


@pytest.mark.parametrize(
    ("against", "is_within", "added", "refitted"),
    [
        ("", False, (), [("next", 12.0), ("best", -1.0)]),
        ("next", False, (), [("next", 12.0), ("third", 3.0), ("best", -1.0)]),
        ("", True, (), [("next", 12.0), ("best", -1.0)]),
        ("", True, (SimpleNamespace(name="an effect"),), []),
    ],
    ids=["nothing speaks against them", "something does against one", "a bare model", "nothing is left to be told"],
)
def test_what_promises_more_than_the_refitted_is_refitted_too(monkeypatch, against, is_within, added, refitted):
    """What looks best by algebra, and is nothing once refitted, hides no other; nor does what cannot be."""
    gains = {"best": 25.0, "next": 14.0, "third": 4.0, "hopeless": 1.0}
    terms = [
        SimpleNamespace(
            term=SimpleNamespace(fingerprint=object(), log_share=0.0), gain=g, candidate=SimpleNamespace(name=n)
        )
        for n, g in gains.items()
    ]
    real = {"best": -1.0, "next": 12.0, "third": 3.0}
    current = SimpleNamespace(faults=())
    of = search.Search(SimpleNamespace(added=added, data=None, held=None, current=current, refused={}))
    before = Evident(0.0, 0.0, 0.0)
    seen = rounds.Round(None, None, before, (), terms)
    monkeypatch.setattr(of, "_round", lambda: seen)
    monkeypatch.setattr(of, "_is_far", lambda: False)
    monkeypatch.setattr(
        search,
        "fits",
        lambda job, chosen, tell: [
            SimpleNamespace(fit=one.candidate.name, candidate=one.candidate, faults=("k1",)) for one in chosen
        ],
    )
    monkeypatch.setattr(rounds, "evidence_of_fit", lambda data, held, fit, noise: Evident(real[fit], 0.0, 0.0))
    monkeypatch.setattr(search, "within_band", lambda data, found: is_within)
    monkeypatch.setattr(of, "_spoken_against", lambda one: "it is none" if one.trial.fit == against else "")
    assert [(one.trial.fit, one.gain) for one in of._contenders()] == refitted


@pytest.mark.parametrize(("falls_to", "kept"), [(2.0, True), (2.999, False)])
def test_an_effect_whose_error_does_not_fall_in_the_end_is_taken_back_and_not_tried_again(monkeypatch, falls_to, kept):
    """Of a rough fit it did; a verdict says no more than its ladder."""
    story = SimpleNamespace(refused={}, added=(), data=None, held=None, current=None, ties=[])
    story.ladder = [SimpleNamespace(rmse=3.0)]

    def add(trial, ties):
        story.added = (SimpleNamespace(name=trial.candidate.name, key=trial.candidate.name),)
        story.ladder.append(SimpleNamespace(rmse=falls_to))

    def back_to_before(key):
        story.added, story.ladder = (), story.ladder[:1]

    story.add, story.back_to_before = add, back_to_before
    story.finish, story.set_probability = lambda tell: None, lambda key, probability: None
    of = search.Search(story)
    trial = Trial(Candidate("friction_zone", 1.0, {}), {"friction_zone": {}}, SimpleNamespace(), 1.0)
    monkeypatch.setattr(of, "_round", lambda: rounds.Round(None, None, Evident(0.0, 0.0, 0.0), (), []))
    known = [search.Contender(trial, 500.0, 500.0, 500.0)]
    monkeypatch.setattr(of, "_contenders", lambda: [one for one in known if one.trial.candidate.name not in of._barred])
    monkeypatch.setattr(of, "_spoken_against", lambda one: "")
    monkeypatch.setattr(of, "_turned_back", lambda contenders: False)
    monkeypatch.setattr(search, "within_band", lambda data, found: False)
    of.step()
    if not kept:
        assert of._going and story.refused == {"friction_zone": "the error does not fall with it"}
        of.step()
        assert not of._going
    assert bool(story.added) == kept


# --- alternatives: what took as much of the error, beside a large rest ------------------------------------------------


@pytest.mark.parametrize(
    ("gains", "is_within", "same_as"),
    [
        ({"b": -9.0}, False, ["a"]),
        ({"b": 3.0}, False, ["a", "b"]),
        ({"b": -9.0, "c": 2.0}, False, ["a", "c"]),
        ({"b": 3.0, "c": 2.0, "d": 0.0}, False, []),
        ({"b": 3.0, "c": 2.0, "d": 0.0}, True, ["a", "b", "c"]),
        ({"b": None}, True, ["a"]),
    ],
    ids=[
        "led to less",
        "as far",
        "one of two",
        "one more than a group holds",
        "the floor is reached",
        "is in the model",
    ],
)
def test_what_leads_as_far_is_as_good_a_name(monkeypatch, gains, is_within, same_as):
    """By the logarithm of how much more probable the model is that an alternative ends at; two are followed at most."""
    added = SimpleNamespace(key="a", name="a", same_as=[])
    story = SimpleNamespace(added=[added], named=["a"], data=None, held=None, current=None, refused={})
    story.tie = lambda key, name, equal: added.same_as.append(name)
    story.back_to_before = lambda key: story.added.clear()
    monkeypatch.setattr(search, "within_band", lambda data, found: is_within)
    of = search.Search(story)
    of._alternatives = [
        search.Alternative(None, "a", Trial(Candidate(name, 1.0, {}), {}, SimpleNamespace(chi2=place), 1.0))
        for place, name in enumerate(gains)
    ]
    monkeypatch.setattr(of, "_follow", lambda one: gains[one.trial.candidate.name])
    of._follow_alternatives()
    named = [one.name for one in story.added]
    assert sorted({*named, *added.same_as}) == same_as if named else same_as == []
    assert bool(named) or story.refused == {"a": "3 others tell as much"}


@pytest.mark.parametrize(("best", "other", "told"), [(1.0, 9.0, np.inf), (10.0, 11.0, 1.95), (10.0, 10.0, 0.0)])
def test_what_is_left_beyond_the_floor_counts_as_a_few_values(monkeypatch, best, other, told):
    """However long the recordings are: 20 a recording, of which one model takes a tenth more than another."""
    monkeypatch.setattr(search, "told_ratio", lambda data, found: found)
    data = SimpleNamespace(floor_spread=0.05, measurements=["one"])
    assert search._shapes_between(data, None, other, best) == pytest.approx(told, rel=0.05)


def test_how_probable_one_order_is_says_nothing_of_another():
    """Both have the effect's name; a fault has none among the effects."""
    first, second = (
        Added("cogging_torque", {}, 3.0, 2.0, None, None, (), key, probability=0.999)
        for key in ("cogging_torque", "cogging_torque_2")
    )
    story = Story(None, None, [Step(None, None, (first, second))])
    story.set_probability("cogging_torque_2", 0.5)
    story.set_probability("k2", 0.1)
    assert [one.probability for one in story.added] == [0.999, 0.5]


# --- whether a closed loop is searched, and what stays of its rivals --------------------------------------------------

DELAY, COGGING = Candidate("computation_delay", 550.0, {}), Candidate("cogging_torque", 600.0, {})


@pytest.mark.parametrize(
    ("ranked", "given", "untold", "suspected"),
    [
        ([DELAY, COGGING], {}, True, True),
        ([COGGING, DELAY], {}, True, False),
        ([Candidate("dead_band", 900.0, {})], {}, False, True),
        ([DELAY], {"floors": 1.5}, False, False),
        ([DELAY], {"simulates": False}, False, False),
        ([DELAY, Candidate("k2", 900.0, {"k2": 0.2})], {}, False, True),
    ],
    ids=["a little of several", "an effect first", "one thing tells it well", "near", "without a loop", "a fault"],
)
def test_a_far_loop_is_untold_and_its_drive_suspected_where_that_tells_a_little(
    monkeypatch, ranked, given, untold, suspected
):
    """A model that stands so many floors off, with these candidates, the most probable first, for a χ² of 1000."""
    floors, simulates = given.get("floors", 50.0), given.get("simulates", True)
    monkeypatch.setattr(search, "ratio", lambda data, found: floors)
    current = SimpleNamespace(chi2=1000.0, plant=SimpleNamespace(simulates_commands=simulates))
    of = search.Search(SimpleNamespace(data=None, current=current))
    monkeypatch.setattr(of, "_round", lambda: SimpleNamespace(best=[SimpleNamespace(candidate=one) for one in ranked]))
    assert of.is_untold() is untold and of.suspects_drive() is suspected


@pytest.mark.parametrize(
    ("added", "alike"),
    [
        ([("pendulum_load", ("hinge_moment",))], ["pendulum_load", "hinge_moment"]),
        ([("pendulum_load", ("hinge_moment", "friction_zone"))], ["pendulum_load", "hinge_moment", "friction_zone"]),
        ([("pendulum_load", ())], []),
        ([("inertia_error", ())], []),
        ([], []),
    ],
    ids=["one", "both", "told apart since", "replaced", "taken out"],
)
def test_a_test_is_sought_only_for_rivals_of_the_last_model(added, alike):
    story = SimpleNamespace(added=[SimpleNamespace(name=name, same_as=same) for name, same in added])
    rivals = [
        Trial(Candidate(name, 1.0, {}), {}, SimpleNamespace(), 1.0)
        for name in ("pendulum_load", "hinge_moment", "friction_zone")
    ]
    assert [one.candidate.name for one in search._still_alike(story, rivals)] == alike
    assert search._still_alike(story, []) == []


# --- discoveries of recordings that the three-phase model made --------------------------------------------------------


@pytest.mark.long
def test_nothing_is_named_where_nothing_is_hidden():
    found = _found(None)
    assert found.verdict == "adequate" and not found.effects
    assert all(one.probability < 0.5 for one in found.candidates)


@pytest.mark.long
def test_what_cannot_be_told_apart_is_one_group():
    found = _found({"constant_load": {"torque_Nm": 3.0}})
    assert {found.effects[0].name, *found.effects[0].same_as} == {"constant_load", "current_sensor_bias"}
    assert found.effects[0].probability > 0.99
    shown = {one.name: one.probability for one in found.candidates}
    assert shown["constant_load"] == shown["current_sensor_bias"] == found.effects[0].probability
    table = words.candidates(found)
    assert table.rows[0][0] != table.rows[1][0] and table.rows[0][-1] == table.rows[1][-1] == "> 99.9 %"
    assert table.remarks[:2] == ["", f"or {in_sentence(effect_title(found.effects[0].name))}: not told apart"]


@pytest.mark.long
def test_two_effects_are_added_one_after_the_other():
    hidden = {"cogging_torque": {"amplitude_Nm": 0.012, "phase_rad": 0.7}, "stribeck_friction": {"speed_rad_s": 10.0}}
    found = _found(hidden)
    assert {one.name for one in found.effects} == {*hidden}
    assert found.ladder[-1].rmse < 1.1 and found.ladder[-1].holdout_rmse < 1.1


@pytest.mark.long
@pytest.mark.parametrize(
    ("hidden", "settings", "false"),
    [
        # held out in mid motion, from a log that is late: a command that stood still before it began with a jump
        ("acceleration_feedforward", {"inertia_kgm2": 8e-6}, "current_sensor_gain"),
        # thousands of floors off, where the model's own floor is another one
        ("goal_delay", {"delay_s": 0.004}, "stribeck_friction"),
    ],
)
def test_no_second_effect_is_named_beside_one_of_the_drive(hidden, settings, false):
    found = _found({hidden: settings}, among=(hidden, false))
    assert [one.name for one in found.effects] == [hidden] and not found.faults
    assert found.ladder[-1].rmse < 1.1 and found.ladder[-1].holdout_rmse < 1.2


@pytest.mark.parametrize(
    ("left", "recordings", "stays"),
    [(16.0, 2, False), (16.0, 60, True), (1.5, 2, True), (1.0, 1, True)],
    ids=["5 % of a large rest", "the same of sixty recordings", "ten times what is left", "what is left is the floor"],
)
def test_an_effect_that_tells_little_beside_what_is_left_is_taken_back(monkeypatch, left, recordings, stays):
    """However long it was recorded: what a model lacks is no noise that is drawn anew with each sample."""
    one = SimpleNamespace(
        name="cogging_torque", rmse_before=16.4, rmse_after=16.0, holdout_before=None, holdout_after=None
    )
    if left < 2.0:
        one.rmse_before, one.rmse_after = 5.0, left
    data = SimpleNamespace(measurements=[None] * recordings, floor_spread=0.03)
    story = SimpleNamespace(
        added=(one,), refused={}, data=data, held=None, ladder=[SimpleNamespace(rmse=left, holdout_rmse=None)]
    )
    of = search.Search(story)
    monkeypatch.setattr(of, "_round", lambda: SimpleNamespace(prior=-4.6))
    taken = []
    monkeypatch.setattr(of, "_take_back", lambda effect, reason: taken.append(effect))
    assert of._slight() != stays
    assert bool(taken) != stays


def test_a_search_that_keeps_going_back_ends_with_nothing_added():
    """Four effects that were added and spoken against afterwards: what is missing is none of them, nor the next."""
    went: list[str] = []
    story = SimpleNamespace(
        refused={}, restart=lambda: went.append("restart"), back_to_before=lambda key: went.append(key)
    )
    of = search.Search(story)
    of._added = lambda: True
    for name in ("cogging_torque", "dead_time", "constant_load"):
        of._take_back(SimpleNamespace(name=name, key=name), "one")
        of.step()
        assert of._going
    of._take_back(SimpleNamespace(name="dry_friction", key="dry_friction"), "one")
    of.step()
    assert not of._going and went == ["cogging_torque", "dead_time", "constant_load", "restart"]
    assert len(story.refused) == 4


def test_algebra_that_a_refit_did_not_keep_is_no_rival():
    """A Term whose refit gave a twentieth of what the algebra promised is not less probable for another's promise."""
    promised = {"stribeck_friction": 2870.0, "friction_zone": 1420.0, "cogging_torque": 318.0}
    terms = [SimpleNamespace(gain=gain, candidate=SimpleNamespace(name=name)) for name, gain in promised.items()]
    seen = rounds.Round(None, None, Evident(0.0, 0.0, 0.0), (), terms)
    made = [
        SimpleNamespace(gain=gain, trial=SimpleNamespace(candidate=SimpleNamespace(name=name)))
        for name, gain in (("stribeck_friction", 131.0), ("friction_zone", -2.0))
    ]
    assert seen.probabilities(made)["stribeck_friction"] > 0.99
    assert seen.probabilities(made[:1])["stribeck_friction"] > 0.99
    assert seen.probabilities()["stribeck_friction"] > 0.99 > seen.probabilities(made)["cogging_torque"]
    kept = [SimpleNamespace(gain=2900.0, trial=made[1].trial)]  # the zone is more than was promised of it
    assert seen.probabilities(kept)["friction_zone"] > 0.99 > seen.probabilities(kept)["stribeck_friction"]


def test_what_a_richer_law_begins_with_is_refitted_beside_it(monkeypatch):
    """Friction that saturates at once is dry friction, which the algebra may hold for less."""
    gains = {"saturating_friction": 30.0, "dry_friction": 8.0, "cogging_torque": 7.0}
    terms = [
        SimpleNamespace(
            term=SimpleNamespace(fingerprint=object(), log_share=0.0), gain=g, candidate=SimpleNamespace(name=n)
        )
        for n, g in gains.items()
    ]
    story = SimpleNamespace(added=(), data=None, held=None, current=None, refused={})
    of = search.Search(story)
    monkeypatch.setattr(of, "_round", lambda: rounds.Round(None, None, Evident(0.0, 0.0, 0.0), (), terms))
    monkeypatch.setattr(of, "_is_far", lambda: False)
    monkeypatch.setattr(
        of, "_refits", lambda chosen: [search.Contender(_trial(one), one.gain, 0.0, 0.0) for one in chosen]
    )
    monkeypatch.setattr(search, "within_band", lambda data, found: False)
    monkeypatch.setattr(of, "_spoken_against", lambda one: "")
    assert [one.trial.candidate.name for one in of._contenders()] == ["saturating_friction", "dry_friction"]


def _trial(one):
    return SimpleNamespace(candidate=one.candidate, faults=(), fit=None)


@pytest.mark.parametrize(("gain", "told", "tied"), [(9.0, 0.99988, False), (1.0, 1.0, True)])
def test_what_takes_the_place_of_an_effect_is_as_probable_as_that_was(gain, told, tied):
    said: dict[str, float] = {}
    ties: list[str] = []
    new = SimpleNamespace(name="dry_friction", key="dry_friction")
    was = SimpleNamespace(name="current_sensor_gain", probability=1.0)
    story = SimpleNamespace(
        set_probability=said.__setitem__,
        tie=lambda key, name, equal: ties.append(name),
    )
    of = search.Search(story)
    of._first = [Candidate("current_sensor_gain", 1.0, {}, probability=1.0), Candidate("dry_friction", 0.0, {})]
    of._is_instead(new, was, gain)
    assert said["dry_friction"] == pytest.approx(told, abs=1e-4), "of both, where they are not told apart"
    assert ties == (["current_sensor_gain"] if tied else [])
    probable = {one.name: one.probability for one in of._first}
    assert sum(probable.values()) == pytest.approx(1.0) and probable["dry_friction"] > probable["current_sensor_gain"]


def test_laws_of_one_place_or_speed_are_known():
    assert search._is_of_one_law("hinge_moment", "cubic_spring")
    assert not search._is_of_one_law("hinge_moment", "position_sensor_gain"), "a sensor's gain is no spring"
    assert not search._is_of_one_law("hinge_moment", "hinge_moment") and not search._is_of_one_law("k1", "dry_friction")
