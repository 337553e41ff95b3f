"""Thirty benches of other people: a small simulator of drives and loads, files as their loggers write them, and what
their owners would know of them.  It shares no code with the product.

Motor side: J dω/dt = k i − B ω − C sgn ω − n T, with T what the load takes of the output, which turns n times as far.
A weight takes M sin(θ_u − θ_0), an upright axis a constant; a second mass J₂ hangs on a shaft of K and D.  At rest dry
friction holds up to its static value.  Heun's method, the direction of dry friction the same within a step.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import savemat

Array = NDArray[np.float64]
Moves = Callable[[Array], Array]

BEFORE_S = 0.5  # that a drive has held its first goal for, when the log begins
STEP_S = 2.5e-5  # of the integration and of the drive's own loop, at most


@dataclass(frozen=True)
class Machine:
    """Motor, gear and load; SI units, at the motor but for what its name says."""

    torque_constant: float
    inertia: float
    viscous: float = 0.0
    dry: float = 0.0
    static: float = 0.0
    resistance: float = 0.0  # Ω; of use with a voltage alone
    gear: float = 1.0  # output over motor
    moment: float = 0.0  # M of a weight at the output
    hangs: float = 0.0  # θ_0, rad
    weight: float = 0.0  # constant, at the output
    stiffness: float = 0.0  # K of a shaft at the output; 0 is rigid
    damping: float = 0.0  # D of the same
    second: float = 0.0  # J₂ at the output


@dataclass(frozen=True)
class Drive:
    """What makes a current or a duty of a command."""

    kind: str  # "cascade", "position" (to a duty), "voltage" (the command is a duty), "current", "torque"
    position_gain: float = 0.0  # 1/s of the output; a servo's, 1/rad
    speed_gain: float = 0.0  # N·m·s/rad
    integral_gain: float = 0.0  # N·m/rad
    speed_limit: float = math.inf  # rad/s of the motor
    current_limit: float = math.inf  # A
    constant: float = 1.0  # N·m/A, that the drive takes the motor to have
    supply: float = 0.0  # V
    late: float = 0.0  # s, of the goal
    scale: float = 1.0  # of the goal
    rate: float = math.inf  # rad/s of the goal, at the output
    speed_ahead: float = 0.0  # share of the goal's speed that is fed forward
    inertia_ahead: float = 0.0  # kg·m² of the goal's acceleration that is fed forward


def simulated(machine: Machine, drive: Drive, command: Moves, rate_Hz: float, duration_s: float) -> dict[str, Array]:
    """What would be seen without noise, at the rate of the log; currents are means over the sample before."""
    substeps = math.ceil(1.0 / (rate_Hz * STEP_S))
    dt = 1.0 / (rate_Hz * substeps)
    count = round(duration_s * rate_Hz)
    is_open = drive.kind in ("voltage", "current", "torque")
    before = 0 if is_open else round(BEFORE_S * rate_Hz)
    at = dt * np.arange(-before * substeps - 2, count * substeps) - drive.late
    if is_open:  # held from sample to sample
        at = np.floor(at * rate_Hz + 1e-6) / rate_Hz
    # A bus brings a goal with each sample, between which the drive goes straight.
    ticks = np.arange(count + 1) / rate_Hz
    goal = drive.scale * (command(np.maximum(at, 0.0)) if is_open else np.interp(at, ticks, command(ticks)))
    if math.isfinite(drive.rate):
        goal = _no_faster(goal, drive.rate * dt)
    rise = np.gradient(goal, dt)
    ahead = drive.speed_ahead * rise / machine.gear
    torque_ahead = drive.inertia_ahead * np.gradient(rise, dt) / machine.gear
    goal, ahead, torque_ahead = (one[2:].tolist() for one in (goal, ahead, torque_ahead))
    currents, states = _integrated(machine, drive, goal, ahead, torque_ahead, dt, substeps)
    time = np.arange(count) / rate_Hz
    motor, speed, output = (one[before:] for one in states)
    logged = {"time": time, "command": command(time), "motor": motor, "speed": speed, "output": output}
    return logged | {"current": currents[before:], "torque": machine.torque_constant * currents[before:]}


def _no_faster(goal: Array, most: float) -> Array:
    follows = np.empty_like(goal)
    at = goal[0]
    for n, wanted in enumerate(goal):
        at += min(max(wanted - at, -most), most)
        follows[n] = at
    return follows


def _integrated(machine: Machine, drive: Drive, goal, ahead, torque_ahead, dt: float, substeps: int):
    k, n, inertia, dry = machine.torque_constant, machine.gear, machine.inertia, machine.dry
    holds, viscous, soft = max(machine.static, dry), machine.viscous, machine.stiffness > 0.0
    cascade, servo = drive.kind == "cascade", drive.kind == "position"
    position_gain, limit = drive.position_gain / (n if cascade else 1.0), drive.current_limit
    theta = omega = total = integral = q = v = 0.0
    if drive.kind not in ("voltage", "current", "torque"):
        theta, q = goal[0] / n, goal[0]
    current = 0.0
    samples: tuple[list[float], ...] = ([], [], [], [])

    def load(theta, omega, q, v):
        taken = machine.weight + (machine.moment * math.sin((q if soft else n * theta) - machine.hangs))
        shaft = machine.stiffness * (n * theta - q) + machine.damping * (n * omega - v) if soft else taken
        return shaft, (shaft - taken) / machine.second if soft else 0.0

    for step, wanted in enumerate(goal):
        if step % substeps == 0:
            for kept, value in zip(samples, (theta, omega, q if soft else n * theta, total / substeps)):
                kept.append(value)
            total = 0.0
        seen = q if soft else n * theta
        if cascade:
            asked = position_gain * (wanted - seen) + ahead[step]
            error = min(max(asked, -drive.speed_limit), drive.speed_limit) - omega
            torque = drive.speed_gain * error + integral + torque_ahead[step]
            current = min(max(torque / drive.constant, -limit), limit)
            if abs(torque / drive.constant) < limit or torque * error < 0.0:
                integral += dt * drive.integral_gain * error
        elif servo or drive.kind == "voltage":
            duty = min(max(position_gain * (wanted - seen), -1.0), 1.0) if servo else wanted
            current = (duty * drive.supply - k * omega) / machine.resistance
        else:
            current = wanted if drive.kind == "current" else wanted / k
        total += current
        back = k * k / machine.resistance if servo or drive.kind == "voltage" else 0.0
        shaft, faster = load(theta, omega, q, v)
        pull = k * current - viscous * omega - n * shaft
        way = math.copysign(1.0, omega) if omega else math.copysign(1.0, pull)
        if omega == 0.0 and abs(pull) <= holds:
            first = 0.0
        else:
            first = (pull - dry * way) / inertia
        guess = omega + dt * first
        shaft, later = load(theta + dt * omega, guess, q + dt * v, v + dt * faster)
        if first or omega:
            second = (k * current - back * (guess - omega) - viscous * guess - n * shaft - dry * way) / inertia
        else:
            second = 0.0
        after = omega + 0.5 * dt * (first + second)
        if after * omega < 0.0:
            after = 0.0
        theta += 0.5 * dt * (omega + after)
        omega = after
        q, v = q + dt * (v + 0.5 * dt * faster), v + 0.5 * dt * (faster + later)
    return np.array(samples[3]), [np.array(one) for one in samples[:3]]


# --- commands ---------------------------------------------------------------------------------------------------------


def waves(random: np.random.Generator, size: float, fastest_Hz: float, slowest_Hz: float = 0.3) -> Moves:
    """Three sines from rest at zero, the faster the smaller."""
    rates = 2.0 * np.pi * np.geomspace(slowest_Hz, fastest_Hz, 3) * random.uniform(0.85, 1.15, 3)
    sizes = size * np.array([0.6, 0.3, 0.12]) * random.uniform(0.8, 1.2, 3)
    phases = random.uniform(0.0, 2.0 * np.pi, 3)

    def moves(time: Array) -> Array:
        return np.sin(0.5 * np.pi * np.minimum(time / 0.5, 1.0)) ** 2 * (
            np.sin(np.multiply.outer(time, rates) + phases) @ sizes
        )

    return moves


def steps(random: np.random.Generator, size: float, dwell_s: float, middle: float = 0.0) -> Moves:
    """Random levels, held."""
    levels = middle + size * random.uniform(-1.0, 1.0, 200)
    levels[0] = middle
    return lambda time: levels[(time / dwell_s + 1e-6).astype(int)]


def sweep(random: np.random.Generator, size: float, end_Hz: float, duration_s: float) -> Moves:
    """A sine from 1 Hz up, about slow strokes of the same size."""
    begins = random.uniform(0.0, 2.0 * np.pi)

    def moves(time: Array) -> Array:
        faster = np.sin(2.0 * np.pi * (time + 0.5 * (end_Hz - 1.0) / duration_s * time**2) + begins)
        return size * (faster + np.sign(np.sin(2.0 * np.pi * 0.45 * time + 0.1)))

    return moves


# --- what an owner knows, and writes down -----------------------------------------------------------------------------


@dataclass
class Owner:
    """Draws the truth about what the file says, as far as the file says it is known."""

    random: np.random.Generator
    sections: dict[str, list[str]] = field(default_factory=dict)
    truth: dict[str, float] = field(default_factory=dict)  # by the parameter's path on a rotary axis
    told: dict[str, float] = field(default_factory=dict)  # the file's value of the same

    def knows(self, path: str, value: float, tolerance: float, called: str = "") -> float:
        """The true value of what the file has with a tolerance, relative; called: its name on a linear axis."""
        section, _, name = path.rpartition(".")
        self.says(section, f"{called or name} = {{ value = {value:.6g}, tolerance = {tolerance:g} }}")
        true = value * (1.0 + tolerance * float(np.clip(self.random.standard_normal(), -2.2, 2.2)))
        self.truth[path], self.told[path] = true, value
        return true

    def says(self, section: str, *lines: str) -> None:
        self.sections.setdefault(section, []).extend(lines)

    def near(self, value: float, share: float = 0.3) -> float:
        """A value of another bench, for the file: three digits."""
        return float(f"{value * self.random.uniform(1.0 - share, 1.0 + share):.3g}")

    @property
    def text(self) -> str:
        return "\n".join(f"[{name}]\n" + "\n".join(lines) + "\n" for name, lines in self.sections.items())


@dataclass(frozen=True)
class Column:
    """How one signal is logged."""

    signal: str  # as the product calls it
    source: str  # of `simulated`
    name: str  # in the file
    unit: str
    factor: float  # the file's number per SI
    noise: float = 0.0  # SI
    grain: float = 0.0  # SI, to which it is rounded


@dataclass(frozen=True)
class Bench:
    """One of them."""

    name: str
    task: str  # "compare" or "discover"
    machine: Machine
    drive: Drive
    commands: tuple[Moves, ...]  # the last is held out
    rate_Hz: float
    duration_s: float
    columns: tuple[Column, ...]
    form: str
    owner: Owner
    seed: int
    named: frozenset[str] = frozenset()  # what discovery should name
    hidden: dict[str, float] = field(default_factory=dict)  # true values of what is named, "effect.parameter"
    fitted_effects: tuple[str, ...] = ()  # which the owner asks for, without values
    seen: str = ""  # what shows of itself: "two_masses"

    @property
    def mapping(self) -> tuple[str, ...]:
        time = {"no_header": "#1", "npz_matrix": "log_1"}.get(self.form, "Zeit")
        told = [f"time_s={time}[{'s' if self.form in ('npz_matrix', 'mat', 'json') else 'ms'}]"]
        for place, one in enumerate(self.columns, start=2):
            name = {"no_header": f"#{place}", "npz_matrix": f"log_{place}"}.get(self.form, one.name)
            told.append(f"{one.signal}={name}" + (f"[{one.unit}]" if one.unit else ""))
        return tuple(told)

    def written(self, folder: Path) -> tuple[Path, list[Path]]:
        """Its actuator's file and its logs, the last one held out."""
        actuator = folder / f"{self.name}.toml"
        actuator.write_text(self.owner.text, encoding="utf-8")
        paths = []
        for number, command in enumerate(self.commands):
            random = np.random.default_rng([self.seed, number])
            seen = simulated(self.machine, self.drive, command, self.rate_Hz, self.duration_s)
            table = {"Zeit": seen["time"]}
            for one in self.columns:
                values = seen[one.source] + one.noise * random.standard_normal(seen["time"].size)
                table[one.name] = one.factor * (np.round(values / one.grain) * one.grain if one.grain else values)
            paths.append(_saved(table, self.form, folder / f"{self.name}_{number}"))
        return actuator, paths


