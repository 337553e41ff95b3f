"""The exported joint moves in MuJoCo as ours does, as far as MuJoCo can hold it; what it cannot is told; and back."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import ema_model as em
from ema_model.actuator import load_actuator
from ema_model.effects.user import torque_curve, user_torque
from ema_model.exports import mjcf
from ema_model.exports.exported import exported
from ema_model.exports.replay import proof_of
from ema_model.recordings import Measurement
from emaviz.cli import main

ACTUATORS = Path(__file__).parents[2] / "assets" / "actuators"

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not in the test lock: pip install 'emaviz[export]'")


def silent(text: str) -> None:
    """Of a proof's progress."""


def unfitted(actuator, recordings=()) -> dict[str, float]:
    """The most that MuJoCo's joint differs by with the model's own values, of each signal's greatest value."""
    proof = proof_of(exported(actuator), list(recordings), silent)
    (loss,) = mjcf.replayed_in_mujoco(proof, {}, silent)
    return {name: one.difference for name, one in loss.signals.items()}


def bare(name: str):
    """A shipped actuator without what MuJoCo has no form for."""
    actuator = load_actuator(ACTUATORS / f"{name}.toml")
    motor = replace(actuator.motor, static_friction_Nm=actuator.motor.dynamic_friction_Nm)
    return replace(actuator, motor=motor, transmission=replace(actuator.transmission, backlash_rad=0.0))


@pytest.mark.parametrize(("name", "most"), [("xl330", 2e-3), ("odrive", 2e-3), ("ball_screw", 3e-3), ("thesis", 3e-3)])
def test_what_mujoco_can_hold_moves_as_ours(name, most):
    found = unfitted(bare(name))
    assert found["user_position_rad"] < most and found["current_A"] < 0.04


@pytest.mark.parametrize(
    ("effect", "settings"),
    [
        ("viscous_friction", {"coefficient_Nms_rad": 0.01}),
        ("dry_friction", {"torque_Nm": 0.05}),
        ("hinge_moment", {"stiffness_Nm_rad": 0.3, "offset_Nm": 0.05}),
        ("constant_load", {"torque_Nm": 0.1}),
        ("cogging_torque", {"amplitude_Nm": 0.02, "order": 5.0, "phase_rad": 0.4}),
        ("inertia_error", {"ratio": 0.3}),
        ("demagnetisation", {"ratio": 0.15}),
        ("winding_resistance", {"ratio": 0.4}),
        ("goal_delay", {"delay_s": 0.02}),
        ("presliding_friction", {"stiffness_Nm_rad": 5.0, "damping_Nms_rad": 0.02}),
        ("pendulum_load", {"moment_Nm": 0.2, "angle_rad": 0.3}),
        ("stribeck_friction", {"speed_rad_s": 2.0, "breakaway_ratio": 2.0}),
        ("speed_loop_gain", {"ratio": -0.6}),
    ],
)
def test_each_effect_that_it_holds(effect, settings):
    """With the effect MuJoCo is near, and without it, far: so that its form is seen to do something."""
    actuator = replace(bare("ball_screw" if effect == "speed_loop_gain" else "xl330"), effects={})
    with_effect = replace(actuator, effects={effect: settings})
    near = unfitted(with_effect)["user_position_rad"]
    one, other = (proof_of(exported(it), [], silent).ours[0]["user_position_rad"] for it in (with_effect, actuator))
    shows = np.max(np.abs(one - other)) / np.max(np.abs(one))
    assert effect in mjcf.HELD and near < 0.02 and near < 0.2 * shows


def test_what_it_cannot_hold_is_told_and_made_up_for(tmp_path):
    """Load-dependent friction has no form: its share is told, and the fit takes back most of what it costs."""
    actuator = replace(
        bare("xl330"), effects={"load_dependent_friction": {"ratio": 0.25}, "dead_time": {"voltage_V": 0.05}}
    )
    proof = proof_of(exported(actuator), [], silent)
    shown = {name: values for name, values in proof.ours[0].items() if name != "current_A"}
    noise = np.random.default_rng(1).normal(0.0, 1e-3, len(shown["user_position_rad"]))
    run = proof.model.recorded[0]
    seen = run.with_signals(
        user_position_rad=np.append(run["user_position_rad"][:1], shown["user_position_rad"] + noise)
    )
    recorded = Measurement({name: seen[name] for name in ("time_s", "command_rad", "user_position_rad")}, name="arm")
    result = em.export(actuator, tmp_path / "home", ["mjcf"], recorded, name="arm")
    (found,) = result.targets
    shares = {one.what: one.share for one in found.cannot_hold}
    assert shares["load-dependent friction"] > shares["dead time"] > 0.01
    assert "MuJoCo cannot hold load-dependent friction (" in str(result) and "Fitted by replay" in str(result)
    raw = mjcf.replayed_in_mujoco(proof_of(exported(actuator), [recorded], silent), {}, silent)[0]
    assert found.signals["user_position_rad"].rmse < 0.5 * raw.signals["user_position_rad"].rmse
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "home" / "arm.xml")).njnt == 1


def test_users_own_torques_are_told(tmp_path):
    """A curve is left out by its knots; of an expression nobody knows what would be nothing, and it is named alone."""
    curve, torque = torque_curve([0.02, -0.02, 0.03], -0.5, 0.5, "user"), user_torque("0.01*sin(3*theta)")
    effects = {curve.name: {p.name: p.default for p in curve.parameters}, torque.name: {}}
    result = em.export(replace(bare("xl330"), effects=effects), tmp_path / "home", ["mjcf"])
    shares = {one.what: one.share for one in result.targets[0].cannot_hold}
    assert shares["torque curve"] > 0.01 and np.isnan(shares["user's torque"])
    assert result.to_dict()["export"]["mjcf"]["cannot_hold"][-1] == {"what": "user's torque", "share": None}


