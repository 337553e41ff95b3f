"""`emaviz actuator`: every shipped actuator described by options alone; what one lacks; the reference of all keys."""

from __future__ import annotations

import builtins
import io
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.documents import result_of
from worked_actuators import BALL_SCREW, WORKED

from ema_model.actuator import load_actuator, save_actuator
from ema_model.actuator.parameters import (
    ENTRY,
    HEAD,
    KINDS,
    SECTIONS,
    TABLES,
    Facts,
    facts_of,
    is_said,
    layout,
    numbers,
    on_axes,
    says_drive,
    unread,
)
from ema_model.actuator.reference import kinds_of_actuators, markdown, parameter_rows
from ema_model.commands import command
from ema_model.effects.user.torque import KEYS as USERS
from ema_model.quantities import Axes
from ema_model.recordings import Measurement, write_measurement
from ema_model.simulation.run import Run, simulate_monitor
from emaviz.cli import main

SHIPPED = Path(__file__).parents[2] / "assets" / "actuators"


def new(path, *options) -> int:
    return main(["actuator", "new", str(path), *options])


def check(path, *more, capsys) -> dict:
    """The result of `actuator check` as JSON."""
    out = Path(path).with_suffix(".json")
    assert main(["actuator", "check", str(path), *map(str, more), "--json", str(out)]) == 0
    capsys.readouterr()
    return result_of(out, "actuator check")


@pytest.mark.parametrize("name", WORKED)
def test_every_shipped_actuator_can_be_described_by_options_alone(name, tmp_path, capsys):
    path = tmp_path / "mine.toml"
    assert new(path, *WORKED[name]) == 0
    assert load_actuator(path) == load_actuator(SHIPPED / f"{name}.toml")
    assert sorted(WORKED) == sorted(file.stem for file in SHIPPED.glob("*.toml")), "a shipped one without its options"


@pytest.mark.long
def test_described_axis_simulates_as_the_shipped_one(tmp_path, capsys):
    path = tmp_path / "mine.toml"
    new(path, *BALL_SCREW)
    run = Run(command("sine", {"amplitude_rad": 0.02, "frequency_Hz": 2.0}), 0.5, 2000.0)
    mine, shipped = (simulate_monitor(run, load_actuator(file)) for file in (path, SHIPPED / "ball_screw.toml"))
    for name in shipped.signals:
        np.testing.assert_array_equal(mine[name], shipped[name])
    # 20 mm at 2 Hz: follows with the lag of Kv = 30 1/s, within its end stops
    assert 0.015 < np.ptp(mine["user_position_rad"]) / 2.0 < 0.02
    assert np.max(np.abs(mine["motor_position_rad"])) == pytest.approx(
        np.max(np.abs(mine["user_position_rad"])) * 2 * np.pi / 0.01, rel=0.01
    )


def test_file_says_what_its_keys_mean_and_offers_the_rest(tmp_path, capsys):
    path = tmp_path / "mine.toml"
    assert new(path, "--controller=unknown", "--motor=linear", "--user=linear", "--set=motor.mass_kg=3±10%") == 0
    text = path.read_text()
    entry = next(line for line in text.splitlines() if line.startswith("mass_kg"))
    assert facts_of("motor.inertia_kgm2", Axes("linear", "linear")).meaning in entry and "[kg]" in entry
    assert any(line.startswith("# current_bias_A = 0.0") for line in text.splitlines())
    idle = [line for line in text.splitlines() if line.startswith("# ") and " = " in line.partition("  #")[0]]
    path.write_text("\n".join(line.removeprefix("# ") if line in idle else line for line in text.splitlines()))
    load_actuator(path)  # each of them may be taken as it stands


@pytest.mark.parametrize(("controller", "drive"), kinds_of_actuators())
def test_kinds_alone_make_a_file_whose_guesses_are_told(controller, drive, tmp_path, capsys):
    path = tmp_path / "mine.toml"
    assert new(path, f"--controller={controller}", f"--drive={drive}") == 0
    actuator = load_actuator(path)
    assert actuator.controller.kind == controller
    found = check(path, capsys=capsys)
    assert any("motor.inertia_kgm2" in line and "guess" in line for line in found["missing"])
    assert not found["implausible"]
    save_actuator(actuator.with_values({"motor.inertia_kgm2": 2e-4}), path)
    assert not any("inertia" in line for line in check(path, capsys=capsys)["missing"])