def _saved(table: dict[str, Array], form: str, path: Path) -> Path:
    rows = np.column_stack(list(table.values()))
    if form in ("csv", "german", "no_header"):
        rows[:, 0] *= 1e3
        path = path.with_suffix(".csv" if form != "no_header" else ".txt")
        separator, header = {"csv": (",", True), "german": (";", True), "no_header": ("\t", False)}[form]
        lines = [separator.join(table)] if header else []
        lines += [separator.join(f"{value:.8g}" for value in row) for row in rows]
        text = "\n".join(lines) + "\n"
        path.write_text(text.replace(".", ",") if form == "german" else text, encoding="utf-8")
    elif form == "npz_matrix":
        path = path.with_suffix(".npz")
        np.savez(path, log=rows)
    elif form == "mat":
        path = path.with_suffix(".mat")
        savemat(path, table)
    else:
        path = path.with_suffix(".json")
        path.write_text(json.dumps({name: values.tolist() for name, values in table.items()}), encoding="utf-8")
    return path


# --- the kinds --------------------------------------------------------------------------------------------------------

_FORMS = ("csv", "german", "no_header", "npz_matrix", "mat", "json")
_DEG = ("deg", 180.0 / math.pi)


def _angle(signal: str, source: str, name: str, grain: float, in_degrees: bool) -> Column:
    unit, factor = _DEG if in_degrees else ("rad", 1.0)
    return Column(signal, source, name, unit, factor, 0.0, grain)