def test_a_drive_that_is_off_lets_the_joint_go(tmp_path):
    """The recorded drive is off from the middle on: MuJoCo's joint has no motor from there."""
    actuator = load_actuator(ACTUATORS / "xl330.toml")
    time = np.linspace(0.0, 1.0, 501)
    recorded = Measurement(
        {
            "time_s": time,
            "command_rad": np.full_like(time, 0.8),
            "user_position_rad": np.zeros_like(time),
            "drive_enabled": (time < 0.5).astype(float),
        },
        name="drop",
    )
    assert unfitted(actuator, [recorded])["user_position_rad"] < 5e-3


# --- and back ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["xl330", "odrive", "thesis"])
def test_a_joint_comes_back_as_the_actuator(name, tmp_path):
    """What was exported and read again moves as before, with nothing but numbers' rounding between."""
    actuator = bare(name)
    if name == "xl330":
        actuator = replace(actuator, effects={"hinge_moment": {"stiffness_Nm_rad": 0.5, "offset_Nm": 0.1}})
    proof = proof_of(exported(actuator, "one"), [], silent)
    file, back = tmp_path / "one.xml", tmp_path / "back.toml"
    file.write_text(mjcf.document(proof.one, mjcf.joints_of(proof)[0]), encoding="utf-8")
    assert main(["actuator", "new", str(back), "--from", f"{file}#one"]) == 0
    again = load_actuator(back)
    kinds = {"xl330": ("position", "voltage"), "odrive": ("open", "current"), "thesis": ("cascade", "current")}
    assert (again.controller.kind, again.inverter.kind) == kinds[name]
    tau = actuator.transmission.gear_ratio
    assert again.motor.inertia_kgm2 == pytest.approx(actuator.motor.inertia_kgm2 / tau**2, rel=1e-5)
    assert again.motor.dynamic_friction_Nm == pytest.approx(actuator.motor.dynamic_friction_Nm / tau, rel=1e-6)
    if name == "xl330":
        assert again.controller.gain_1_rad == pytest.approx(actuator.controller.gain_1_rad, rel=1e-6)
        assert again.inverter.bus_voltage_V == pytest.approx(7.4)
        assert again.effects["hinge_moment"] == pytest.approx(actuator.effects["hinge_moment"], rel=1e-6)
    if name == "thesis":
        assert again.controller.position_gain_1_s == pytest.approx(
            actuator.controller.position_gain_1_s * tau, rel=1e-6
        )


ROBOT = """
<mujoco><default><joint damping="2"/>
<default class="arm"><joint armature="0.01" frictionloss="0.5"/></default></default>
<worldbody><body><joint name="shoulder" class="arm" type="hinge" axis="0 1 0" range="-90 90"/>
<geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.04"/>
<body pos="0 0 0.3"><joint name="elbow" class="arm" axis="0 1 0"/><geom size="0.05"/>
<body><joint name="lift" type="slide" axis="0 0 1" damping="30"/><geom size="0.05"/>
<body><joint name="free" axis="1 0 0"/><geom size="0.03"/></body></body></body></body></worldbody>
<actuator><position name="p" joint="shoulder" kp="400" kv="20" forcerange="-50 50"/>
<motor joint="elbow" gear="50"/><position joint="lift" kp="900"/></actuator></mujoco>
"""


def test_joints_of_a_robot(tmp_path, capsys):
    file = tmp_path / "robot.xml"
    file.write_text(ROBOT)

    def read(joint: str):
        path = tmp_path / f"{joint}.toml"
        assert main(["actuator", "new", str(path), "--from", f"{file}#{joint}", "--force"]) == 0
        return load_actuator(path), capsys.readouterr().out

    shoulder, _ = read("shoulder")
    assert shoulder.controller.kind == "cascade" and shoulder.controller.position_gain_1_s == pytest.approx(20.0)
    assert shoulder.controller.speed_gain_Nms_rad == 20.0 and shoulder.current_limit_A == 50.0
    assert shoulder.motor.viscous_friction_Nms_rad == 2.0 and shoulder.motor.dynamic_friction_Nm == 0.5
    assert shoulder.motor.inertia_kgm2 > 0.05, "the links are what it moves, besides its armature"
    assert shoulder.transmission.stop_high_rad == pytest.approx(np.pi / 2.0)
    elbow, _ = read("elbow")
    assert elbow.controller.kind == "open" and elbow.transmission.gear_ratio == pytest.approx(0.02)
    assert elbow.motor.dynamic_friction_Nm == pytest.approx(0.01)
    lift, _ = read("lift")
    assert lift.controller.kind == "position" and lift.axes.user == "linear"
    free, told = read("free")
    assert free.controller.kind == "unknown" and "no actuator drives the joint" in told


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ("robot.xml", "say which joint"),
        ("robot.xml#elbo", "did you mean 'elbow'?"),
        ("none.xml#a", "no such file"),
        ("bad.xml#a", "MuJoCo cannot read it"),
    ],
)
def test_what_cannot_be_read(given, told, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.xml").write_text(ROBOT)
    (tmp_path / "bad.xml").write_text("<mujoco><bodies/></mujoco>")
    assert main(["actuator", "new", "new.toml", "--from", given]) == 2
    line = capsys.readouterr().err.strip()
    assert re.match(r"emaviz: .*", line) and told in line and "\n" not in line
    assert not (tmp_path / "new.toml").exists()