AXES_GIVEN = [(), ("--user=linear", "--lead-mm=10")]
DRIVES_GIVEN = [(), *((f"--drive={one}",) for one in (*KINDS["inverter"], "unknown"))]


@pytest.mark.parametrize("axes", AXES_GIVEN, ids=str)
@pytest.mark.parametrize("controller", KINDS["controller"])
def test_every_file_that_is_written_passes_its_own_check(controller, axes, tmp_path, capsys):
    """Of every pair of controller and drive, with all that may be said of it or nothing."""
    for number, drive in enumerate(DRIVES_GIVEN):
        path = tmp_path / f"{number}.toml"
        if new(path, f"--controller={controller}", *drive, *axes) == 2:
            assert "[inverter]" in capsys.readouterr().err and not path.exists()
            continue
        written = capsys.readouterr().out
        if drive and drive[0] != "--drive=unknown" and f'kind = "{drive[0][8:]}"' not in path.read_text():
            assert f"! {drive[0].replace('=', ' ')} is left out" in written
        if f"controller {controller}," not in written:
            assert f"! --controller {controller} is left out" in written
        actuator = load_actuator(path)
        check(path, capsys=capsys)
        shown = actuator.axes
        kinds = {"controller": actuator.controller.kind, "inverter": actuator.inverter.kind}
        silent = unread(**kinds)
        every = [f"{section}.{name}" for section in SECTIONS for one in layout(section, kinds) for name in one]
        values = {
            path: actuator.value(path)
            for path in every
            if path not in silent and abs(actuator.value(path)) < 1e8 and is_said(path, actuator.value(path))
        }
        said = [f"--set={on_axes(one, shown).path}={value!r}" for one, value in values.items()]
        said = [one for one in said if not (axes and "gear_ratio" in one)]
        again = tmp_path / f"{number}_said.toml"
        assert new(again, f"--controller={controller}", *drive, *axes, "--sample-rate=50", *said) == 0, (
            capsys.readouterr().err
        )
        other = load_actuator(again)
        fitting = {"name": actuator.name, "tolerances": {}, "step_s": actuator.step_s, "filter_s": actuator.filter_s}
        assert replace(other, **fitting) == replace(actuator, tolerances={})
        check(again, capsys=capsys)


def settings_of(path) -> dict:
    return tomllib.loads(path.read_text(encoding="utf-8"))["model"]


@pytest.mark.parametrize(
    ("options", "step_s"),
    [
        (["--controller=position", "--drive=voltage"], 5e-4),
        (["--controller=position", "--drive=current"], 5e-4),
        (["--controller=position", "--drive=voltage", "--sample-rate=50"], 5e-4),
        (["--controller=position", "--drive=voltage", "--sample-rate=500"], 1e-4),
        (["--controller=position", "--drive=voltage", "--set=controller.gain_1_rad=1e4"], 1e-5),
        (["--controller=position", "--drive=voltage", "--set=motor.inertia_kgm2=1e-6"], 5e-5),
        (["--controller=position", "--drive=voltage", "--set=model.step_s=2e-5"], 2e-5),
        (["--controller=cascade", "--drive=current"], 5e-5),
        (["--controller=cascade", "--drive=current", "--set=controller.speed_gain_Nms_rad=0.5"], 2e-5),
        (["--controller=cascade", "--drive=hysteresis"], 1e-5),
        (["--controller=open"], 5e-5),
    ],
)
def test_the_step_fits_the_loop_and_the_sampling(options, step_s, tmp_path, capsys):
    path = tmp_path / "mine.toml"
    assert new(path, *options) == 0
    assert settings_of(path) == {"step_s": step_s, "torque_known": True}
    assert load_actuator(path).step_s == step_s


@pytest.mark.parametrize(("rate", "filter_s"), [(None, 0.012), (1000, 0.012), (50, 0.06), (30, 0.1), (1, 1.0)])
def test_the_filter_fits_the_sampling(rate, filter_s, tmp_path, capsys):
    path = tmp_path / "mine.toml"
    assert new(path, "--controller=unknown", *([f"--sample-rate={rate}"] if rate else [])) == 0
    assert settings_of(path) == {"filter_s": filter_s, "leaves_out_reversals": False, "torque_known": True}


