"""Faults put into the Reference Model come out of the identification: never tested on the model that fits."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from support.representative import first_of

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.errors import InputError
from ema_model.faults import HEALTHY, NAMES, error_percent, vector
from ema_model.identification.fit import refine, setting
from ema_model.identification.run import Identification, Progress, identify, steps
from ema_model.identification.search import Objective
from ema_model.identification.uncertainty import uncertainty
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.plant import simulated
from ema_model.simulation.run import Run

ACTUATOR = load_actuator()
CASES = ({"k2": 0.75}, {"k1": 0.25}, {"k3": 0.25}, {"k8": 0.75})
SEED = 2


def case_id(fault) -> str:
    return "+".join(f"{name}={value}" for name, value in fault.items())


@cache
def recorded(fault: tuple, noise: float = 0.0, fitness: str = "filtered"):
    return Sensors(noise).record(simulated(Run(), ACTUATOR, vector(dict(fault)), fitness), 1000 + SEED)


@cache
def best_of_two(fault: tuple, noise: float = 0.0) -> Identification:
    """The answer of Honey Badger or Dandelion with the lower rmse; the truth plays no part in the choice."""
    objective = Objective([recorded(fault, noise)], ACTUATOR)
    truth = vector(dict(fault))
    found = [identify(objective, a, seed=SEED, truth=truth, parameters_known=True) for a in ("hba", "do")]
    return min(found, key=lambda answer: answer.rmse)


@pytest.mark.long
@pytest.mark.parametrize("fault", first_of(CASES), ids=case_id)
def test_fault_is_recovered(fault):
    answer = best_of_two(tuple(fault.items()))
    assert answer.error_percent is not None
    assert answer.error_percent <= 0.6, answer.k
    assert answer.error_percent == error_percent(answer.k, vector(fault))
    # "healthy" would score 9.8 % or more
    assert error_percent(HEALTHY, vector(fault)) > 9.0
    name, value = next(iter(fault.items()))
    assert answer.k[NAMES.index(name)] == pytest.approx(value, abs=0.02)
    assert answer.rmse <= 0.1
    assert name in answer.uncertainty.alarms and not answer.uncertainty.healthy


@pytest.mark.long
@pytest.mark.parametrize("fault", CASES, ids=case_id)
def test_fault_is_recovered_from_noise(fault):
    answer = best_of_two(tuple(fault.items()), 0.1)
    assert answer.error_percent is not None and answer.error_percent <= 1.0, answer.k
    assert answer.rmse > best_of_two(tuple(fault.items())).rmse


@pytest.mark.study
def test_intervals_contain_the_truth_for_most():
    inside, widths = [], []
    for fault in CASES:
        for noise in (0.0, 0.1):
            answer = best_of_two(tuple(fault.items()), noise)
            interval, truth = answer.uncertainty.interval90, vector(fault)
            assert interval.shape == (8, 2) and np.all(interval[:, 0] <= interval[:, 1])
            assert np.all((interval >= 0.0) & (interval <= 1.0))
            for i in (j for j in range(8) if NAMES[j] != "k7"):
                inside.append(interval[i, 0] - 1e-9 <= truth[i] <= interval[i, 1] + 1e-9)
                widths.append(interval[i, 1] - interval[i, 0])
    assert np.mean(inside) >= 0.85, f"{sum(inside)} of {len(inside)}"
    assert np.median(widths) < 0.15, "an interval that says nothing contains everything"


@pytest.mark.long
def test_healthy_actuator_is_called_healthy():
    answer = best_of_two(())
    assert answer.error_percent is not None and answer.error_percent <= 0.6
    assert answer.uncertainty.healthy
    assert answer.uncertainty.alarms == ()


@pytest.mark.long
def test_tolerances_widen_the_intervals():
    answer = best_of_two((("k1", 0.25),))
    objective = Objective([recorded((("k1", 0.25),))], ACTUATOR)
    known, open_ = (
        uncertainty(found, found.k).interval90
        for found in (refine(setting(objective, parameters_known=flag), answer.k) for flag in (True, False))
    )
    assert open_[0, 1] - open_[0, 0] > known[0, 1] - known[0, 0]
    assert open_[0, 0] <= 0.25 <= open_[0, 1]


@pytest.mark.long
def test_two_recordings_together():
    fault = {"k1": 0.25, "k3": 0.25}
    truth = vector(fault)
    runs = (Run(command("chirp"), 0.3), Run(command("sine", {"frequency_Hz": 6.0}), 0.3, load_torque_Nm=10.0))
    recordings = [simulated(run, ACTUATOR, truth) for run in runs]
    objective = Objective(recordings, ACTUATOR)
    assert len(objective.windows) == 2 and objective.blocks == 1200
    found = [identify(objective, a, seed=SEED, truth=truth, parameters_known=True) for a in ("hba", "do")]
    answer = min(found, key=lambda a: a.rmse)
    assert answer.error_percent is not None and answer.error_percent <= 1.0, answer.k
    alone = [Objective([r], ACTUATOR)(answer.k)[0] for r in recordings]
    assert answer.rmse == pytest.approx(np.sqrt(np.mean(np.square(alone))), rel=1e-9)


@pytest.mark.parametrize("circuit", first_of(["reduced", "thesis"]))
def test_raw_fitness(circuit):
    """The thesis's fitness: every sample of the current, ripple and all."""
    fault = (("k2", 0.75),)
    objective = Objective([recorded(fault, 0.0, "raw")], ACTUATOR, circuit=circuit, fitness="raw")
    assert objective.blocks == 50_000
    at_truth, healthy = objective(np.array([vector(dict(fault)), HEALTHY]))
    assert 0.05 < at_truth < healthy
    answer = identify(objective, "do", population=30, iterations=40, seed=SEED, truth=vector(dict(fault)))
    assert answer.rmse <= 1.05 * at_truth
    assert answer.k[1] == pytest.approx(0.75, abs=0.1)


