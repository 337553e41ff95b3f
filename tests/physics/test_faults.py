"""Faults: the thesis's scores, row by row, and the direction in which each k moves both models."""

from __future__ import annotations

import csv
from itertools import pairwise

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.actuator.actuator import readings, sentences
from ema_model.commands import command
from ema_model.errors import InputError
from ema_model.faults import FAULTS, HEALTHY, NAMES, error_percent, performance_coefficient, physical, vector
from ema_model.files.opened import shipped_folder
from ema_model.simulation.run import Run, simulate_monitor, simulate_reference

ACTUATOR = load_actuator()
TAU = ACTUATOR.transmission.gear_ratio
MODELS = {"reference": simulate_reference, "monitor": simulate_monitor}
each_model = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
CHIRP = Run(command("chirp"))
SLEW = Run(command("ramp", {"slope_rad_s": 0.4}), 0.3)  # 200 rad/s at the motor, ten turns


# --- the thesis's tables --------------------------------------------------------------------------------------------


def thesis_rows():
    """Tables 5.1–5.36: (table, k, truth, printed error with its digits)."""
    with (shipped_folder("thesis") / "rows.csv").open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            k = [float(row[name]) for name in NAMES]
            truth = [float(row[f"{name}_true"]) for name in NAMES]
            yield row["table"], row["algorithm"], k, truth, row["err_percent"]


def test_error_percent_reproduces_every_printed_row():
    rows = list(thesis_rows())
    assert len(rows) == 330
    assert {algorithm for _, algorithm, *_ in rows} == {"SSA", "HBA", "DOA"}
    assert len({table for table, *_ in rows}) == 33
    assert len({printed for *_, printed in rows}) > 100
    missed = []
    for table, _, k, truth, printed in rows:
        half_unit = 0.5 * 10.0 ** -len(printed.partition(".")[2])
        rounding = 100.0 / np.sqrt(6.5) * 0.5e-4  # of k, printed with four digits
        if abs(error_percent(k, truth) - float(printed)) > half_unit + rounding:
            missed.append((table, k, printed, error_percent(k, truth)))
    assert not missed, f"{len(missed)} of {len(rows)} rows: {missed[:3]}"


def test_error_percent_of_healthy_and_wrapped():
    for k, score in ((0.25, 9.8), (0.75, 29.4)):
        assert error_percent(HEALTHY, vector({"k1": k})) == pytest.approx(score, abs=0.05)
    multi = [0.0133, 0.05, 0.003, 0.0, 0.0, 0.012, 0.5, 0.35]
    assert error_percent(HEALTHY, multi) == pytest.approx(6.2, abs=0.05)
    truth, k = vector({"k6": 0.5, "k7": 0.02}), vector({"k6": 0.5, "k7": 0.98})
    assert error_percent(k, truth, wrap=True) == pytest.approx(100.0 * np.sqrt(0.5 * 0.04**2 / 6.5))
    assert error_percent(k, truth) == pytest.approx(100.0 * np.sqrt(0.5 * 0.96**2 / 6.5))
    # a centred rotor has no direction
    assert error_percent(vector({"k7": 0.9}), HEALTHY) == 0.0


# Tables 5.39, 5.40, 5.41 and 5.43: (time s, error %, coefficient %) of SSA, HBA and DOA.
PERFORMANCE = {
    "friction": ((2686, 1.40, 57.72), (2145.5, 1.25, 69.72), (1906.5, 1.28, 72.55)),
    "backlash": ((2194.5, 1.66, 59.65), (1927.5, 1.37, 70.89), (2045.5, 1.35, 69.46)),
    "short circuit": ((2349, 1.44, 64.05), (2192, 1.56, 63.62), (2054, 1.27, 72.33)),
    "eccentricity": ((2635.5, 5.27, 37.63), (2010.5, 2.09, 81.15), (2067, 2.02, 81.22)),
    "gain": ((2840.5, 0.50, 54.64), (1924, 0.39, 75.73), (1974, 0.48, 69.63)),
    "multiple": ((2845, 1.79, 57.43), (1743, 2.27, 66.93), (1762, 1.65, 75.63)),
}