def test_a_servo_moves_at_its_step_as_at_one_ten_times_smaller(tmp_path, capsys):
    """A hobby servo with friction, read by an encoder of 4096 steps a turn: apart by less than one of them."""
    values = {"torque_constant_Nm_A": 1, "inertia_kgm2": 5e-3, "viscous_friction_Nms_rad": 0.05}
    values |= {"static_friction_Nm": 0.06, "dynamic_friction_Nm": 0.05}
    said = [f"--set=motor.{name}={value}" for name, value in values.items()]
    path = tmp_path / "servo.toml"
    more = ["--set=controller.gain_1_rad=5", "--set=inverter.bus_voltage_V=6", "--sample-rate=50"]
    assert new(path, "--controller=position", "--drive=voltage", *said, *more) == 0
    servo = load_actuator(path)
    run = Run(command("chirp", {"amplitude_rad": 1.0, "start_Hz": 0.5, "end_Hz": 4.0, "end_time_s": 3.0}), 3.0, 100.0)
    coarse, fine = (simulate_monitor(run, one) for one in (servo, replace(servo, step_s=0.1 * servo.step_s)))
    apart = np.abs(coarse["user_position_rad"] - fine["user_position_rad"])
    assert servo.step_s == 5e-4 and np.ptp(fine["user_position_rad"]) > 1.0
    assert np.sqrt(np.mean(apart**2)) < 2 * np.pi / 4096


def test_nothing_that_is_given_is_left_out_silently(tmp_path, capsys):
    path = tmp_path / "mine.toml"
    held = "--set=motor.static_friction_Nm=0.09"
    for text, sigma in (("±20%", 0.018), ("±0.02", 0.02), ("", None)):
        assert new(path, "--force", "--controller=unknown", held + text) == 0
        tolerance = load_actuator(path).tolerances.get("motor.static_friction_Nm")
        assert (tolerance and tolerance.sigma) == (sigma and pytest.approx(sigma))
    capsys.readouterr()
    out = tmp_path / "new.json"
    assert new(path, "--force", "--controller=unknown", "--drive=voltage", "--json", str(out)) == 0
    line = "--drive voltage is left out: inverse dynamics has none"
    assert f"! {line}" in capsys.readouterr().out and result_of(out, "actuator new")["notes"] == [line]
    assert new(path, "--force", "--controller=position") == 0
    assert "--drive is not given: voltage, " in capsys.readouterr().out
    assert load_actuator(path).inverter.kind == "voltage"
    assert new(path, "--force", "--controller=position", "--gear=500:1 ± 1%") == 0
    assert load_actuator(path).tolerances["transmission.gear_ratio"].sigma == pytest.approx(2e-5)


def test_questions_on_a_terminal_make_the_same_file(tmp_path, capsys, monkeypatch):
    answers = {
        "Does the motor": "",
        "Does what it moves": "linear",
        "Which controller": "casc",
        "Which drive": "current",
        "Transmission gear ratio": f"{0.01 / (2 * np.pi)!r}",
    }
    for path, value in (one.removeprefix("--set=").split("=") for one in BALL_SCREW if one.startswith("--set=")):
        inside = next(p for p in _paths() if on_axes(p, Axes("rotary", "linear")).path == path)
        answers[on_axes(inside, Axes("rotary", "linear")).title] = value
    asked = []

    def answer(question: str) -> str:
        asked.append(question)
        matching = [name for name in answers if question.startswith(name)]
        return answers[max(matching, key=len)] if matching else ""

    monkeypatch.setattr(builtins, "input", answer)
    monkeypatch.setattr(sys, "stdin", type("Terminal", (io.StringIO,), {"isatty": lambda self: True})())
    asked_for, given = tmp_path / "asked.toml", tmp_path / "given.toml"
    assert new(asked_for) == 0 and new(given, *BALL_SCREW) == 0
    mine, other = load_actuator(asked_for), load_actuator(given)
    assert len(asked) < 25
    # what is not needed is not asked for: play, stops and sensors are in the file to be taken
    rest = {"transmission": other.transmission, "sensors": other.sensors, "tolerances": other.tolerances}
    assert mine.transmission.gear_ratio == other.transmission.gear_ratio
    assert replace(mine, **rest, name="", description="") == replace(other, name="", description="")


