"""What a perfect model would still leave: a jump is known to within a sample, a standstill is one error."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.campaign.task import base_parameters
from ema_model.commands import command
from ema_model.comparison import compare
from ema_model.comparison.compare import _typical_floor
from ema_model.comparison.residuals import Residuals
from ema_model.comparison.verdict import slow_ratio
from ema_model.estimation import Floor, after_fit, calibrate, floor
from ema_model.estimation.noise import spread, twin_error
from ema_model.models import ClosedLoop
from ema_model.recordings.measurement import Sensors
from ema_model.recordings.signals import held
from ema_model.simulation.run import Run, simulate_reference

ACTUATOR = load_actuator()


def floor_of(name: str, given: dict, rate_Hz: float):
    run = Run(command(name, given), duration_s=0.2, sample_rate_Hz=rate_Hz)
    plant = ClosedLoop([simulate_reference(run, ACTUATOR)], ACTUATOR)
    return plant.windows[0], floor(plant, 0)


def test_a_coarser_sampling_of_a_jump_raises_the_floor_of_its_transient():
    window, coarse = floor_of("step", {"final_rad": 0.005}, 10_000.0)
    _, fine = floor_of("step", {"final_rad": 0.005}, 100_000.0)
    jump = int(np.argmax(np.abs(window.measured["current_A"]) > 1.0))
    at = slice(jump, jump + 2)
    assert np.max(coarse.model["current_A"][at]) > 2.0 * np.max(fine.model["current_A"][at])


@pytest.mark.parametrize("rate_Hz", [10_000.0, 20_000.0])
def test_a_smooth_command_has_no_such_share(rate_Hz):
    _, smooth = floor_of("sine", {"amplitude_rad": 0.005, "frequency_Hz": 3.0}, rate_Hz)
    assert np.max(smooth.model["current_A"]) < 1.0


def test_a_standstill_counts_once():
    window, found = floor_of("step", {"final_rad": 0.002}, 10_000.0)
    stands = np.ptp(window.measured["motor_position_rad"][-100:]) == 0.0
    assert stands and found.repeats[-1] >= 100
    assert found.counts[-1] < 0.5 * np.max(found.counts)


def test_a_true_model_is_at_its_floor_once_fitted():
    """Of ten plants drawn from the tolerances: 1 on average, and within the band that says how well it is known."""
    errors, spreads = [], []
    for seed in range(10):
        plant = ACTUATOR.with_values(base_parameters(ACTUATOR, "free", 1.0, seed))
        run = Run(command("chirp"), duration_s=0.5, sample_rate_Hz=5_000.0)
        seen = Sensors(0.2, 14).record(simulate_reference(run, plant), seed)
        model = ClosedLoop([seen], ACTUATOR)
        before = [floor(model, 0)]
        found = calibrate(model, before)
        after = after_fit(before, found, [twin_error(model, 0, found.actuator, found.k)])
        names = list(found.weighted_sensitivities[0])
        positions = [one.sigma("user_position_rad") for one in (before[0], after[0])]
        assert np.mean(positions[1]) < 0.7 * np.mean(positions[0])
        squared = [
            (found.signals[0][name] - model.windows[0].measured[name]) ** 2 / after[0].sigma(name) ** 2
            for name in names
        ]
        errors.append(float(np.sqrt(np.average(np.mean(squared, axis=0), weights=after[0].counts))))
        spreads.append(spread(after, [names]))
    assert np.mean(errors) == pytest.approx(1.0, abs=0.05)
    within = np.abs(np.array(errors) - 1.0) < 2.33 * np.array(spreads)
    assert np.count_nonzero(within) >= 9 and max(spreads) < 0.08


def test_the_spread_of_white_noise_is_that_of_its_mean_square():
    """No model error: the mean square of n values scatters by √(2/n), the noise that is estimated by twice as much."""
    blocks = 1000
    own = Floor({"current_A": 0.1}, {"current_A": np.zeros(blocks)}, np.ones(blocks), 1e-3)
    expected = 0.5 * np.sqrt(2.0 / blocks + 4.0 * 1.3 / blocks)
    assert spread([own], [["current_A"]]) == pytest.approx(np.hypot(expected, 0.02))
    certain = replace(own, model={"current_A": np.full(blocks, 10.0)})
    assert spread([certain], [["current_A"]]) == pytest.approx(0.5 * np.sqrt(2.0 / 40.0), rel=0.05)


def test_a_standstill_is_one_value_of_the_model_error():
    """Of 2 s the axis moves for 0.5 s, 20 values of 25 ms; at each of three stops friction holds it anywhere once."""
    size, moving, stops = 25, 20, 3
    repeats = np.concatenate([np.full(size * moving, size), *[np.full(500, 500.0)] * stops])
    own = Floor({"current_A": 1e-6}, {"current_A": np.ones(len(repeats))}, repeats, 1e-3)
    random = np.random.default_rng(4)
    once = np.repeat(np.arange(moving + stops), [size] * moving + [500] * stops)
    drawn = random.standard_normal((2000, moving + stops))[:, once]
    errors = np.sqrt(np.average(drawn**2, axis=1, weights=own.counts))
    assert spread([own], [["current_A"]]) == pytest.approx(np.std(errors), rel=0.05)
    slow = [slow_ratio(_left(row, own), "current_A") for row in drawn[:300]]
    assert np.sqrt(np.mean(np.square(slow))) == pytest.approx(1.0, abs=0.05)


def _left(values: np.ndarray, own: Floor) -> Residuals:
    """Of one signal, over its floor."""
    nothing, name = np.zeros(len(values)), "current_A"
    return Residuals(
        time_s=nothing,
        values={name: values},
        sigma={name: own.sigma(name)},
        noise={name: nothing},
        white={name: nothing},
        variables={},
        recording=nothing.astype(int),
        run=nothing.astype(int),
        saturated=nothing.astype(bool),
        block_s=own.block_s,
        counts=own.counts,
    )


def test_a_true_model_is_at_its_floor_where_it_was_not_fitted():
    """What its parameters took up of the model's own error elsewhere moves it here: as in `after_fit`, 1 on average."""
    ratios = []
    for seed in range(3):
        plant = ACTUATOR.with_values(base_parameters(ACTUATOR, "free", 1.0, seed))
        runs = [
            Run(command("chirp"), duration_s=0.5, sample_rate_Hz=5_000.0),
            Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 0.7, sample_rate_Hz=5_000.0),
            Run(command("multisine"), 0.5, sample_rate_Hz=5_000.0),
        ]
        seen = [Sensors(0.2, 14).record(simulate_reference(run, plant), 10 * seed + i) for i, run in enumerate(runs)]
        found = compare(seen[:2], ACTUATOR, holdout=seen[2:])
        blind = compare(seen[2:], found.actuator, calibrate=False)
        fitted = (blind.recordings[0], *found.holdout)
        ratios.append([one.errors["current_A"].rmse / one.errors["current_A"].noise_floor for one in fitted])
    apart, told = np.mean(ratios, axis=0)
    assert told == pytest.approx(1.0, abs=0.08)
    assert abs(told - 1.0) < abs(apart - 1.0), "floors of a model that no fit has moved"