def _current(random: np.random.Generator, typical: float) -> Column:
    unit, factor = ("mA", 1e3) if random.random() < 0.5 else ("A", 1.0)
    noise = typical * random.uniform(0.01, 0.03)
    return Column("current_A", "current", "Iq", unit, factor, noise, float(f"{0.3 * noise:.1g}"))


def _motor(owner: Owner, wide: float, *, kt: float, inertia: float, viscous: float, dry: float, **known: Any):
    """The machine of a file's motor section; wide: the tolerance of what no data sheet tells."""
    section = "motor"
    friction = owner.knows(f"{section}.dynamic_friction_Nm", dry, wide)
    static = known.pop("static", 1.0)
    owner.says(section, f"static_friction_Nm = {static * dry:.6g}")
    return Machine(
        torque_constant=owner.knows(f"{section}.torque_constant_Nm_A", kt, 0.03),
        inertia=owner.knows(f"{section}.inertia_kgm2", inertia, 0.15),
        viscous=owner.knows(f"{section}.viscous_friction_Nms_rad", viscous, 0.3),
        dry=friction,
        static=static * dry,
        **known,
    )


def _joint(owner: Owner, **known: Any) -> tuple[Machine, float]:
    """A motor behind a gear, and the current that it typically takes."""
    kt, inertia = owner.near(0.12), owner.near(1.2e-4)
    gear = 1.0 / round(owner.near(40.0))
    dry = owner.near(0.03)
    machine = _motor(owner, 0.15, kt=kt, inertia=inertia, viscous=owner.near(1.5e-4), dry=dry, gear=gear, **known)
    owner.says("transmission", f"gear_ratio = {gear!r}")
    return machine, 0.15 / kt


