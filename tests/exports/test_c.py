"""The exported C, and Python, give the monitor model's signals: of actuators, of each effect, of users' own effects."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.actuator.file import cannot_represent
from ema_model.effects import CATALOGUE
from ema_model.effects.user import torque_curve, user_torque
from ema_model.exports import c, python
from ema_model.exports.exported import exported
from ema_model.exports.replay import EXACT, proof_of, replayed, shortened
from ema_model.physics.rows import LANES
from ema_model.recordings import Measurement
from ema_model.simulation.pack import initial_state
from ema_model.simulation.run import Run, simulate_monitor

ACTUATORS = Path(__file__).parents[2] / "assets" / "actuators"
PYTHON_STEPS = 1500


def silent(text: str) -> None:
    """Of a proof's progress."""


def written(actuator, folder):
    """What is exported, as C and Python in a folder."""
    one = exported(actuator)
    for suffix, text in (("h", c.header(one)), ("c", c.source(one)), ("py", python.source(one))):
        (folder / f"{one.name}.{suffix}").write_text(text, encoding="utf-8")
    return one


def moves(proof):
    """Whether the motor does, in any of the runs."""
    return any(np.ptp(shown["motor_position_rad"]) > 0.0 for shown in proof.ours)


def differences(actuator, folder, recordings=()):
    """The most that C and Python differ from the monitor model by."""
    one = written(actuator, folder)
    proof = proof_of(one, list(recordings), silent)
    assert moves(proof), "nothing moves, nothing is proved"
    short = shortened(proof, PYTHON_STEPS)
    found = []
    for part, export in ((proof, c.CompiledC(one, folder)), (short, python.ImportedPython(one, folder))):
        losses = replayed(part, export, silent)
        found.append(max(one.difference for loss in losses for one in loss.signals.values()))
    return found


@pytest.mark.parametrize("name", ["thesis", "xl330"])
def test_c_and_python_are_the_model(name, tmp_path):
    assert max(differences(load_actuator(ACTUATORS / f"{name}.toml"), tmp_path)) <= EXACT


@pytest.mark.long
@pytest.mark.parametrize("name", ["ball_screw", "odrive"])
def test_of_other_actuators(name, tmp_path):
    assert max(differences(load_actuator(ACTUATORS / f"{name}.toml"), tmp_path)) <= EXACT


@pytest.mark.study
@pytest.mark.parametrize("name", ["thesis", "xl330"])
@pytest.mark.parametrize("effect", CATALOGUE)
def test_of_each_effect(name, effect, tmp_path):
    actuator = load_actuator(ACTUATORS / f"{name}.toml")
    if reason := cannot_represent(actuator, effect):
        pytest.skip(reason)
    clear = CATALOGUE[effect].on(actuator.axes).at_severity(1)
    first = next(iter(clear))
    # what is clear on the library's own machine holds a small servo still
    for share in (1.0, 0.1, 10.0):
        settings = {**clear, first: share * clear[first]}
        with_it = replace(actuator, effects={**actuator.effects, effect: settings})
        if moves(proof_of(exported(with_it), [], silent)):
            break
    found = differences(with_it, tmp_path)
    print(f"\n{name} {effect}: C {found[0]:.1e}, Python {found[1]:.1e}")
    assert max(found) <= EXACT


@pytest.mark.long
def test_of_what_users_write(tmp_path):
    torque = user_torque("-c*omega*abs(omega) + A*sin(7*theta)**3 + tanh(q)*min(t, 2)**0.5 - c*exp(-user)")
    curve = torque_curve([0.01, -0.02, 0.01, 0.0], 0.0, 2.0 * np.pi, modulator="sign_speed")
    level = torque_curve([0.01, -0.02, 0.01, 0.0], -0.5, 0.5, "omega")
    own = {one.name: {p.name: p.default for p in one.parameters} for one in (curve, level)}
    own[torque.name] = {"c": 1e-7, "A": 0.01}
    assert max(differences(replace(load_actuator(), effects=own), tmp_path)) <= EXACT


def test_faults_and_a_start_in_motion_are_those_of_the_model(tmp_path):
    actuator = replace(load_actuator(), faults={"k1": 0.3, "k2": 0.5, "k3": 0.2, "k6": 0.3, "k7": 0.1, "k8": 0.7})
    seen = simulate_monitor(Run(), actuator)
    late = Measurement({name: values[1500:3000] for name, values in seen.signals.items()}, name="late")
    assert max(differences(actuator, tmp_path, [late])) <= EXACT


def test_init_is_the_kernels_start(tmp_path):
    actuator = load_actuator(ACTUATORS / "xl330.toml")
    one = written(actuator, tmp_path)
    parameters = np.array([field.value for field in one.parameters])
    ours = initial_state(actuator, 1, 0.3, -2.0, 0.01, one.stack)[0].reshape(-1, LANES)[:, 0]
    begun = c.CompiledC(one, tmp_path).begin(parameters, 0.3, -2.0, 0.01)
    told = [field.name in ("user", "told") for field in one.states]
    assert begun[~np.array(told)] == pytest.approx(ours[~np.array(told)], abs=1e-15)
    assert begun[told] == pytest.approx([0.31, 0.31]), "kernels find what the sensors tell before their first step"


