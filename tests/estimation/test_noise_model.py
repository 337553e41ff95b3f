"""The noise model: what lasts or comes in bursts counts as the few values that it is."""

import numpy as np
import pytest

from ema_model.estimation.noise import PIECE, NoiseModel

_COUNT = 8 * PIECE


@pytest.fixture
def rng():
    return np.random.default_rng(7)


@pytest.fixture(scope="module")
def noise():
    return NoiseModel.of([("current_A", slice(0, _COUNT)), ("motor_position_rad", slice(_COUNT, 2 * _COUNT))])


def _log(noise, values):
    coefficients = noise.coefficients(values)
    return noise.log_likelihood(coefficients, noise.levels(coefficients))


def test_coefficients_keep_the_energy_of_each_signal(noise, rng):
    values = rng.standard_normal((2 * _COUNT, 3))
    found = noise.coefficients(values)
    for rows in (slice(0, _COUNT), slice(_COUNT, 2 * _COUNT)):
        assert np.sum(found[rows] ** 2, axis=0) == pytest.approx(np.sum(values[rows] ** 2, axis=0))
    assert np.array_equal(found[:, 1], noise.coefficients(values[:, 1]))


def test_groups_are_octaves_of_a_signal(noise):
    assert {name for name, _ in noise.names} == {"current_A", "motor_position_rad"}
    octaves = [octave for name, octave in noise.names if name == "current_A"]
    assert octaves == [*range(int(np.log2(PIECE)) + 1)]
    first = noise.group[:PIECE]
    assert np.bincount(first)[: len(octaves)].tolist() == [1, 1, *(2**i for i in range(1, len(octaves) - 1))]


def test_a_level_is_found_where_it_is_above_what_sensors_leave(noise, rng):
    coefficients = noise.coefficients(np.where(noise.group >= 0, 3.0, 0.0) * rng.standard_normal(2 * _COUNT))
    levels = noise.levels(coefficients)
    many = np.bincount(noise.group) > 200
    # A normal value of variance 9 is Student's t of a level about three quarters of that.
    assert np.all((levels[many] > 5.0) & (levels[many] < 9.5))
    assert np.all(noise.levels(0.01 * coefficients) == 0.5)


@pytest.mark.parametrize("shape", ["lasts", "burst"])
def test_an_error_of_a_few_shapes_is_worth_far_less_than_the_same_power_of_noise(noise, rng, shape):
    white = rng.standard_normal(2 * _COUNT)
    error = np.zeros(2 * _COUNT)
    if shape == "lasts":
        error[:_COUNT] = 5.0 * np.sin(np.linspace(0.0, 6.0, _COUNT))
    else:
        error[300:364] = 5.0 * np.sqrt(_COUNT / 128.0)
    power = np.sqrt(1.0 + np.sum(error**2) / (2 * _COUNT))
    few, many = (_log(noise, white) - _log(noise, one) for one in (white + error, power * white))
    chi2 = 0.5 * float(np.sum((white + error) ** 2) - np.sum(white**2))
    assert 0.0 < few < 0.25 * many
    assert few < 0.05 * chi2


def test_what_brings_a_large_rest_to_the_floor_is_worth_more_than_what_takes_half_of_it(noise, rng):
    white = rng.standard_normal(2 * _COUNT)
    rest = 20.0 * np.sin(np.linspace(0.0, 400.0, 2 * _COUNT))
    all_of_it = _log(noise, white) - _log(noise, white + rest)
    half = _log(noise, white + 0.5 * rest) - _log(noise, white + rest)
    assert all_of_it > 3.0 * half > 0.0