def _cascade(owner: Owner, machine: Machine, tolerance: float = 0.01, user: str = "rotary") -> Drive:
    """P position, PI speed; the file has the gains with a tolerance."""
    inertia = owner.near(1.2e-4, 0.05)
    speed, rate = owner.near(250.0 * inertia), owner.near(22.0)
    owner.says("controller", 'kind = "cascade"')
    drive = Drive(
        "cascade",
        position_gain=owner.knows("controller.position_gain_1_s", rate / machine.gear, tolerance) * machine.gear,
        speed_gain=owner.knows("controller.speed_gain_Nms_rad", speed, tolerance),
        integral_gain=owner.knows("controller.integral_gain_Nm_rad", owner.near(20.0) * speed, tolerance),
        speed_limit=500.0,
        current_limit=20.0,
        constant=owner.told["motor.torque_constant_Nm_A"],
    )
    owner.says("controller", "speed_limit_rad_s = 500.0", f"torque_constant_Nm_A = {drive.constant:.9g}")
    owner.says("controller", "current_limit_A = 20.0", "derivative_gain_Nms2_rad = 0.0")
    owner.says("controller", f"integrator_window_{'m' if user == 'linear' else 'rad'} = 10.0")
    owner.says("inverter", 'kind = "current"', "current_limit_A = 20.0")
    return drive


