"""The one least-squares problem: of calibration and identification, of one candidate and of many."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ema_model.actuator import Tolerance, load_actuator
from ema_model.commands import command
from ema_model.effects import find
from ema_model.estimation import calibrate, floor
from ema_model.estimation.calibrate import calibrated, problem_of
from ema_model.estimation.least_squares import Descent
from ema_model.estimation.problem import K_SIGMA, TOGETHER, to_vector, unknowns_of
from ema_model.faults import HEALTHY, NAMES, vector
from ema_model.identification.fit import setting
from ema_model.identification.search import Objective
from ema_model.models import model_for
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.plant import simulated
from ema_model.simulation.run import Run, simulate_reference

ACTUATOR = load_actuator()
BLIND = replace(ACTUATOR, controller=replace(ACTUATOR.controller, kind="unknown"))
TRUTH = vector({"k1": 0.3, "k3": 0.2, "k6": 0.3, "k7": 0.98, "k8": 0.6})
FREE = ("motor.inertia_kgm2", "motor.dynamic_friction_Nm", "sensors.current_gain")


@pytest.fixture(scope="module")
def recording():
    clean = simulate_reference(Run(command("chirp"), 0.5, load_torque_Nm=5.0), ACTUATOR, TRUTH)
    return Sensors(0.1, 14).record(clean, 3)


def problem_for(recording, actuator, free):
    model = model_for([recording], actuator)
    return problem_of(model, [floor(model, 0)], free=free)


@pytest.mark.parametrize(("actuator", "free"), [(ACTUATOR, (*FREE, *NAMES)), (BLIND, (*FREE, "k1"))])
def test_many_candidates_are_each_alone(recording, actuator, free):
    problem = problem_for(recording, actuator, free)
    x = problem.clip(0.5 * np.random.default_rng(1).standard_normal((20, problem.count)))
    together, slopes = problem.jacobians(x)
    for i in (0, 19):
        alone, its = problem.jacobians(x[i : i + 1])
        np.testing.assert_array_equal(alone[0], together[i])
        np.testing.assert_array_equal(its[0], slopes[i])
    np.testing.assert_array_equal(problem.residuals(x), together)
    np.testing.assert_array_equal(together[:, problem.values :], x)
    assert sum(rows.stop - rows.start for _, _, rows in problem.parts()) == problem.values


def test_calibration_and_identification_solve_the_same_problem(recording):
    """The same recording with the same freedom: the same unknowns, priors and weights, and so the same k.

    But for when the current was logged, which an identification looks for and a comparison takes as it is.
    """
    given = setting(Objective([recording], ACTUATOR), parameters_known=False)
    given = replace(given, others=[one for one in given.others if one.kind != "lag"])
    identifying = given.problem(with_base=False)
    fitted = calibrate(identifying.model, given.floors, free=NAMES)
    calibrating = problem_of(identifying.model, given.floors, free=NAMES)
    assert calibrating.unknowns == identifying.unknowns
    x = identifying.at(np.stack([HEALTHY, TRUTH]))
    np.testing.assert_array_equal(calibrating.residuals(x), identifying.residuals(x))
    descent = Descent.begin(identifying, x[1:])
    while not descent.done:
        descent.step()
    np.testing.assert_allclose(
        to_vector(fitted.k), to_vector(identifying.k(descent.x[0])), atol=3e-3
    )  # both stop where a step gains little
    np.testing.assert_allclose(to_vector(fitted.k), to_vector(TRUTH), atol=0.05)


def test_every_k_has_the_same_prior_about_the_actuators_own():
    worn = replace(ACTUATOR, faults={"k1": 0.2, "k6": 0.5, "k7": 0.75})
    found = unknowns_of(worn, ["k7", *NAMES])
    assert [one.name for one in found] == ["k6", "k7", *(name for name in NAMES if name not in ("k6", "k7"))]
    vectors = to_vector(worn.k)
    for one in found:
        assert one.sigma == K_SIGMA and one.nominal == vectors[one.place] and one.name == NAMES[one.place]
        least = -1.0 if one.name in ("k6", "k7") else 0.0
        assert one.nominal + one.sigma * np.array([one.low, one.high]) == pytest.approx([least, 1.0])


def test_eccentricity_is_calibrated_as_a_vector(recording):
    """k7 = 0.98 is found from ½ across the end of its scale, and k6 alone cannot be free."""
    model = model_for([recording], ACTUATOR)
    found = calibrate(model, [floor(model, 0)], free=["k1", "k3", "k6", "k8"])
    assert found.free == ("k1", "k3", "k6", "k7", "k8") == tuple(found.parameters)
    size, angle = found.parameters["k6"], found.parameters["k7"]
    assert size.value == pytest.approx(0.3, abs=0.02) and angle.value == pytest.approx(0.98, abs=0.02)
    assert (size.value, angle.value) == (found.k[5], found.k[6])
    assert size.z == pytest.approx(0.3 / K_SIGMA, abs=0.04) and not size.at_bound
    assert size.interval90[0] < size.value < size.interval90[1] < 0.4
    assert angle.interval90[0] < angle.value < angle.interval90[1] < angle.value + 0.05


def test_a_load_that_the_user_gives_stays(recording):
    """An effect that is given with a value keeps it, also where it could stand for a load that was not recorded."""
    given = {"constant_load": {"torque_Nm": 15.0}}
    clean = simulated(Run(command("chirp"), 0.2, load_torque_Nm=5.0), ACTUATOR, HEALTHY, effects=given)
    fits, misses = (
        setting(Objective([clean], ACTUATOR, effects=effects), parameters_known=True).coarse()
        for effects in (given, {})
    )
    at = fits.at(HEALTHY[None, :])
    assert np.mean(fits.residuals(at) ** 2) < 0.2 * np.mean(misses.residuals(at) ** 2)


def test_a_step_on_the_way_takes_no_block_of_lanes_more_than_one_side_needs(recording, monkeypatch):
    model = model_for([recording], ACTUATOR)
    problem = problem_of(model, [floor(model, 0)])
    x = np.zeros((1, problem.count))
    _, [exact] = problem.jacobians(x)
    lanes, simulate = [], problem.simulate
    monkeypatch.setattr(problem, "simulate", lambda x, window: lanes.append(len(x)) or simulate(x, window))
    residual, [thrifty] = problem.jacobians(x, in_whole_blocks=True)
    assert 1 + problem.count <= lanes[0] <= TOGETHER < 1 + 2 * problem.count
    np.testing.assert_array_equal(residual, problem.residuals(x))
    both = lanes[0] - 1 - problem.count  # unknowns that are moved to both sides all the same
    same = [np.array_equal(one, other) for one, other in zip(exact.T, thrifty.T)]
    assert 0 < both <= sum(same) < problem.count
    for one, other in zip(exact.T, thrifty.T):
        np.testing.assert_allclose(other, one, atol=0.15 * np.abs(one).max())


def test_a_parameter_that_stays_where_the_file_puts_its_bound_was_driven_nowhere(recording):
    """A sensor's delay is 0 in the file, and less than 0 nowhere."""
    problem = problem_for(recording, ACTUATOR, ["sensors.delay_s", "motor.inertia_kgm2"])
    x = np.zeros(problem.count)
    x[:2] = 0.005, -2.995
    found = calibrated(problem, x, np.eye(problem.count))
    delay, inertia = found["sensors.delay_s"], found["motor.inertia_kgm2"]
    assert problem.low[0] == 0.0 == delay.initial and not delay.at_bound and inertia.at_bound


