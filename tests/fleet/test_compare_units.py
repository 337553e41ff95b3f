"""Units compared from recordings of the three-phase model: what was put in is found, by the unit and by its size."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from ema_model.actuator import load_actuator, save_actuator
from ema_model.estimation import calibrate
from ema_model.fleet import fit as fitting
from ema_model.fleet.block import linearised, unit_of, wider
from ema_model.fleet.compare import compare_units
from ema_model.fleet.fit import At, fit, simpler
from ema_model.fleet.result import notes, sentences
from ema_model.recordings import Measurement
from ema_model.simulated_fleets import draw, recorded

ACTUATOR = load_actuator()
BACKLASH = "transmission.backlash_rad"
RUNS = ("chirp", "step")
SHARED = np.linspace(-0.5, 0.5, 11)


def units_of(count: int, changes: dict[tuple[int, str], float], seed: int = 0):
    """Recordings of a fleet whose truth is written here: (unit, parameter) → tolerances."""
    fleet = draw(ACTUATOR, seed, units=max(count, 2), differing=0)
    x = np.tile(SHARED, (max(count, 2), 1))
    for (unit, path), change in changes.items():
        x[unit, fleet.parameters.index(path)] += change
    fleet = replace(fleet, x=x)
    every = [recorded(fleet.unit(unit), seed, unit, (*RUNS, "unseen")) for unit in range(count)]
    fitted = {fleet.names[i]: [one[run] for run in RUNS] for i, one in enumerate(every)}
    return fitted, {fleet.names[i]: [one["unseen"]] for i, one in enumerate(every)}


@pytest.fixture(scope="module")
def differing():
    """Three units, of which the second has 0.6 of a tolerance less play."""
    fitted, held = units_of(3, {(1, BACKLASH): -0.6})
    return compare_units(fitted, ACTUATOR, holdout={"unit_02": held["unit_02"]})


def test_what_models_do_not_explain_has_no_interval(differing):
    """How sure a difference is, nobody knows who does not have the physics."""
    missed = sentences(replace(differing, errors=np.full(3, 50.0)))
    assert "±" in sentences(differing)[0] and "nothing else" in sentences(differing)[0]
    assert "seems to differ" in missed[0] and "±" not in missed[0] and "may stand behind" in missed[-1]


def test_what_differs_is_found(differing):
    (one,) = differing.differences
    assert (one.unit, one.parameter, one.alike) == ("unit_02", BACKLASH, ())
    true = -0.6 * ACTUATOR.tolerances[BACKLASH].sigma
    wide = one.change90[1] - one.change90[0]
    assert one.change90[0] - wide < true < one.change90[1] + wide and wide < abs(true)
    assert one.share is not None and one.share < 0.0 and one.held_out is not None and one.held_out > 0.0
    told = sentences(differing)
    assert len(told) == 1 and told[0].startswith("unit_02 differs from the rest in transmission backlash (−")
    assert told[0].endswith("nothing else")


def test_the_transfer_matrix_shows_it(differing):
    floors = differing.transfer.floors
    assert np.diag(floors) == pytest.approx(np.ones(3), abs=0.15), "a unit's own model is at its floor"
    assert np.diag(floors) == pytest.approx(differing.errors)
    assert floors.shape == (3, 3) and np.all(np.diag(floors) <= floors.min(axis=0) + 0.02)
    assert differing.transfer.error.shape == (3, 3) and np.all(differing.transfer.floor > 0.0)


def test_the_type_is_an_actuator_file(differing, tmp_path):
    save_actuator(differing.type_actuator, tmp_path / "type.toml")
    again = load_actuator(tmp_path / "type.toml")
    assert again.value(BACKLASH) == pytest.approx(differing.of_type[BACKLASH].mean)
    assert again.tolerances[BACKLASH].sigma == pytest.approx(differing.of_type[BACKLASH].sigma)
    assert again.tolerances[BACKLASH].sigma < 0.5 * ACTUATOR.tolerances[BACKLASH].sigma
    assert "# The sigma of each fitted parameter is 1 σ by which a further unit" in again.text
    nothing = [path for path, one in differing.of_type.items() if not one.told]
    assert all(again.tolerances[path].sigma == ACTUATOR.tolerances[path].sigma for path in nothing)


def test_each_unit_is_told_alone(differing):
    own, mean = differing.alone[BACKLASH], differing.of_type[BACKLASH].mean
    tolerance = ACTUATOR.tolerances[BACKLASH].sigma
    assert own.value.shape == own.sigma.shape == (3,) and np.all((own.sigma > 0.0) & (own.sigma <= tolerance))
    off = (own.value - mean) / tolerance
    assert np.argmin(off) == 1 and off[1] < -0.4 and np.all(np.abs(off[[0, 2]]) < 0.2)
    told = differing.to_dict()["units"][1]["parameters"][BACKLASH]
    assert told["unit"] == "rad" and told["interval90"][0] < told["value"] < told["interval90"][1]


def test_json_has_the_same(differing):
    told = differing.to_dict()
    assert told["differences"][0]["unit"] == "unit_02" and told["differences"][0]["same_as"] == []
    assert [one["name"] for one in told["units"]] == ["unit_01", "unit_02", "unit_03"]
    assert len(told["transfer"]["floors"]) == 3 and BACKLASH in told["type"]


def test_equal_units_are_equal_and_a_missing_recording_is_named():
    fitted, _ = units_of(2, {}, seed=2)
    fitted["unit_02"] = fitted["unit_02"][:1]  # the chirp: no step, which tells the resistance
    found = compare_units(fitted, ACTUATOR)
    assert not found.differences and not found.scattering
    assert sentences(found) == ["the 2 units do not differ in anything that their recordings tell"]
    needed = {(one.unit, one.parameter): one.recording for one in found.needs}
    assert needed["unit_02", "motor.resistance_Ohm"] == "step"
    assert re.search("unit_02 tells nothing of motor .*resistance: a recording like step would", str(found))


@pytest.mark.long
@pytest.mark.parametrize(("warmer_K", "allowed"), [(30.0, True), (70.0, False)])
def test_a_warmer_winding_is_the_recordings_and_not_the_units(warmer_K, allowed):
    """Copper's 0.39 % a kelvin: of two steps at the voltage's limit one is driven by a warmer motor."""
    fleet = draw(ACTUATOR, 5, units=2, differing=0)
    fleet = replace(fleet, x=np.tile(SHARED, (2, 1)))
    every = {
        name: [recorded(fleet.unit(i), seed, i, (run,))[run] for seed, run in enumerate(("chirp", "step", "step"))]
        for i, name in enumerate(fleet.names)
    }
    cold = fleet.unit(1)
    warm = cold.with_values({"motor.resistance_Ohm": cold.motor.resistance_Ohm * (1.0 + 0.0039 * warmer_K)})
    every["unit_02"][2] = recorded(warm, 2, 1, ("step",))["step"]
    found = compare_units(every, ACTUATOR)
    assert not found.differences and allowed == ("do not differ" in sentences(found)[0])
    (one,) = found.of_recordings
    assert (one.unit, one.quantity, one.in_unit) == ("unit_02", "winding_temperature", "K")
    assert one.allowed_for is allowed
    low, high = sorted(map(abs, one.value90))
    assert low < warmer_K < high
    said = "this is allowed for" if allowed else "leave that recording out"
    assert re.search(rf"its winding was \S+ ± \S+ K (warmer|colder); {said}", " ".join(notes(found)))


@pytest.fixture(scope="module")
def disagreeing():
    """Three equal units; in one recording of the second the current's zero is off, one of the third has it late."""
    fitted, _ = units_of(3, {}, seed=4)
    chirp, step = fitted["unit_02"][0], fitted["unit_03"][1]
    off, late = ({name: one[name] for name in one} for one in (chirp, step))
    off["current_A"] = off["current_A"] + 0.12
    late["current_A"] = np.interp(step["time_s"] - 4e-4, step["time_s"], step["current_A"])
    fitted["unit_02"][0], fitted["unit_03"][1] = Measurement(off, name="chirp"), Measurement(late, name="step")
    return compare_units(fitted, ACTUATOR)


