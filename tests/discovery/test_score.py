"""What is known of an effect beforehand, on a machine of another size too, and what amounts make of it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ema_model.actuator import Tolerance, load_actuator
from ema_model.discovery import refit, terms
from ema_model.discovery.evidence import Unknowns
from ema_model.discovery.fingerprints import Fingerprint
from ema_model.effects import find
from ema_model.estimation.model_fit import multiplied, with_effect
from ema_model.estimation.noise import PIECE, NoiseModel


@pytest.mark.parametrize(
    ("name", "current_A", "strong"),
    [
        ("torque_saturation", 22.5, 1.0 / 67.5),
        ("torque_saturation", 3.0, 1.0 / 9.0),
        ("torque_saturation", 300.0, 0.0125),
        ("torque_saturation", 0.0, 0.0125),
        ("mesh_friction", 3.0, 0.25),
    ],
    ids=["the library's motor", "a small one", "a large one", "no current known", "a ratio"],
)
def test_iron_saturates_by_what_its_machine_draws(name, current_A, strong):
    signals = {"current_A": np.array([0.5, -1.0]) * current_A}
    found = SimpleNamespace(calibration=SimpleNamespace(signals=[signals]))
    assert terms.strong_case(found, find(name)) == pytest.approx(strong)


@pytest.mark.parametrize("start", [0.15, 0.1, 0.07, 0.3])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_no_rounding_takes_a_candidate_out_of_its_range(start, sign):
    """(0.95 / 0.15) 0.15 is more than 0.95: a discovery had ended in an error by that."""
    first = find("load_dependent_friction").parameters[0]
    end = first.high if sign > 0.0 else first.low
    found = SimpleNamespace(actuator=load_actuator())
    one = Fingerprint("load_dependent_friction", {"ratio": start}, np.zeros((1, 1)))
    settings = terms.settings_at(found, one, np.array([end / start]))
    assert first.low <= settings["ratio"] <= first.high and settings["ratio"] == pytest.approx(end)


@pytest.mark.parametrize(("torque_Nm", "times"), [(169.2, 100.0), (0.1, 1.0)])
def test_a_strong_case_is_as_strong_as_the_machine(torque_Nm, times):
    """Teeth of a motor of a hundred times the torque pull a hundred times as hard: they are not within its noise."""
    shown = [{"motor_torque_Nm": np.array([0.0, -torque_Nm])}]
    found = SimpleNamespace(calibration=SimpleNamespace(signals=shown, actuator=load_actuator()))
    cogging = find("cogging_torque")
    assert terms.strong_case(found, cogging) == pytest.approx(times * cogging.severities[2])


@pytest.mark.parametrize(
    ("name", "path"),
    [("dry_friction", "motor.dynamic_friction_Nm"), ("viscous_friction", "motor.viscous_friction_Nms_rad")],
)
def test_as_much_friction_again_as_the_file_has_is_no_more_than_strong(name, path):
    """A joint has a hundred times the friction of the library's motor."""
    actuator, effect = load_actuator(), find(name)
    much = actuator.with_values({path: 50.0 * effect.severities[2]})
    for one, times in ((actuator.with_values({path: 0.0}), 1.0), (much, 50.0)):
        found = SimpleNamespace(calibration=SimpleNamespace(signals=[{"current_A": np.zeros(2)}], actuator=one))
        assert terms.strong_case(found, effect) == pytest.approx(times * effect.severities[2])


@pytest.mark.parametrize(
    ("value", "z", "at_bound", "is_held"),
    [(0.1, -0.5, False, False), (0.1, -2.5, False, True), (0.1, -1.9999999999, True, True), (0.0, -2.0, True, False)],
    ids=["near its guess", "far from it", "at the end that the guess has", "at its own end"],
)
def test_a_guess_that_holds_a_parameter_back_is_seen_at_its_end_too(value, z, at_bound, is_held):
    one = SimpleNamespace(value=value, z=z, at_bound=at_bound)
    calibration = SimpleNamespace(parameters={"effects.load_dependent_friction.ratio": one})
    found = SimpleNamespace(actuator=load_actuator(), calibration=calibration)
    first = find("load_dependent_friction").parameters[0]
    one.value = first.low if value == 0.0 else value
    assert refit._is_held_back(found, ["load_dependent_friction"]) is is_held