@pytest.mark.parametrize("value", [1e200, -1e200, np.inf, np.nan])
def test_a_run_that_diverges_is_a_very_great_error_that_a_descent_can_count(recording, value):
    """A spring that pushes makes a loop unstable: its signals are finite for long, but their squares are not."""
    problem = problem_for(recording, ACTUATOR, FREE)
    start = np.zeros((1, problem.count))
    before = problem.residuals(start)[0]

    def diverged(x, window, simulated=problem.simulate):
        return {
            name: np.where(np.arange(values.shape[1]) > 20, value, values)
            for name, values in simulated(x, window).items()
        }

    problem.simulate = diverged
    after = problem.residuals(start)[0]
    assert np.isfinite(after @ after) and after @ after > 1e6 * (before @ before)
    np.testing.assert_array_equal(after[:20], before[:20])


def test_others_beside_the_derivatives_are_what_they_are_alone(recording):
    identifying = setting(Objective([recording], ACTUATOR), parameters_known=True).coarse()
    x = identifying.at(np.array([[0.2, 0.1, 0.0, 0.0, 0.0, 0.1, 0.5, 0.5], [0.3, 0.2, 0.0, 0.0, 0.0, 0.0, 0.5, 0.6]]))
    assert identifying.has_room_for(3) and not identifying.has_room_for(16)
    residual, slopes, beside = identifying.jacobians_beside(x[:1], x[1:], in_whole_blocks=True)
    alone, its = identifying.jacobians(x[:1], in_whole_blocks=True)
    assert np.array_equal(beside, identifying.residuals(x[1:]))
    assert np.array_equal(residual, alone) and np.array_equal(slopes, its)


@pytest.mark.parametrize("end", [-1.0, 1.0])
def test_no_rounding_brings_a_parameter_beyond_its_range(end):
    """An effect's number at its bound is one that the effect takes, whatever it started from."""
    path, effect = "effects.load_dependent_friction.ratio", find("load_dependent_friction")
    parameter = effect.parameters[0]
    for nominal in np.random.default_rng(2).uniform(0.1, 0.4, 500):
        settings = effect.settings({parameter.name: float(nominal)})
        beside = replace(ACTUATOR, effects={effect.name: settings}, tolerances={path: Tolerance(0.4, True)})
        unknown = unknowns_of(beside, [path])[0]
        at_bound = unknown.nominal + unknown.sigma * (unknown.low if end < 0.0 else unknown.high)
        effect.settings({parameter.name: at_bound})  # InputError for one outside its range