def _of_joint(machine: Machine, random: np.random.Generator, typical: float, *, output_only: bool = False):
    """Columns of a drive's log: goal, both encoders or the output's alone, current."""
    in_degrees = bool(random.random() < 0.6)
    counts = 2.0 * np.pi / 2.0 ** int(random.integers(13, 17))
    output = counts * machine.gear
    columns = [
        _angle("command_rad", "command", "Soll", 0.0, in_degrees),
        _angle("user_position_rad", "output", "Ist", output, in_degrees),
        _angle("motor_position_rad", "motor", "Motor", counts, in_degrees),
        _current(random, typical),
    ]
    return tuple(columns[1:2] + columns[3:] if output_only else columns)


def _bench(name: str, number: int, owner: Owner, **given: Any) -> Bench:
    random = owner.random
    rate = float(random.choice([500.0, 1000.0, 2000.0]))
    given.setdefault("rate_Hz", rate)
    given.setdefault("duration_s", float(np.round(random.uniform(3.0, 4.5), 1)))
    return Bench(f"{number:02d}_{name}", owner=owner, form=_FORMS[number % len(_FORMS)], seed=number, **given)


def _three(owner: Owner, size: float, fastest_Hz: float) -> tuple[Moves, ...]:
    return tuple(waves(owner.random, size, fastest_Hz * one) for one in (1.0, 0.75, 0.85))


def weight_unknown_drive(number: int, owner: Owner) -> Bench:
    """An arm whose weight nobody wrote down; current and motion of a drive that nobody describes."""
    machine, typical = _joint(owner)
    moment, hangs = owner.near(0.05) / machine.gear, float(owner.random.uniform(-0.8, 0.8))
    machine = replace(machine, moment=moment, hangs=hangs)
    owner.says("controller", 'kind = "unknown"')
    drive = Drive("cascade", 25.0, 250.0 * machine.inertia, 5000.0 * machine.inertia, constant=machine.torque_constant)
    return _bench(
        "weight_unknown_drive",
        number,
        owner,
        task="discover",
        machine=machine,
        drive=drive,
        commands=_three(owner, 1.4, 1.5),
        columns=_of_joint(machine, owner.random, typical)[1:],
        named=frozenset({"pendulum_load"}),
        hidden={"pendulum_load.moment_Nm": moment, "pendulum_load.angle_rad": hangs},
    )


def weight_cascade(number: int, owner: Owner) -> Bench:
    """The same on a drive whose loop is known."""
    machine, typical = _joint(owner)
    moment, hangs = owner.near(0.05) / machine.gear, float(owner.random.uniform(-0.8, 0.8))
    machine = replace(machine, moment=moment, hangs=hangs)
    drive = _cascade(owner, machine)
    return _bench(
        "weight_cascade",
        number,
        owner,
        task="discover",
        machine=machine,
        drive=drive,
        commands=_three(owner, 1.2, 1.5),
        columns=_of_joint(machine, owner.random, typical),
        named=frozenset({"pendulum_load"}),
        hidden={"pendulum_load.moment_Nm": moment, "pendulum_load.angle_rad": hangs},
    )


def feedforward(number: int, owner: Owner) -> Bench:
    """A motion controller that feeds the goal's speed forward, of which the file says nothing."""
    machine, typical = _joint(owner)
    share = float(owner.random.uniform(0.5, 1.0))
    drive = replace(_cascade(owner, machine), speed_ahead=share)
    return _bench(
        "feedforward",
        number,
        owner,
        task="discover",
        machine=machine,
        drive=drive,
        commands=_three(owner, 0.8, 2.0),
        columns=_of_joint(machine, owner.random, typical),
        named=frozenset({"velocity_feedforward"}),
        hidden={"velocity_feedforward.ratio": share},
    )


def cascade(number: int, owner: Owner) -> Bench:
    """P position and PI speed whose gains are known by a quarter."""
    machine, typical = _joint(owner)
    return _bench(
        "cascade",
        number,
        owner,
        task="compare",
        machine=machine,
        drive=_cascade(owner, machine, 0.25),
        commands=_three(owner, 0.8, 2.0),
        columns=_of_joint(machine, owner.random, typical),
    )