@pytest.mark.parametrize("fault", PERFORMANCE)
def test_performance_coefficient_reproduces_the_tables(fault):
    time_s, error, printed = np.array(PERFORMANCE[fault]).T
    # what half a unit in the errors' last digit can do, bounded by trying its signs
    spread = 0.0
    exact = performance_coefficient(error, time_s)
    for signs in np.ndindex(2, 2, 2):
        moved = performance_coefficient(error + 0.005 * (2.0 * np.array(signs) - 1.0), time_s)
        spread = np.maximum(spread, np.abs(moved - exact))
    assert np.all(np.abs(exact - printed) <= spread + 0.005), (exact, printed)
    assert np.max(spread) < 0.6
    assert np.sum(exact) == pytest.approx(200.0)


# --- the reading of k -----------------------------------------------------------------------------------------------


def test_physical_reading():
    p = physical([0.25, 0.5, 0.1, 0.2, 1.0, 0.3, 0.75, 0.9])
    assert p.friction_factor == pytest.approx(1.5)
    assert p.backlash_factor == pytest.approx(50.5)
    np.testing.assert_allclose(p.turns, [0.9, 0.8, 0.02])
    assert p.eccentricity == pytest.approx(0.3)
    assert p.phase_rad == pytest.approx(0.5 * np.pi)
    assert p.gain_factor == pytest.approx(1.4)
    healthy = physical(HEALTHY)
    assert (healthy.friction_factor, healthy.backlash_factor, healthy.gain_factor) == (1.0, 1.0, 1.0)
    assert np.all(healthy.turns == 1.0) and healthy.eccentricity == 0.0 and healthy.phase_rad == 0.0
    many = physical(np.tile(HEALTHY, (4, 5, 1)))
    assert many.turns.shape == (3, 4, 5) and many.phase_rad.shape == (4, 5)


def test_readings_and_sentences():
    k = vector({"k1": 0.5, "k2": 1.0, "k8": 0.0})
    r = readings(k, ACTUATOR)
    assert r["friction_factor"] == pytest.approx(2.0)
    assert r["backlash_rad"] == pytest.approx(1e-3)
    assert r["position_gain_1_s"] == pytest.approx(5e4)
    assert len(sentences(k, ACTUATOR)) == len(FAULTS)
    assert "1.00 mrad" in sentences(k, ACTUATOR)[1]


@pytest.mark.parametrize("name", ["k0", "k9", "K1", "friction", ""])
def test_vector_refuses_unknown_names(name):
    with pytest.raises(InputError, match="no fault") as error:
        vector({name: 0.5})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("value", [-1e-9, 1.0000001, 25.0, float("nan"), float("inf"), float("-inf")])
@pytest.mark.parametrize("name", NAMES)
def test_vector_refuses_values_outside(name, value):
    with pytest.raises(InputError, match="outside 0 … 1") as error:
        vector({name: value})
    assert name in str(error.value)


def test_vector_sets_only_what_is_given():
    k = vector({"k4": 1.0, "k8": 0.0})
    np.testing.assert_array_equal(k, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.5, 0.0])
    np.testing.assert_array_equal(vector({}), HEALTHY)
    with pytest.raises(ValueError, match="read-only"):
        HEALTHY[0] = 1.0


# --- directions -----------------------------------------------------------------------------------------------------


def rising(values):
    return all(a < b for a, b in pairwise(values))


@each_model
def test_friction_raises_the_current(model):
    means = [np.mean(np.abs(model(CHIRP, ACTUATOR, vector({"k1": k}))["current_A"])) for k in (0.0, 0.25, 0.75)]
    assert rising(means) and means[2] > 1.3 * means[0]
    # at a constant speed, by the friction's torque
    cruise = [np.mean(model(SLEW, ACTUATOR, vector({"k1": k}))["current_A"][-500:]) for k in (0.0, 0.5)]
    expected = ACTUATOR.motor.dynamic_friction_Nm / ACTUATOR.motor.torque_constant_Nm_A
    assert cruise[1] - cruise[0] == pytest.approx(expected, rel=0.05)