def test_stopped_run_returns_its_best():
    objective = Objective([recorded((("k1", 0.25),))], ACTUATOR)
    seen: list[Progress] = []

    def stop(progress: Progress) -> bool:
        seen.append(progress)
        return progress.iteration >= 7

    answer = identify(objective, "hba", population=20, iterations=100, seed=1, on_iteration=stop)
    assert answer.stopped and len(seen) == 8
    assert [p.iteration for p in seen] == list(range(8))
    assert answer.rmse == seen[-1].rmse == min(p.rmse for p in seen)
    np.testing.assert_array_equal(answer.k, seen[-1].k)
    assert objective(answer.k)[0] == answer.rmse
    assert np.all(np.diff(answer.rmse_history) <= 0.0) and len(answer.rmse_history) == 8
    assert answer.k_history.shape == (8, 8) and answer.evaluations == seen[-1].evaluations < 20 * 100
    assert answer.error_percent is None and answer.truth is None
    assert np.all(np.isfinite(answer.uncertainty.interval90))


@pytest.mark.long
def test_run_to_the_end_is_not_stopped_and_repeats():
    objective = Objective([recorded((("k1", 0.25),))], ACTUATOR)
    runs = [identify(objective, "ssa", population=10, iterations=5, seed=seed) for seed in (4, 4, 5)]
    assert not any(r.stopped for r in runs)
    np.testing.assert_array_equal(runs[0].k, runs[1].k)
    assert np.any(runs[0].k != runs[2].k)
    assert len(runs[0].rmse_history) == 6
    # a stop with the last iteration cuts nothing short
    last = identify(objective, "ssa", population=10, iterations=5, seed=4, on_iteration=lambda p: p.iteration == 5)
    assert not last.stopped
    np.testing.assert_array_equal(last.k, runs[0].k)


@pytest.mark.parametrize(
    "options", [{"algorithm": "pso"}, {"population": 1}, {"iterations": 0}, {"unknown_setting": 3.0}]
)
def test_impossible_settings_are_refused(options):
    objective = Objective([recorded((("k1", 0.25),))], ACTUATOR)
    with pytest.raises(InputError) as error:
        next(steps(objective, **options))
    assert "\n" not in str(error.value)


def test_impossible_objectives_are_refused():
    recording = recorded((("k1", 0.25),))
    for arguments, message in (
        (([], ACTUATOR), "one recording or more"),
        (([Sensors().record(recording, 0)], ACTUATOR), None),
    ):
        if message is None:
            with pytest.raises(InputError, match="no fitness 'cubed'"):
                Objective(*arguments, fitness="cubed")
            with pytest.raises(InputError, match="no circuit"):
                Objective(*arguments, circuit="none")
        else:
            with pytest.raises(InputError, match=message):
                Objective(*arguments)
    short = simulated(Run(duration_s=4e-3), ACTUATOR, HEALTHY)
    with pytest.raises(InputError, match="too short to compare"):
        Objective([short], ACTUATOR)
    with pytest.raises(InputError, match="no fitness"):
        simulated(Run(), ACTUATOR, HEALTHY, "cubed")


@pytest.mark.parametrize("algorithm", ["hba", "ssa"])
def test_a_long_search_begins_at_longer_steps_and_ends_exactly(algorithm):
    """Simulations × steps of the model fall below half; the fitness that is told at the end is the actuator's own."""
    objective = Objective([simulated(Run(), ACTUATOR, vector({"k2": 0.3}))], ACTUATOR)
    steps = []

    def counted(measured):
        def call(self, k):
            steps.append(len(np.atleast_2d(k)) * len(self.windows[0].command))
            return measured(self, k)

        return call

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Objective, "__call__", counted(Objective.__call__))
        answer = identify(objective, algorithm, population=20, iterations=30, seed=3)
    assert answer.rmse_history[-1] == answer.rmse == objective(answer.k)[0]
    assert sum(steps) < 0.6 * answer.evaluations * len(objective.windows[0].command)
    assert answer.evaluations > 20 * 31