def test_the_evidence_of_a_model_does_not_depend_on_where_its_fit_ended(monkeypatch):
    """Two unknowns count by their product, as an inertia and its share: wherever a fit left them, it is one model."""
    shape = np.random.default_rng(0).standard_normal(PIECE)
    measured = 2.0 * shape + np.random.default_rng(1).standard_normal(PIECE)
    noise = NoiseModel.of([("current_A", slice(0, PIECE))])
    sigma = np.array([0.1, 1.0])  # of what they are known to be, both 1

    def left(points):
        return np.prod(np.atleast_2d(points), axis=1)[:, None] * 20.0 * shape - 20.0 * measured

    def told(x):
        columns = noise.coefficients(np.stack([x[1] * shape, x[0] * shape], axis=1) * 20.0)
        unknowns = Unknowns(columns, 1.0 - x, sigma, np.full(2, -9.0), np.full(2, 9.0))
        about = terms.AboutFit(unknowns, noise.coefficients(left(x)[0]))
        problem = SimpleNamespace(residuals=left, clip=lambda points: points, values=PIECE)
        monkeypatch.setattr(terms.AboutFit, "of", lambda found, noise: about)
        monkeypatch.setattr(terms, "problem_of", lambda *args, **options: problem)
        monkeypatch.setattr(terms, "places_beside", lambda found: [])
        found = SimpleNamespace(plant=None, calibration=SimpleNamespace(free=(), x=x))
        return terms.evidence_of_fit(SimpleNamespace(floors=(), signals={}), None, found, noise).log

    near, far = (told(np.array(x)) for x in ((1.01, 1.98), (1.8, 1.0)))
    assert far == pytest.approx(near, abs=1.0)


@pytest.mark.parametrize(
    ("name", "off", "settings", "whole"),
    [
        ("inertia_error", 2.0, {"ratio": 0.5}, 1.1 * 1.5 - 1.0),
        ("demagnetisation", -3.0, {"ratio": 0.1}, 1.0 - 0.91 * 0.9),
        ("demagnetisation", 3.0, {"ratio": 0.01}, 0.0),  # there is no more than none
        ("dry_friction", 2.0, {"torque_Nm": 0.01}, 0.01),  # which adds, and leaves its parameter free
    ],
    ids=["more inertia", "weaker magnets", "at an end", "a sum"],
)
def test_an_effect_takes_on_how_far_what_it_multiplies_is_off(name, off, settings, whole):
    """Of a product, only the whole is seen: a fit would have to find along a bent valley how to share it."""
    actuator, effect = load_actuator(), find(name)
    path, first = effect.duplicates, effect.parameters[0].name
    sigma = {"motor.inertia_kgm2": 0.05, "motor.torque_constant_Nm_A": 0.03}.get(path, 0.1) * actuator.value(path)
    free = {**actuator.tolerances, path: Tolerance(sigma, True)}
    actuator = replace(actuator, tolerances=free)
    found = SimpleNamespace(actuator=actuator)
    given, left = refit.with_what_they_multiply(found, {name: settings}, {path: off, "pull 0": 1.0})
    assert given[name][first] == pytest.approx(whole) and left["pull 0"] == 1.0
    assert (path in left) == (not effect.scale)
    assert (path in multiplied(with_effect(actuator, name, given[name]))) == bool(effect.scale)


def test_what_a_file_says_of_an_effect_leaves_what_it_multiplies_free():
    actuator = replace(load_actuator(), effects={"inertia_error": {"ratio": 0.5}})
    assert not multiplied(actuator)