def duty_in(number: int, owner: Owner) -> Bench:
    """A DC gearmotor, duty in and speed out."""
    owner.says("controller", 'kind = "open"')
    supply, kt, resistance = owner.near(12.0), owner.near(0.012), owner.near(3.0)
    inertia = owner.near(2e-6)
    owner.says("inverter", 'kind = "voltage"', f"bus_voltage_V = {supply}")
    machine = _motor(owner, 0.3, kt=kt, inertia=inertia, viscous=owner.near(1e-6), dry=owner.near(1.2e-3))
    machine = replace(machine, resistance=owner.knows("motor.resistance_Ohm", resistance, 0.1))
    full = int(owner.random.choice([255, 999]))
    top = supply / kt
    columns = (
        Column("duty", "command", "pwm", f"/{full}", float(full), 0.0, 1.0 / full),
        Column("motor_speed_rad_s", "speed", "n", "rpm", 30.0 / math.pi, 0.004 * top, 0.001 * top),
    )
    return _bench(
        "duty_in",
        number,
        owner,
        task="compare",
        machine=machine,
        drive=Drive("voltage", supply=supply),
        commands=tuple(_held(steps(owner.random, 0.7, dwell, 0.1), full) for dwell in (0.25, 0.35, 0.3)),
        columns=columns,
        rate_Hz=1000.0,
    )


def _held(moves: Moves, full: int) -> Moves:
    """A duty in whole counts."""
    return lambda time: np.round(moves(time) * full) / full


def output_only(number: int, owner: Owner) -> Bench:
    """A robot's joint: the output's angle and the current."""
    machine, typical = _joint(owner)
    owner.says("controller", 'kind = "unknown"')
    drive = Drive("cascade", 25.0, 250.0 * machine.inertia, 5000.0 * machine.inertia, constant=machine.torque_constant)
    return _bench(
        "output_only",
        number,
        owner,
        task="compare",
        machine=machine,
        drive=drive,
        commands=_three(owner, 1.0, 1.5),
        columns=_of_joint(machine, owner.random, typical, output_only=True),
    )


def _servo(owner: Owner, **known: Any) -> tuple[Machine, Drive]:
    """A hobby servo of which all is counted at its output: position error to duty."""
    owner.says("controller", 'kind = "position"')
    supply = owner.near(7.4)
    drive = Drive("position", owner.knows("controller.gain_1_rad", owner.near(1.1), 0.05), supply=supply)
    owner.says("inverter", 'kind = "voltage"', f"bus_voltage_V = {supply}")
    kt, dry = owner.near(0.6, 0.15), owner.near(0.03)
    machine = _motor(owner, 0.2, kt=kt, inertia=owner.near(5e-3), viscous=owner.near(0.01), dry=dry, **known)
    owner.says("model", "step_s = 2e-4")
    return replace(machine, resistance=owner.knows("motor.resistance_Ohm", owner.near(4.0, 0.15), 0.1)), drive


def _of_servo(random: np.random.Generator) -> tuple[Column, ...]:
    """Goal and angle of 4096 counts a turn."""
    in_degrees, counts = bool(random.random() < 0.5), 2.0 * np.pi / 4096.0
    columns = (("command_rad", "command", "goal"), ("user_position_rad", "output", "pos"))
    return tuple(_angle(*one, counts, in_degrees) for one in columns)


def weight_servo(number: int, owner: Owner) -> Bench:
    """A hobby servo that lifts an arm."""
    machine, drive = _servo(owner)
    moment, hangs = owner.near(0.25), float(owner.random.uniform(-0.5, 0.5))
    return _bench(
        "weight_servo",
        number,
        owner,
        task="discover",
        machine=replace(machine, moment=moment, hangs=hangs),
        drive=drive,
        commands=_three(owner, 1.4, 2.0),
        columns=_of_servo(owner.random),
        named=frozenset({"pendulum_load"}),
        hidden={"pendulum_load.moment_Nm": moment, "pendulum_load.angle_rad": hangs},
        rate_Hz=500.0,
    )


def _servo_or_joint(owner: Owner, number: int) -> tuple[Machine, Drive, tuple[Column, ...]]:
    if number % 2:
        machine, typical = _joint(owner)
        return machine, _cascade(owner, machine), _of_joint(machine, owner.random, typical)
    machine, drive = _servo(owner)
    return machine, drive, _of_servo(owner.random)