def test_recordings_of_a_unit_that_disagree_are_no_difference_between_units(disagreeing):
    """Of two recordings it is only known that they disagree: either may be the one that is named."""
    assert not disagreeing.differences
    zero, delay = sorted(disagreeing.of_recordings, key=lambda one: one.unit)
    assert (zero.unit, zero.quantity) == ("unit_02", "current_zero") and zero.allowed_for
    assert (delay.unit, delay.quantity) == ("unit_03", "current_delay") and not delay.allowed_for
    assert abs(zero.value) == pytest.approx(0.12, abs=0.05) and (zero.value > 0.0) == (zero.recording == "chirp")
    assert abs(delay.value) == pytest.approx(4e-4, rel=0.5) and (delay.value > 0.0) == (delay.recording == "step")


def test_what_recordings_disagree_in_is_said(disagreeing):
    lines = notes(disagreeing)
    assert any(
        re.match(r"unit_02: recording \w+ disagrees .* zero of its current .* A; this is allowed", one) for one in lines
    )
    assert [one["unit"] for one in disagreeing.to_dict()["of_recordings"]] == ["unit_02", "unit_03"]
    assert any(one.startswith("unit_03: ") and "undo that delay" in one for one in lines)
    assert sentences(disagreeing) == [
        "nothing is found in which the others differ",
        "in what unit_03 may differ is not told, as recordings of one unit disagree",
    ]