@pytest.mark.parametrize("steps", [0.02, 0.1, 0.3, 0.6, 2.2])  # crossed in 25 ms
@pytest.mark.parametrize("samples", [1, 5])  # of 0.5 ms, in a block
def test_a_coarse_grid_that_is_crossed_slowly_is_off_by_as_much_as_its_floor_says(steps, samples):
    """In blocks and in means over 25 ms, over all places on the grid where a motion may begin."""
    period, count = 0.5e-3, 4000
    blocks, means, told, lasts = [], [], [], []
    for phase in np.linspace(0.0, 1.0, 40, endpoint=False):
        exact = phase + steps * period / 0.025 * np.arange(count)
        seen = np.round(exact)
        off = (seen - exact).reshape(-1, samples).mean(axis=1)
        of_noise = 1.0 / np.sqrt(12.0 * samples)
        own = Floor(
            {"user_position_rad": of_noise},
            {"user_position_rad": np.zeros(len(off))},
            np.ones(len(off)),
            samples * period,
            held_s={"user_position_rad": held(seen, samples) * period},
            samples=samples,
        )
        sigma, white = own.sigma("user_position_rad"), own.white_part("user_position_rad")
        size = 50 // samples
        blocks.append(off**2)
        told.append(sigma**2)
        means.append(off.reshape(-1, size).mean(axis=1) ** 2)
        lasts.append((white**2 / size + sigma**2 - white**2).reshape(-1, size).mean(axis=1))
    assert np.sqrt(np.mean(means) / np.mean(lasts)) == pytest.approx(1.0, abs=0.25) or steps > 1.0
    assert np.mean(means) < 1.1 * np.mean(lasts)
    if samples == 1:
        assert np.sqrt(np.mean(blocks) / np.mean(told)) == pytest.approx(1.0, rel=0.02)


def test_a_reading_that_is_held_counts_once_in_25_ms_of_a_fit():
    """However often it was sampled; one that is not held, or far from the floor, counts in every sample."""
    for period in (0.5e-3, 2.5e-3):
        count = round(0.25 / period)
        own = Floor(
            {"user_position_rad": 1.0},
            {"user_position_rad": np.zeros(count)},
            np.ones(count),
            period,
            held_s={"user_position_rad": np.full(count, 1e6)},
        )
        moves = replace(own, held_s={"user_position_rad": np.full(count, period)})
        for one, values in ((own, 10.0), (moves, count), (replace(own, even=True), count)):
            assert np.sum(one.fit_sigma("user_position_rad") ** -2.0) == pytest.approx(values)


def test_a_long_recording_of_which_parts_are_fitted_knows_what_its_grid_holds():
    """Where it is held, not where it was fitted."""
    name, moving, held_there = "user_position_rad", np.full(50, 1e-3), np.repeat([1e-3, 1.0], 100)
    part = Floor({name: 1.0}, {name: np.zeros(50)}, np.ones(50), 1e-3, left={name: np.zeros(50)}, held_s={name: moving})
    whole: Any = SimpleNamespace(blocks=200, held_s={name: held_there}, samples_per_block=1, allowed={}, alike=1.0)
    told = _typical_floor([part, part], whole)
    assert told.sigma(name) == pytest.approx(np.ones(200))
    assert told.white_part(name)[:100] == pytest.approx(np.ones(100)) and np.max(told.white_part(name)[100:]) < 0.3