def _paths() -> list[str]:
    return [f"{section}.{name}" for section in SECTIONS for name in numbers(section)]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"motor.inertia_kgm2": 130.0}, "in g·cm² it would be 1.30·10⁻⁵ kg·m²"),
        ({"controller.speed_limit_rad_s": 80000.0}, "in rpm it would be 8378 rad/s"),
        ({"motor.inductance_H": 720.0}, "in µH it would be 0.000720 H"),
        ({"motor.static_friction_Nm": 0.01}, "what stands is held by no less than what moves"),
        ({"motor.static_friction_Nm": 2.0, "motor.dynamic_friction_Nm": 2.0}, "it cannot move"),
        ({"controller.torque_constant_Nm_A": 0.15}, "the controller counts with another motor"),
        ({"controller.speed_limit_rad_s": 2000.0}, "the motor's back-EMF takes the whole supply"),
        ({"controller.speed_gain_Nms_rad": 5.0}, "too fast for steps of"),
    ],
)
def test_what_is_hard_to_believe_is_told(change, says, tmp_path, capsys):
    path = tmp_path / "mine.toml"
    save_actuator(load_actuator().with_values(change), path)
    assert any(says in line for line in check(path, capsys=capsys)["implausible"])


def test_shipped_actuators_are_believed(capsys, tmp_path):
    for file in SHIPPED.glob("*.toml"):
        path = tmp_path / file.name
        path.write_text(file.read_text())
        assert not check(path, capsys=capsys)["implausible"], file.name


def test_what_a_recording_cannot_tell_is_told(tmp_path, capsys):
    """A free inverse-dynamics motor: torque constant, inertia and friction show by their ratios alone."""
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 4.0, 2e-3)
    position = 30.0 * np.sin(2.0 * np.pi * (0.5 * time + 0.3 * time**2))
    speed = np.gradient(position, time)
    torque = 2e-4 * np.gradient(speed, time) + 0.02 * np.sign(speed)
    current = torque / 0.05 + 0.01 * rng.standard_normal(len(time))
    signals = {"time_s": time, "motor_position_rad": position, "current_A": current}
    write_measurement(Measurement(signals), tmp_path / "free.csv")
    path = tmp_path / "mine.toml"
    loose = [f"--set=motor.{name}±30%" for name in ("torque_constant_Nm_A=0.05", "inertia_kgm2=2e-4")]
    more = ["--set=motor.dynamic_friction_Nm=0.02±30%", "--set=motor.viscous_friction_Nms_rad=0±1e-5"]
    assert new(path, "--controller=unknown", *loose, *more) == 0
    found = check(path, tmp_path / "free.csv", capsys=capsys)["unidentifiable"]
    assert any("motor.torque_constant_Nm_A: free does not tell it from motor.inertia_kgm2" in line for line in found)
    assert not any("viscous" in line.partition(":")[0] for line in found)
    known = [one.replace("0.05±30%", "0.05 fixed") for one in loose]
    assert new(path, "--force", "--controller=unknown", *known, *more) == 0
    assert not check(path, tmp_path / "free.csv", capsys=capsys)["unidentifiable"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ([], "say --controller"),
        (["--controller=cascade", "--drive=voltage"], "a cascade needs kind"),
        (["--controller=unknown", "--set=motor.inerta=3"], "[motor] has no parameter 'inerta'"),
        (["--controller=unknown", "--set=motor.inertia_kgm2=3,5"], "write a number, or value±tolerance"),
        (["--controller=unknown", "--set=motor.inertia_kgm2=-3"], "must be above 0"),
        (["--controller=unknown", "--set=motor=3"], "write it as section.name=value"),
        (["--controller=unknown", "--effect=nothing:a=1"], "no effect 'nothing'"),
        (["--controller=unknown", "--effect=cogging_torque:a"], "write it as name=value"),
        (["--controller=unknown", "--where=kp100"], "write it as PATTERN:"),
        (["--controller=unknown", "--where=kp100:motor.x=1"], "no parameter 'motor.x'"),
        (["--controller=unknown", "--gear=a/b"], "--gear"),
        (["--controller=unknown", "--gear=0/1"], "--gear"),
        (["--controller=unknown", "--gear=1", "--lead-mm=10"], "give one of them"),
        (["--controller=unknown", "--set=model.step=1"], "[model] has no 'step'"),
        (["--controller=position", "--set=model.step_s=1e-4±5%"], "--set model.step_s: write a number without"),
        (["--controller=unknown", "--set=faults.k1=0.3±0.1"], "--set faults.k1: write a number without a tolerance"),
        (["--controller=unknown", "--where=*a*:motor.inertia_kgm2=1±5%"], "write a number without a tolerance"),
        (["--controller=unknown", "--gear=500:1±0.1"], "write the tolerance of a ratio in %"),
        (["--controller=unknown", "--gear=2", "--set=transmission.gear_ratio=3"], "gear_ratio is given twice"),
        (["--controller=unknown", *["--set=motor.inertia_kgm2=3"] * 2], "motor.inertia_kgm2 is given twice"),
        (["--controller=unknown", *["--effect=cogging_torque:order=3"] * 2], "effects.cogging_torque is given twice"),
        (
            ["--controller=unknown", "--effect=cogging_torque:order=3", "--set=effects.cogging_torque.order=4"],
            "no effect 'cogging_torque.order'",
        ),
    ],
)
def test_a_mistake_is_one_line(options, says, tmp_path, capsys):
    assert new(tmp_path / "mine.toml", *options) == 2
    told = capsys.readouterr().err
    assert says in told and told.count("\n") == 1 and not (tmp_path / "mine.toml").exists()