def test_two_units_with_one_recording_each_say_what_cannot_be_known():
    fitted, _ = units_of(2, {(1, BACKLASH): 1.2}, seed=3)
    found = compare_units({name: given[:1] for name, given in fitted.items()}, ACTUATOR)
    assert any("one recording" in line for line in found.warnings)
    assert "unit_01 and unit_02 differ in transmission backlash" in sentences(found)[0]


def test_a_unit_alone_is_calibrated_as_it_would_be_without_others():
    fitted, _ = units_of(1, {})
    unit = unit_of("one", fitted["unit_01"], ACTUATOR)
    alone = calibrate(unit.model, unit.floors, free=unit.parameters)
    found = fit(unit)
    assert found.calibration.x == pytest.approx(alone.x)
    assert found.x == pytest.approx(2.0 * alone.x[: len(unit.parameters)])
    path = unit.parameters[0]
    assert alone.parameters[path].initial == wider(ACTUATOR).value(path) == ACTUATOR.value(path)


def test_a_unit_that_differs_by_much_in_one_parameter_is_not_left_where_several_would_do():
    """Where the others are, a torque constant that is 2 tolerances off looks like voltage, inertia and friction."""
    path = "motor.torque_constant_Nm_A"
    fitted, _ = units_of(2, {(1, path): -2.0}, seed=5)
    unit = unit_of("two", fitted["unit_02"], ACTUATOR)
    begun, place = fit(unit), unit.parameters.index(path)
    shared = np.concatenate([SHARED, np.zeros(len(unit.parameters) - len(SHARED))])
    at = At(unit, begun.starts, linearised(unit, shared, starts=begun.starts), ())
    several = shared.copy()
    several[[unit.parameters.index(name) for name in ("inverter.bus_voltage_V", "motor.inertia_kgm2")]] += 0.4
    found = simpler(at, several, shared, 30.0) - shared
    assert -4.0 < found[place] < -1.0 and np.count_nonzero(found) == 1  # further passes begin from there
    assert simpler(at, several, shared, -1e9) is several  # one alone is far from as good


@pytest.mark.long
@pytest.mark.parametrize("seed", [60003, 60004])
def test_a_unit_far_from_the_others_does_not_lead_the_search_astray(seed):
    """Torque constant and bus voltage differ by a tolerance: the unit must not be linearised as the others are."""
    fleet = draw(ACTUATOR, seed, units=5, size=5.0)
    every = [recorded(fleet.unit(i), seed, i) for i in range(5)]
    fitted = {name: [one[run] for run in fleet.runs] for name, one in zip(fleet.names, every)}
    found = compare_units(fitted, ACTUATOR, seed=seed)
    true = {(fleet.names[unit], one.parameter) for one in fleet.differences for unit in one.units}
    assert {(one.unit, one.parameter) for one in found.differences} == true
    assert ("motor.torque_constant_Nm_A" in {path for _, path in true}) and len(true) >= 2


@pytest.mark.long
def test_the_work_grows_with_the_units_and_no_faster(monkeypatch):
    """Linearisations are what costs: as many for each of six units as for each of three, and a fit each."""
    counted = {}
    real_fit, real_line = fitting.fit, fitting.linearised
    for count in (3, 6):
        calls = {"fit": 0, "linearised": 0}

        def fitted_(*given, calls=calls):
            calls["fit"] += 1
            return real_fit(*given)

        def line(unit, x, seed, rounds, *rest, calls=calls):
            calls["linearised"] += 1
            return real_line(unit, x, seed, 1, *rest)

        monkeypatch.setattr("ema_model.fleet.compare.fit", fitted_)
        monkeypatch.setattr(fitting, "linearised", line)
        recordings, _ = units_of(count, {}, seed=5)
        compare_units({name: given[:1] for name, given in recordings.items()}, ACTUATOR)
        counted[count] = calls
    assert counted[6] == {key: 2 * value for key, value in counted[3].items()}
