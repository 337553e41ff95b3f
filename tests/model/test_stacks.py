"""Stacks of effects: composed right, compiled once, never stale, and safe from threads and processes."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import ema_model
from ema_model import kernel_cache, stacks
from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.effects import CATALOGUE
from ema_model.effects.effect import PLACES
from ema_model.errors import InputError
from ema_model.physics.rows import PARAMETER_ROWS
from ema_model.simulation.run import Run, simulate_monitor, simulate_reference
from ema_model.stacks import CIRCUITS, find_stack

PACKAGE = Path(ema_model.__file__ or "").parent if ema_model.__file__ else Path(stacks.__file__).parent
ACTUATOR = load_actuator()
RUN = Run(command("chirp"), 0.15, load_torque_Nm=5.0)
SATURATING = Run(command("step"), 0.1)
# Effects that show only where the voltage is at its limit.
AT_LIMITS = {"acceleration_limit", "bus_voltage_sag", "dead_time", "winding_resistance"}
MODELS = {"reference": simulate_reference, "monitor": simulate_monitor}
SIGNALS = ("current_A", "motor_position_rad", "motor_speed_rad_s", "user_position_rad")

# Effects whose first parameter, an amplitude, can be nought; the rest has no "off" but its absence.
SWITCHABLE = [e.name for e in CATALOGUE.values() if e.parameters[0].low == 0.0]


def assert_same(a, b, tolerance):
    for name in SIGNALS:
        scale = np.max(np.abs(b[name]))
        assert np.max(np.abs(a[name] - b[name])) <= tolerance * scale, name


# --- composition ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("effect", SWITCHABLE)
def test_effect_of_no_amplitude_is_no_effect(effect, model):
    first = CATALOGUE[effect].parameters[0].name
    run = SATURATING if effect in AT_LIMITS else RUN
    plain = MODELS[model](run, ACTUATOR)
    off = MODELS[model](run, ACTUATOR, effects={effect: {first: 0.0}})
    assert_same(off, plain, 1e-6)
    on = MODELS[model](run, ACTUATOR, effects={effect: {first: CATALOGUE[effect].severities[2]}})
    with pytest.raises(AssertionError):
        assert_same(on, plain, 1e-6)


def test_stribeck_friction_of_a_vanishing_speed_is_nearly_no_effect():
    plain = simulate_monitor(RUN, ACTUATOR)
    moved = []
    for speed in (0.1, 1.0, 10.0):
        s = simulate_monitor(RUN, ACTUATOR, effects={"stribeck_friction": {"speed_rad_s": speed}})
        moved.append(np.sqrt(np.mean((s["current_A"] - plain["current_A"]) ** 2)))
    assert 0.0 < moved[0] < moved[1] < moved[2] and moved[0] < 0.1 * moved[2]


def test_breakaway_counts_where_the_actuator_states_less():
    def current(static_Nm: float, ratio: float):
        actuator = ACTUATOR.with_values({"motor.static_friction_Nm": static_Nm})
        effects = {"stribeck_friction": {"speed_rad_s": 20.0, "breakaway_ratio": ratio}}
        return simulate_monitor(RUN, actuator, effects=effects)["current_A"]

    stated = ACTUATOR.value("motor.static_friction_Nm")  # twice the friction in motion
    assert np.array_equal(current(stated, 1.0), current(stated, 1.9))
    assert not np.allclose(current(0.0, 1.0), current(0.0, 2.0), atol=1e-3)


@pytest.mark.long
@pytest.mark.parametrize("circuit", CIRCUITS)
def test_order_and_repetition_of_effects_do_not_matter(circuit):
    a, b = "cogging_torque", "stribeck_friction"
    assert find_stack(circuit, [a, b]) is find_stack(circuit, [b, a]) is find_stack(circuit, [b, a, b])
    one = {a: {"amplitude_Nm": 0.02}, b: {"speed_rad_s": 12.0}}
    other = {b: {"speed_rad_s": 12.0}, a: {"amplitude_Nm": 0.02}}
    runs = [simulate_monitor(RUN, ACTUATOR, effects=e, circuit=circuit) for e in (one, other)]
    runs += [simulate_reference(RUN, ACTUATOR, effects=e) for e in (one, other)]
    for x, y in (runs[:2], runs[2:]):
        for name in SIGNALS:
            np.testing.assert_array_equal(x[name], y[name])


def test_two_effects_act_both():
    settings = {"cogging_torque": {"amplitude_Nm": 0.03}, "stribeck_friction": {"speed_rad_s": 20.0}}
    both = simulate_monitor(RUN, ACTUATOR, effects=settings)
    for name in settings:
        one = simulate_monitor(RUN, ACTUATOR, effects={name: settings[name]})
        with pytest.raises(AssertionError):
            assert_same(one, both, 1e-3)


def test_parameter_rows_follow_the_base_rows():
    stack = find_stack("thesis", CATALOGUE)
    assert stack.effects == tuple(sorted(CATALOGUE))
    assert stack.parameter_rows[: len(PARAMETER_ROWS)] == PARAMETER_ROWS
    rest = stack.parameter_rows[len(PARAMETER_ROWS) :]
    assert rest == tuple(f"{e}.{p.name}" for e in stack.effects for p in CATALOGUE[e].parameters)
    assert len(set(stack.parameter_rows)) == len(stack.parameter_rows)


def test_unknown_circuit_and_effect_are_refused():
    with pytest.raises(InputError, match="circuits are thesis, reduced"):
        find_stack("three-phase")
    with pytest.raises(InputError, match="no effect 'rust'; `emaviz effects` lists"):
        find_stack("reduced", ["rust"])


@pytest.mark.parametrize("effect", CATALOGUE)
def test_effects_act_at_known_places_with_the_right_arguments(effect):
    declared = CATALOGUE[effect]
    assert declared.places
    for function in declared.places:
        arguments = function.__code__.co_varnames[: function.__code__.co_argcount]
        expected = len(PLACES[function.__name__]) + len(declared.parameters) + len(declared.states)
        assert len(arguments) == expected, f"{effect}.{function.__name__} takes {arguments}"


# --- what is hashed ---------------------------------------------------------------------------------------------------


def ours(path: Path) -> set[str]:
    """Modules of ours that a file imports anywhere, relative imports resolved against ema_model."""
    found = set()
    package = ["ema_model", *path.relative_to(PACKAGE).parts[:-1]]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            found.add(".".join([*base, *(node.module or "").split(".")]).strip("."))
    return {name for name in found if name.split(".")[0] in ("ema_model", "emaviz")}


def file_of(module: str) -> Path:
    inside = PACKAGE.joinpath(*module.split(".")[1:])
    return inside / "__init__.py" if inside.is_dir() else inside.with_suffix(".py")


def test_kernels_import_nothing_of_ours_that_is_not_hashed():
    hashed = {path for part in kernel_cache._COMPILED for path in PACKAGE.glob(part)}
    # These declare, find and keep effects and stacks; no kernel inlines anything of them.
    bookkeeping = {
        PACKAGE / "stacks.py",
        PACKAGE / "kernel_cache.py",
        PACKAGE / "effects/__init__.py",
        PACKAGE / "effects/effect.py",
    }
    kernels = hashed - bookkeeping
    assert len(kernels) > 12
    for path in kernels:
        outside = {m for m in ours(path) if file_of(m) not in hashed}
        assert not outside, f"{path.name} imports {outside}, whose edits the cache would not notice"
    for place in ("physics", "kernels", "effects"):
        inside = {p.name for p in (PACKAGE / place).iterdir() if p.is_dir()} - {"__pycache__"}
        # A user's effect is named after all that makes it (`effects/user/torque.py`).
        assert inside <= {"user"}, "a subfolder is not hashed"


# --- caches, processes, threads ---------------------------------------------------------------------------------------

# The kernel that is compiled soonest stands for all: they are composed, hashed and kept by the same means.
PROGRAM = """
import numpy as np
from ema_model.actuator import load_actuator
from ema_model.effects import find
from ema_model.faults import HEALTHY
from ema_model.physics.rows import LANES
from ema_model.simulation.pack import monitor_rows
from ema_model.stacks import find_stack
effects = {{"cogging_torque": find("cogging_torque").settings({{"amplitude_Nm": 0.02}})}} if {effect} else {{}}
stack = find_stack("reduced", effects)
turn = np.linspace(0.0, 6.0, 200)
motion = [turn, 50.0 * np.sin(turn), 20.0 * np.cos(turn)]
needed = np.empty((1, 200, LANES))
rows = monitor_rows(load_actuator(), HEALTHY, stack, effects)
stack.inverse.currents(rows, *motion, np.full(200, 5.0), np.zeros(200), 0.1, needed)
print("RESULT", repr(float((needed ** 2).mean())))
"""


def environment(package_parent: Path, cache: Path, **more: str) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(package_parent), "EMAVIZ_CACHE_DIR": str(cache), **more}


def start(program: str, cwd: Path, env: dict[str, str]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", program], cwd=cwd, env=env, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def result(process: subprocess.Popen[str]) -> float:
    out, err = process.communicate(timeout=180)
    assert process.returncode == 0, err[-2000:]
    found = re.search(r"^RESULT (\S+)$", out, re.MULTILINE)
    assert found, out
    return float(found.group(1))


def kernels_in(cache: Path) -> dict[str, tuple[int, int]]:
    """The kept kernels with size and time of change."""
    return {str(p): (p.stat().st_size, p.stat().st_mtime_ns) for p in cache.rglob("*.nbc")}


@pytest.fixture
def copy(tmp_path) -> Path:
    """A copy of the package that a test may edit; the folder that holds it."""
    shutil.copytree(PACKAGE, tmp_path / "ema_model", ignore=shutil.ignore_patterns("__pycache__"))
    if (PACKAGE.parent / "assets" / "actuators").is_dir():
        shutil.copytree(PACKAGE.parent / "assets" / "actuators", tmp_path / "assets" / "actuators")
    return tmp_path


@pytest.mark.long
def test_edited_effect_is_never_served_from_the_cache(copy):
    cache = copy / "cache"
    program, env = PROGRAM.format(effect=True), environment(copy, cache)
    first = result(start(program, copy, env))
    compiled = kernels_in(cache)
    assert compiled, "nothing was cached"

    assert result(start(program, copy, env)) == first
    assert kernels_in(cache) == compiled, "the second run compiled again"

    file = copy / "ema_model" / "effects" / "cogging_torque.py"
    source = file.read_text(encoding="utf-8")
    edited = source.replace("return torque + amplitude * sine(", "return torque + 2.0 * amplitude * sine(")
    assert edited != source
    stat = file.stat()
    file.write_text(edited, encoding="utf-8")
    os.utime(file, ns=(stat.st_atime_ns, stat.st_mtime_ns))  # not even the time of change tells
    shutil.rmtree(file.parent / "__pycache__", ignore_errors=True)
    second = result(start(program, copy, env))
    assert abs(second - first) > 1e-6 * first, "the old kernel was served"
    after = kernels_in(cache)
    assert set(compiled) < set(after)
    assert {p: after[p] for p in compiled} == compiled, "the old version's kernels must stay for its processes"

    assert result(start(program, copy, env)) == second
    assert kernels_in(cache) == after, "an unchanged run compiled again"


@pytest.mark.long
def test_edited_physics_is_never_served_from_the_cache(copy):
    """Friction's softened sign is inlined from another file than the kernel's: numba alone would not notice."""
    cache = copy / "cache"
    program, env = PROGRAM.format(effect=False), environment(copy, cache)
    first = result(start(program, copy, env))
    file = copy / "ema_model" / "physics" / "elementary.py"
    source = file.read_text(encoding="utf-8")
    edited = source.replace(
        "return high if raised > high else raised", "return 0.8 * high if raised > high else raised"
    )
    assert edited != source
    file.write_text(edited, encoding="utf-8")
    assert abs(result(start(program, copy, env)) - first) > 1e-6 * first


@pytest.mark.long
def test_two_processes_may_build_the_same_stack_at_once(tmp_path):
    env = environment(PACKAGE.parent, tmp_path / "cache")
    both = [start(PROGRAM.format(effect=False), tmp_path, env) for _ in range(2)]
    values = [result(process) for process in both]
    assert values[0] == values[1] > 0.0
    [kernel] = (tmp_path / "cache" / "kernels").glob("*/*")  # and no draft
    assert ".inverse.currents-" in kernel.name

    kernel.write_bytes(kernel.read_bytes()[:-1000])
    assert result(start(PROGRAM.format(effect=False), tmp_path, env)) == values[0], "a damaged kernel heals"


def test_unusable_cache_folder_falls_back(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    env = environment(PACKAGE.parent, blocked, TMPDIR=str(tmp_path))
    process = start(PROGRAM.format(effect=False), tmp_path, env)
    out, err = process.communicate(timeout=180)
    assert process.returncode == 0 and "RESULT" in out
    [line] = err.splitlines()
    assert line.startswith("emaviz: ") and f"{blocked} cannot be written" in line
    assert not list(tmp_path.glob("emaviz-kernels-*")), "the temporary folder in its place goes with the process"


THREADS = """
import threading
import numpy as np
from ema_model.actuator import load_actuator
from ema_model.faults import HEALTHY
from ema_model.identification.search import Objective
from ema_model.simulation.plant import simulated
from ema_model.simulation.run import Run, simulate_monitor
import numba
actuator = load_actuator()
recording = simulated(Run(duration_s=0.05), actuator, HEALTHY)
objective = Objective([recording], actuator)
k = np.random.default_rng(0).random((70, 8))
expected = objective(k)
assert numba.threading_layer() == "workqueue", numba.threading_layer()
wrong = []
def work():
    try:
        for _ in range(15):
            if not np.array_equal(objective(k), expected):
                wrong.append("values")
            simulate_monitor(Run(duration_s=0.02), actuator)
    except BaseException as error:
        wrong.append(repr(error))
threads = [threading.Thread(target=work) for _ in range(8)]
[t.start() for t in threads]
[t.join() for t in threads]
assert not wrong, wrong
print("RESULT 1.0")
"""


def test_parallel_kernels_from_eight_threads_do_not_abort(tmp_path):
    """numba's workqueue layer aborts the process when two threads run a parallel kernel at once."""
    cache = kernel_cache.cache_folder().parents[1]
    env = environment(PACKAGE.parent, cache, NUMBA_THREADING_LAYER="workqueue", NUMBA_NUM_THREADS="2")
    assert result(start(THREADS, tmp_path, env)) == 1.0