def rate_limit(number: int, owner: Owner) -> Bench:
    """Steps, which an interpolator turns into ramps."""
    machine, drive, columns = _servo_or_joint(owner, number)
    rate = owner.near(1.8)
    return _bench(
        "rate_limit",
        number,
        owner,
        task="discover",
        machine=machine,
        drive=replace(drive, rate=rate),
        commands=tuple(steps(owner.random, 0.9, dwell) for dwell in (0.6, 0.8, 0.7)),
        columns=columns,
        named=frozenset({"goal_rate_limit"}),
        hidden={"goal_rate_limit.rate_rad_s": rate},
    )


def dead_time(number: int, owner: Owner) -> Bench:
    """A goal that takes its time to the loop; one file in three says so, roughly."""
    machine, drive, columns = _servo_or_joint(owner, number)
    late = owner.near(0.03 if drive.kind == "position" else 0.012)
    is_in_file = number % 3 == 0
    if is_in_file:
        late = owner.knows("effects.goal_delay.delay_s", late, 0.3)
    return _bench(
        "dead_time",
        number,
        owner,
        task="compare" if is_in_file else "discover",
        machine=machine,
        drive=replace(drive, late=late),
        commands=_three(owner, 0.9, 2.0),
        columns=columns,
        named=frozenset() if is_in_file else frozenset({"goal_delay"}),
        hidden={} if is_in_file else {"goal_delay.delay_s": late},
    )


def goal_gain(number: int, owner: Owner) -> Bench:
    """A servo that goes further than it is told."""
    machine, drive = _servo(owner)
    ratio = float(owner.random.uniform(0.06, 0.2))
    return _bench(
        "goal_gain",
        number,
        owner,
        task="discover",
        machine=machine,
        drive=replace(drive, scale=1.0 + ratio),
        commands=tuple(steps(owner.random, 0.8, dwell) for dwell in (0.5, 0.7, 0.6)),
        columns=_of_servo(owner.random),
        named=frozenset({"goal_gain"}),
        hidden={"goal_gain.ratio": ratio},
        rate_Hz=500.0,
    )


def torque_in(number: int, owner: Owner) -> Bench:
    """A motor that is told a torque or a current, held from sample to sample; its encoder answers."""
    owner.says("controller", 'kind = "open"')
    machine, _ = _joint(owner)
    told_torque = bool(number % 2)
    size = 0.12 if told_torque else 0.12 / owner.told["motor.torque_constant_Nm_A"]
    counts = 2.0 * np.pi / 2.0**14
    told = ("motor_torque_Nm", "command", "Moment", "N·m") if told_torque else ("current_A", "command", "Iq", "A")
    return _bench(
        "torque_in",
        number,
        owner,
        task="compare",
        machine=machine,
        drive=Drive("torque" if told_torque else "current"),
        commands=tuple(waves(owner.random, size, fastest, 0.6) for fastest in (6.0, 4.0, 5.0)),
        columns=(Column(*told, 1.0), _angle("motor_position_rad", "motor", "Winkel", counts, True)),
        rate_Hz=1000.0,
    )


def two_masses(number: int, owner: Owner) -> Bench:
    """A load on a shaft that gives, torque in and the motor's angle out; with the load's beside it, it is fitted."""
    with_load = bool(number % 2)
    motor, ratio = owner.near(1.2e-4), float(owner.random.uniform(0.8, 2.0))
    antiresonance, relative = float(owner.random.uniform(14.0, 30.0)), float(owner.random.uniform(0.01, 0.03))
    owner.says("controller", f'kind = "{"open" if with_load else "unknown"}"')
    machine = _motor(
        owner,
        0.15,
        kt=owner.near(0.1),
        inertia=motor if with_load else motor * (1.0 + ratio),
        viscous=owner.near(5e-5),
        dry=owner.near(0.008),
    )
    alone = machine.inertia if with_load else machine.inertia / (1.0 + ratio)
    second = alone * ratio
    stiffness = second * (2.0 * np.pi * antiresonance) ** 2
    damping = 2.0 * relative * math.sqrt(stiffness * second)
    counts = 2.0 * np.pi / 2.0**16
    columns = [
        Column("current_A", "current", "Iq", "A", 1.0, 0.0, 1e-3),
        _angle("motor_position_rad", "motor", "Motor", counts, False),
        _angle("user_position_rad", "output", "Last", counts, False),
    ]
    size = 0.04 / owner.told["motor.torque_constant_Nm_A"]
    return _bench(
        "two_masses",
        number,
        owner,
        task="compare" if with_load else "discover",
        machine=replace(machine, inertia=alone, second=second, stiffness=stiffness, damping=damping),
        drive=Drive("current"),
        commands=tuple(sweep(owner.random, size, end, 6.0) for end in (60.0, 50.0, 55.0)),
        columns=tuple(columns if with_load else columns[:2]),
        hidden={"torsional_compliance.stiffness_Nm_rad": stiffness, "torsional_compliance.inertia_kgm2": second}
        if with_load
        else {},
        fitted_effects=("torsional_compliance",) if with_load else (),
        seen="" if with_load else "two_masses",
        rate_Hz=1000.0,
        duration_s=6.0,
    )