@each_model
def test_backlash_widens_the_gap(model):
    gaps = []
    for k in (0.0, 0.25, 0.75):
        s = model(CHIRP, ACTUATOR, vector({"k2": k}))
        gaps.append(np.max(np.abs(s["motor_position_rad"] - s["user_position_rad"] / TAU)))
        assert gaps[-1] == pytest.approx(0.5 * (1.0 + 99.0 * k) * 1e-5 / TAU, rel=1e-3)
    assert rising(gaps)


def modulation(model, k, per_turn):
    """Amplitude, A, of the current's part that repeats `per_turn` times a motor turn at constant speed."""
    s = model(SLEW, ACTUATOR, k)
    angle, current = s["motor_position_rad"], s["current_A"]
    moving = angle >= angle[-1] - 2.0 * np.pi * 5.0  # the last five whole turns
    angle, current = angle[moving], current[moving]
    assert angle[-1] - angle[0] > 30.0
    basis = np.column_stack([f(h * angle) for h in range(1, 8) for f in (np.sin, np.cos)] + [np.ones_like(angle)])
    fit = np.linalg.lstsq(basis, current, rcond=None)[0]
    return float(np.hypot(fit[2 * per_turn - 2], fit[2 * per_turn - 1])), float(np.mean(current))


@each_model
@pytest.mark.parametrize("name", ["k3", "k4", "k5"])
def test_short_circuit_raises_and_modulates_the_current(model, name):
    """Fewer turns need more current for the same torque, twice an electrical turn: four times a motor turn."""
    healthy, mean0 = modulation(model, HEALTHY, 4)
    slight, mean1 = modulation(model, vector({name: 0.25}), 4)
    strong, mean2 = modulation(model, vector({name: 0.75}), 4)
    assert mean0 < mean1 < mean2
    assert healthy < slight < strong and slight > 0.05
    once, _ = modulation(model, vector({name: 0.75}), 1)
    assert once < 0.2 * strong, "a short circuit knows no mechanical angle"


@each_model
def test_eccentricity_modulates_with_the_mechanical_angle(model):
    """ζ cos(θ_m …) times sin² of θ_e gives sums and differences of 1 and 4: 3 and 5 times a turn."""
    for per_turn in (3, 5):
        healthy, _ = modulation(model, HEALTHY, per_turn)
        slight, _ = modulation(model, vector({"k6": 0.25}), per_turn)
        strong, _ = modulation(model, vector({"k6": 0.75}), per_turn)
        if per_turn == 3 or strong > 0.1:
            assert healthy < slight < strong
    # the phase turns the pattern but leaves its size
    turned, _ = modulation(model, vector({"k6": 0.75, "k7": 0.75}), 3)
    assert turned == pytest.approx(modulation(model, vector({"k6": 0.75}), 3)[0], rel=0.35)
    a = model(CHIRP, ACTUATOR, vector({"k6": 0.5, "k7": 0.5}))["current_A"]
    b = model(CHIRP, ACTUATOR, vector({"k6": 0.5, "k7": 0.75}))["current_A"]
    assert np.max(np.abs(a - b)) > 0.1
    # 0 and 1 are the same direction
    one, nought = (model(CHIRP, ACTUATOR, vector({"k6": 0.5, "k7": k}))["user_position_rad"] for k in (1.0, 0.0))
    np.testing.assert_allclose(one, nought, atol=2e-6)


@each_model
def test_gain_lowers_the_following_error(model):
    errors = []
    for k in (0.25, 0.5, 0.75):
        s = model(SLEW, ACTUATOR, vector({"k8": k}))
        errors.append(float(np.mean((s["command_rad"] - s["user_position_rad"])[-500:])))
    assert rising(errors[::-1])
    # at a constant speed the position loop's error is ω / G
    assert errors[0] / errors[2] == pytest.approx(1.25 / 0.75, rel=0.1)
    speeds = [np.max(model(CHIRP, ACTUATOR, vector({"k8": k}))["motor_speed_rad_s"]) for k in (0.25, 0.5, 0.75)]
    assert rising(speeds)