def test_a_difference_is_told_with_its_time(tmp_path):
    one = written(load_actuator(), tmp_path)

    class Wrong(c.CompiledC):
        """Another friction from the middle on."""

        def replay(self, state, parameters, run, period, step_s):
            half = len(run[0]) // 2
            first = super().replay(state, parameters, tuple(each[:half] for each in run), period, step_s)
            parameters[[field.name for field in one.parameters].index("dynamic_friction")] *= 1.01
            return np.vstack([first, super().replay(state, parameters, tuple(e[half:] for e in run), period, step_s)])

    (loss,) = replayed(proof_of(one, [], silent), Wrong(one, tmp_path), silent)
    begins = loss.signals["current_A"].begins_s
    assert loss.signals["current_A"].difference > EXACT and begins == pytest.approx(0.25, abs=0.002)


def test_a_program_of_two_actuators_links(tmp_path):
    """Every name of one begins with its own, and nothing is asked of the other."""
    names = [written(load_actuator(ACTUATORS / f"{name}.toml"), tmp_path).name for name in ("thesis", "xl330")]
    loop = "\n".join(
        f"    {{ {n}_state s; {n}_init(&s, &{n}_defaults, 0.0, 0.0, 0.0);\n"
        f"      for (int i = 0; i < 100; i++) {n}_step(&s, &{n}_defaults, 0.1, 0.0, 1.0, {n.upper()}_STEP_S);\n"
        f'      printf("%.17g\\n", {n}_motor_position(&s, &{n}_defaults)); }}'
        for n in names
    )
    includes = "\n".join(f'#include "{n}.h"' for n in names)
    (tmp_path / "main.c").write_text(f"#include <stdio.h>\n{includes}\nint main(void)\n{{\n{loop}\n    return 0;\n}}\n")
    sources = [str(tmp_path / f"{n}.c") for n in (*names, "main")]
    subprocess.run(["cc", *c.FLAGS, "-pedantic", "-o", str(tmp_path / "both"), *sources, "-lm"], check=True)
    told = subprocess.run([str(tmp_path / "both")], check=True, capture_output=True, text=True).stdout.split()
    assert len(told) == 2 and float(told[0]) > 0.0


def test_joints_side_by_side_in_python_are_those_alone(tmp_path):
    one = written(load_actuator(), tmp_path)
    module = python.ImportedPython(one, tmp_path).module
    model = module.Model()
    together = model.begin(np.array([0.0, 1e-3]))
    apart = [model.begin(np.array([start])) for start in (0.0, 1e-3)]
    for step in range(200):
        together = model.step(together, 2e-3 + 1e-6 * step)
        apart = [model.step(state, 2e-3 + 1e-6 * step) for state in apart]
    assert together.theta.tolist() == [float(state.theta[0]) for state in apart]


@pytest.mark.parametrize("effect", ["stribeck_friction", "sampled_control", "pendulum_load"])
def test_torch_gives_numpys_numbers(effect, tmp_path):
    torch = pytest.importorskip("torch", reason="torch is in no lock; the exported Python takes it, too")
    settings = CATALOGUE[effect].at_severity(1)
    one = written(replace(load_actuator(ACTUATORS / "thesis.toml"), effects={effect: settings}), tmp_path)
    module = python.ImportedPython(one, tmp_path).module

    def shown(arrays, array):
        model = module.Model(arrays)
        state = model.begin(array([0.0, 1e-3]))
        for _ in range(100):
            state = model.step(state, array([2e-3, 5e-3]))
        return [np.asarray(values).tolist() for values in model.shown(state).values()]

    assert shown(torch, lambda x: torch.tensor(x, dtype=torch.float64)) == shown(np, np.array)


def test_a_joint_that_a_simulator_moves_takes_the_torque(tmp_path):
    """A simulator that integrates the joint with the inertia as armature and the dry friction moves as ours."""
    actuator = replace(load_actuator(ACTUATORS / "xl330.toml"), effects={})
    one = written(actuator, tmp_path)
    model = python.ImportedPython(one, tmp_path).module.Model()
    dt, inertia = one.step_s, actuator.motor.inertia_kgm2
    state, whole = model.begin(np.array([0.0])), model.begin(np.array([0.0]))
    position = speed = np.array([0.0])
    apart = 0.0
    for step in range(1000):
        command = 0.5 * np.sin(2.0 * np.pi * step * dt)
        torque, friction = model.torque(state, command, position, speed, dt)
        free = speed + dt * torque / inertia
        speed = np.sign(free) * np.maximum(np.abs(free) - dt * friction / inertia, 0.0)
        position = position + dt * speed
        whole = model.step(whole, command)
        apart = max(apart, abs(position[0] - model.shown(whole)["user_position_rad"][0]))
    assert apart < 2e-3 < abs(position[0])