def test_reference_is_what_is_shipped_and_has_every_key():
    assert (SHIPPED / "KEYS.md").read_text(encoding="utf-8") == markdown() + "\n", "emaviz actuator keys > KEYS.md"
    text = markdown()
    rows = {row.path: row for row in parameter_rows()}
    assert set(rows) == set(_paths())
    for keys in (HEAD, ENTRY, *TABLES.values(), *USERS.values()):
        assert all(f"`{key}`" in text for key in keys)
    for path, row in rows.items():
        assert isinstance(facts_of(path, Axes()), Facts) and row.meaning
        section, _, name = path.partition(".")
        for controller, drive in kinds_of_actuators():
            shown = f"{controller} + {drive}" if says_drive(controller, drive) else controller
            read = name in sum(layout(section, {"controller": controller, "inverter": drive}), ())
            assert (shown in row.kinds) == (read and path not in unread(controller, drive)), (path, shown)


@pytest.mark.parametrize("axes", [Axes(), Axes("rotary", "linear"), Axes("linear", "linear")], ids=str)
def test_facts_agree_with_each_other(axes):
    for path in _paths():
        facts = facts_of(path, axes)
        far = abs(facts.guess) >= 1e9
        assert facts.low < facts.high and (far or facts.low <= facts.guess <= facts.high), path
        assert not (facts.tolerance and facts.sigma), path
        assert not facts.follows or facts.follows in _paths(), path


SCREW = ("--user=linear", "--lead-mm=10", "--controller=cascade", "--drive=current")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ((*SCREW, "--set=controller.position_gain_1_s=40"), "40.0 1/s of either side alone is 25133 rad/(m·s) here"),
        ((*SCREW, "--set=controller.position_gain_1_s=25133"), None),
        ((*SCREW, "--set=controller.position_gain_1_s=1.6e7"), "a position loop of 25465 1/s"),
        (("--controller=cascade", "--gear=1/500", "--set=controller.position_gain_1_s=40"), "is 20000 1/s here"),
        ((*SCREW, "--set=controller.position_gain_1_s=6e5"), "which is slower: it would swing"),
        (
            ("--controller=position", "--drive=current", "--set=controller.gain_1_rad=1e-3", "--gear=1/5000"),
            "1/rad makes",
        ),
    ],
)
def test_a_position_gain_is_checked_in_its_unit(options, said, tmp_path, capsys):
    """On mixed axes it holds 2π over the lead: a loop of 40 1/s is 628 times as much in rad/(m·s)."""
    path = tmp_path / "mine.toml"
    assert new(path, *options) == 0
    capsys.readouterr()
    found = [line for line in check(path, capsys=capsys)["implausible"] if "position loop" in line]
    assert not found if said is None else len(found) == 1 and said in found[0], found