def upright(number: int, owner: Owner) -> Bench:
    """A linear axis that stands upright: a screw behind a known loop, or a linear motor behind one that is not."""
    if number % 2:
        gear = float(owner.random.choice([5e-3, 1e-2])) / (2.0 * np.pi)
        owner.says("axes", 'motor = "rotary"', 'user = "linear"')
        kt, inertia, dry = owner.near(0.2), owner.near(1.2e-4), owner.near(0.03)
        machine = _motor(owner, 0.15, kt=kt, inertia=inertia, viscous=owner.near(1.5e-4), dry=dry, gear=gear)
        owner.says("transmission", f"gear_ratio = {gear!r}")
        weight = 9.81 * owner.near(15.0)
        drive = _cascade(owner, machine, user="linear")
        counts = 2.0 * np.pi / 2.0**14
        columns = (
            Column("command_m", "command", "Soll", "mm", 1e3),
            Column("user_position_m", "output", "Ist", "mm", 1e3, 0.0, gear * counts),
            Column("motor_position_rad", "motor", "Motor", "deg", _DEG[1], 0.0, counts),
            _current(owner.random, 0.15 / kt),
        )
    else:
        owner.says("controller", 'kind = "unknown"')
        owner.says("axes", 'motor = "linear"', 'user = "linear"')
        mass, kf, dry = owner.near(4.0), owner.near(40.0), owner.near(6.0)
        friction = owner.knows("motor.dynamic_friction_Nm", dry, 0.15, "dynamic_friction_N")
        owner.says("motor", f"static_friction_N = {dry}")
        machine = Machine(
            torque_constant=owner.knows("motor.torque_constant_Nm_A", kf, 0.03, "force_constant_N_A"),
            inertia=owner.knows("motor.inertia_kgm2", mass, 0.15, "mass_kg"),
            viscous=owner.knows("motor.viscous_friction_Nms_rad", owner.near(8.0), 0.3, "viscous_friction_Ns_m"),
            dry=friction,
            static=dry,
        )
        weight = 9.81 * machine.inertia
        drive = Drive("cascade", 25.0, 250.0 * mass, 5000.0 * mass, constant=kf)
        columns = (Column("motor_position_m", "motor", "Ist", "mm", 1e3, 0.0, 1e-6), _current(owner.random, 20.0 / kf))
    return _bench(
        "upright",
        number,
        owner,
        task="discover",
        machine=replace(machine, weight=weight),
        drive=drive,
        commands=_three(owner, 0.12, 1.8),
        columns=columns,
        named=frozenset({"constant_load"}),
        hidden={"constant_load.torque_Nm": weight},
    )


KINDS: tuple[tuple[Callable[[int, Owner], Bench], int], ...] = (
    (weight_unknown_drive, 2),
    (feedforward, 3),
    (rate_limit, 3),
    (duty_in, 3),
    (two_masses, 2),
    (output_only, 2),
    (weight_cascade, 2),
    (weight_servo, 1),
    (dead_time, 3),
    (goal_gain, 2),
    (cascade, 3),
    (torque_in, 2),
    (upright, 2),
)


def benches(seed: int = 59) -> list[Bench]:
    """All of them; the same seed gives the same ones."""
    made = [kind for kind, count in KINDS for _ in range(count)]
    return [kind(number, Owner(np.random.default_rng([seed, number]))) for number, kind in enumerate(made)]
