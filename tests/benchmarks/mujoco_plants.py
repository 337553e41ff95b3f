"""A hundred plants simulated with MuJoCo, with zero to two effects hidden from their owners' files.

    python -m venv mujoco-env && mujoco-env/bin/pip install "mujoco[sysid]==4.0.0"
    mujoco-env/bin/python tests/benchmarks/mujoco_plants.py FOLDER             # seeds 0 to 99: the study
    mujoco-env/bin/python tests/benchmarks/mujoco_plants.py FOLDER 1000-1004   # others, to check this program with

MuJoCo is of an environment of its own, and no code is shared with the product: a hinge joint has its armature, damping
and frictionloss; a `motor`, a `position` servo or a `dcmotor` drives it; an arm hangs in gravity; joints and tendons
have their springs; a second mass hangs on a tendon that gives or has play; actuators have delays and filters.  What
MuJoCo has no element for (ripple, asymmetric friction, a bump) is applied as a generalized force, or as a frictionloss
that is set anew each step.  The drive's loop is sampled at 20 kHz, a hobby servo's at 10 kHz.

A folder a plant: `base.toml` (what its owner knows: the plant without what is hidden, with tolerances, from which the
true values are drawn), two recordings to fit and one held out, of other commands, with encoders' counts and sensors'
noise, and `truth.json`.  Each plant follows from its seed alone; those that are there are left as they are.

Whether what is hidden is showable is said here, before any discovery: the plant is simulated once more without the
effect under the same commands.  Of the change of each logged signal a constant is taken away (not of a constant load),
and what small changes of torque constant, inertia, viscous and dry friction would do, by least squares over both fitted
recordings.  It is showable where 5 times the sensor's noise (rms, quantisation included) or more is left in a signal.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1]))
from support.benches import Owner, steps, waves

Array = NDArray[np.float64]
Moves = Callable[[Array], Array]
Values = dict[str, float]

STUDY = range(100)
STEP_S = 5e-5
GRAVITY = 9.81
SETTLES_S = 0.4  # that a drive has held its first goal for, when the log begins
SHOWABLE = 5.0  # times the sensor's noise
PARAMETERS = ("torque_constant", "inertia", "viscous", "dry")  # that a calibration may move, in any case
_STICKS = 'solreffriction="1e-4 1" solimpfriction="0.9999 0.9999 0.001 0.5 2"'  # as hard as the step allows
_TINY = 1e-9
_OUTPUTS_SHARE = 0.15  # of dry friction beyond the play, by which what is light there stays where it is


# --- a plant in MuJoCo ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Plant:
    """The truth; SI, as the motor feels it, but for what is named of the output, which turns 1/gear as far."""

    kind: str
    torque_constant: float
    inertia: float
    viscous: float
    dry: float
    gear: float = 1.0  # motor over output
    resistance: float = 0.0
    supply: float = 0.0
    effects: Mapping[str, Values] = field(default_factory=dict)

    def has(self, name: str) -> Values:
        """The settings of an effect; empty where it is not there."""
        return self.effects.get(name, {})

    @property
    def is_split(self) -> bool:
        """Whether the output is a mass of its own."""
        return "torsional_compliance" in self.effects or "backlash" in self.effects

    def mjcf(self) -> str:
        """The model; joint "rotor" counts in the output's angle, so that the actuator's gear is the motor's."""
        n = self.gear
        inertia = self.inertia * n * n  # of all that moves, at the output
        link, tendons = "", []
        if twist := self.has("torsional_compliance"):
            link = _body("link", twist["inertia_kgm2"], "", 'frictionloss="0"')
            tendons.append(
                _tendon(
                    f'stiffness="{twist["stiffness_Nm_rad"]!r}" damping="{twist["damping_Nms_rad"]!r}" springlength="0"'
                )
            )
        elif play := self.has("backlash"):
            light, half = 5e-3 * inertia, 0.5 * play["width_rad"]
            inertia -= light
            link = _body("link", light, "", f'frictionloss="{_OUTPUTS_SHARE * self.dry * n!r}" {_STICKS}')
            tendons.append(
                _tendon(
                    f'limited="true" range="{-half!r} {half!r}" '
                    'solreflimit="2e-4 1" solimplimit="0.9999 0.9999 0.001 0.5 2"'
                )
            )
        spring = ""
        if hinge := self.has("hinge_moment"):
            k = hinge["stiffness_Nm_rad"]
            spring = f'stiffness="{k!r}" springref="{-hinge["offset_Nm"] / k!r}"'
        if cubic := self.has("cubic_spring"):
            spring = f'stiffness="0 0 {cubic["stiffness_Nm_rad3"]!r}"'
        if stop := self.has("one_sided_spring"):
            at = stop["contact_rad"]
            slack = f"-1000 {at!r}" if at > 0.0 else f"{at!r} 1000"
            given = f'stiffness="{stop["stiffness_Nm_rad"]!r}" springlength="{slack}"'
            tendons.append(f'<fixed {given}><joint joint="rotor" coef="1"/></fixed>')
        viscous = self.viscous + self.has("viscous_friction").get("coefficient_Nms_rad", 0.0)
        dry = self.dry * self.has("stribeck_friction").get("breakaway_ratio", 1.0)
        dry *= 1.0 - _OUTPUTS_SHARE if "backlash" in self.effects else 1.0
        if drag := self.has("quadratic_drag"):
            square = self.dry * n**3 / drag["speed_rad_s"] ** 2
            damping = f"{viscous * n * n!r} {square!r}"
        else:
            damping = f"{viscous * n * n!r}"
        arm = ""
        if weight := self.has("pendulum_load"):
            moment, angle = weight["moment_Nm"], weight["angle_rad"]
            length = min(0.3, 0.4 * inertia * GRAVITY / moment)
            mass = moment / (GRAVITY * length)
            inertia -= mass * length * length
            arm = f'mass="{mass!r}" pos="{length * math.sin(angle)!r} 0 {-length * math.cos(angle)!r}"'
        joint = f'damping="{damping}" frictionloss="{dry * n!r}" {_STICKS} {spring}'
        return f"""<mujoco>
  <compiler angle="radian"/>
  <option timestep="{STEP_S!r}" gravity="0 0 {-GRAVITY}" iterations="30" tolerance="1e-12">
    <flag contact="disable"/>
  </option>
  <worldbody>{_body("rotor", inertia, arm, joint)}{link}</worldbody>
  <tendon>{"".join(tendons)}</tendon>
  <actuator>{self._actuator()}</actuator>
</mujoco>"""

    def _actuator(self) -> str:
        at = f'name="drive" joint="rotor" gear="{self.gear!r}"'
        if self.kind in ("servo", "open_voltage"):
            cogging = self.has("cogging_torque")
            teeth = f'cogging="{" ".join(repr(one) for one in cogging.values())}"' if cogging else ""
            kt = self.torque_constant
            return f'<dcmotor {at} motorconst="{kt!r} {kt!r}" resistance="{self.resistance!r}" {teeth}/>'
        if self.kind == "joint":
            late = self.has("goal_delay").get("delay_s", 0.0)
            delay = f'delay="{late!r}" nsample="{round(late / STEP_S)}"' if late else ""
            kp, kv = (self.effects["servo"][name] for name in ("kp", "kv"))
            return f'<position {at} kp="{kp!r}" kv="{kv!r}" {delay}/>'
        if lag := self.has("current_loop_lag"):
            return f'<general {at} dyntype="filterexact" dynprm="{lag["time_constant_s"]!r}" gainprm="1"/>'
        late = self.has("computation_delay").get("delay_s", 0.0)
        delay = f'delay="{late!r}" nsample="{round(late / STEP_S)}"' if late else ""
        return f"<motor {at} {delay}/>"


def _body(name: str, inertia: float, arm: str, joint: str) -> str:
    mass = arm or 'mass="1e-3" pos="0 0 0"'
    return (
        f'<body name="{name}"><joint name="{name}" type="hinge" axis="0 1 0" armature="{inertia!r}" {joint}/>'
        f'<inertial {mass} diaginertia="{_TINY} {_TINY} {_TINY}"/></body>'
    )


def _tendon(given: str) -> str:
    return f'<fixed {given}><joint joint="rotor" coef="1"/><joint joint="link" coef="-1"/></fixed>'


@dataclass(frozen=True)
class Drive:
    """What makes a torque or a voltage of a command; its gains are the true ones."""

    position_gain: float = 0.0  # 1/s of the output; a servo's, 1/rad to a duty
    speed_gain: float = 0.0  # N·m·s/rad
    integral_gain: float = 0.0  # N·m/rad
    constant: float = 1.0  # N·m/A, that the drive takes the motor to have
    current_limit: float = 20.0  # A
    speed_limit: float = 1000.0  # rad/s
    every: int = 1  # steps


def simulated(plant: Plant, drive: Drive, command: Moves, rate_Hz: float, duration_s: float) -> dict[str, Array]:
    """What would be seen without noise, at the rate of the log: goal, angles, motor's speed, current.

    Currents are means over the sample before, as of a logger that filters by its own rate; a drive that nobody
    describes logs its own value of the moment.
    """
    model = mujoco.MjModel.from_xml_string(plant.mjcf())
    data = mujoco.MjData(model)
    sub = round(1.0 / (rate_Hz * STEP_S))
    count = round(duration_s * rate_Hz)
    is_open = plant.kind.startswith("open")
    before = 0 if is_open else round(SETTLES_S * rate_Hz) * sub
    at = STEP_S * np.arange(-before, count * sub)
    late = plant.has("goal_delay").get("delay_s", 0.0) if plant.kind != "joint" else 0.0
    ticks = np.arange(count + 1) / rate_Hz
    told = command(ticks)
    # The drive makes its own profile, of which the log has samples; what is put into an open one is held between them.
    goal = told[np.floor(at * rate_Hz + 1e-6).astype(int)] if is_open else command(np.maximum(at - late, 0.0))
    goal = goal * (1.0 + plant.has("goal_gain").get("ratio", 0.0))
    rise = np.gradient(goal, STEP_S) * plant.has("velocity_feedforward").get("ratio", 0.0)
    data.qpos[:] = goal[0]
    first = at[0]
    act = _Forces(plant, model)
    n, kt = plant.gear, plant.torque_constant
    limit, speed_limit = drive.current_limit, drive.speed_limit
    saturates = plant.has("torque_saturation").get("saturation_1_A", 0.0)
    position, velocity, ctrl, step = data.qpos, data.qvel, data.ctrl, mujoco.mj_step
    seen_at = 1 if plant.is_split else 0
    integral, current = 0.0, 0.0
    kept = np.empty((count, 4))
    by_force = plant.kind == "joint" or "computation_delay" in plant.effects or "current_loop_lag" in plant.effects
    total = 0.0
    for i, wanted in enumerate(goal.tolist()):
        q = position[0]
        seen = position[seen_at]
        omega = n * velocity[0]
        theta = n * q
        if plant.kind in ("cascade", "unknown"):
            if i % drive.every == 0:
                asked = drive.position_gain * n * (wanted - seen) + n * rise[i]
                error = min(max(asked, -speed_limit), speed_limit) - omega
                free = (drive.speed_gain * error + integral) / drive.constant
                current = min(max(free, -limit), limit)
                if abs(free) < limit or free * error < 0.0:
                    integral += drive.every * STEP_S * drive.integral_gain * error
            flows = current
        elif plant.kind == "servo":
            if i % drive.every == 0:
                duty = min(max(drive.position_gain * (wanted - seen), -1.0), 1.0)
            flows = (duty * plant.supply - kt * omega) / plant.resistance
        elif plant.kind == "open_voltage":
            duty = wanted
            flows = (duty * plant.supply - kt * omega) / plant.resistance
        elif plant.kind == "joint":
            flows = data.actuator_force[0] / kt  # as its own servo, its goal maybe delayed, gave last
        else:
            flows = wanted
        if plant.kind in ("servo", "open_voltage"):
            ctrl[0] = duty * plant.supply
        elif plant.kind == "joint":
            ctrl[0] = wanted
        else:
            torque = kt * flows
            ctrl[0] = torque / (1.0 + saturates * abs(flows))
        if act.any:
            act(data, first + i * STEP_S, theta, omega, flows / (1.0 + saturates * abs(flows)), q)
        moment = i - before
        if moment >= 0 and moment % sub == 0:
            row = kept[moment // sub]
            row[:] = theta, omega, seen, flows if plant.kind == "unknown" else total / sub
        if moment % sub == 0:
            total = 0.0
        step(model, data)
        # What the actuator gave in this step; of a motor whose iron saturates, the current that was sent.
        total += data.actuator_force[0] / kt if by_force else flows
    time = np.arange(count) / rate_Hz
    if not np.all(np.isfinite(kept)):
        raise FloatingPointError("a plant has left all bounds")
    motor, speed, output, current = kept.T
    return {"time": time, "command": told[:count], "motor": motor, "speed": speed, "output": output, "current": current}


class _Forces:
    """What MuJoCo has no element for, set before each step."""

    def __init__(self, plant: Plant, model: Any) -> None:
        self.plant, self.model = plant, model
        self.by_friction = [
            name
            for name in ("load_dependent_friction", "position_dependent_friction", "friction_zone")
            if name in plant.effects
        ]
        names = ["constant_load", "torque_ripple", "stribeck_friction", "asymmetric_friction", *OUTSIDE]
        if plant.kind not in ("servo", "open_voltage"):
            names.append("cogging_torque")
        self.applied = [(name, plant.effects[name]) for name in names if name in plant.effects]
        self.any = bool(self.by_friction or self.applied)
        self.share = 1.0 - _OUTPUTS_SHARE if "backlash" in plant.effects else 1.0  # of the friction, at the motor

    def __call__(self, data: Any, time: float, theta: float, omega: float, current: float, q: float) -> None:
        plant = self.plant
        n, kt, dry = plant.gear, plant.torque_constant, plant.dry
        for name in self.by_friction:
            one = plant.effects[name]
            if name == "load_dependent_friction":
                level = dry + one["ratio"] * abs(kt * current)
            elif name == "position_dependent_friction":
                level = dry * (1.0 + one["ratio"] * math.sin(one["order"] * theta + one["phase_rad"]))
            else:
                half = 0.5 * (one["end_rad"] - one["begin_rad"])
                away = (q - 0.5 * (one["end_rad"] + one["begin_rad"])) / half
                level = dry * (1.0 + one["ratio"] * max(0.0, 1.0 - away * away))
            self.model.dof_frictionloss[0] = n * level * self.share
        torque = 0.0  # at the motor
        for name, one in self.applied:
            if name == "constant_load":
                torque -= one["torque_Nm"] / n
            elif name == "cogging_torque":
                torque += one["amplitude_Nm"] * math.sin(one["order"] * theta + one["phase_rad"])
            elif name == "torque_ripple":
                torque += kt * current * one["ratio"] * math.cos(one["order"] * theta + one["phase_rad"])
            elif name == "stribeck_friction":
                # Frictionloss holds T_s; as the joint slides, what is above T_d is taken back.
                gone = 1.0 - math.exp(-((omega / one["speed_rad_s"]) ** 2))
                torque += math.copysign(dry * (one["breakaway_ratio"] - 1.0) * gone, omega)
            elif name == "asymmetric_friction":
                torque -= dry * one["ratio"] * min(1.0, abs(omega) / one["sticks_below_rad_s"])
            else:
                torque += OUTSIDE[name](one, time, q)
        data.qfrc_applied[0] = n * torque


def _shaking(one: Values, time: float, q: float) -> float:
    return one["torque_Nm"] * math.sin(2.0 * math.pi * one["rate_Hz"] * time + one["phase_rad"])


def _pump(one: Values, time: float, q: float) -> float:
    return -one["torque_Nm"] if (time * one["rate_Hz"] + one["phase_rad"]) % 1.0 < one["share"] else 0.0


def _bump(one: Values, time: float, q: float) -> float:
    return one["torque_Nm"] * math.exp(-(((q - one["at_rad"]) / one["width_rad"]) ** 2))


def _detent(one: Values, time: float, q: float) -> float:
    away = (q - one["at_rad"]) / one["width_rad"]
    return -one["torque_Nm"] * away * math.exp(0.5 - 0.5 * away * away)


# What the library does not hold: torques at the motor by time, or at one angle of the output.
OUTSIDE: dict[str, Callable[[Values, float, float], float]] = {
    "periodic_in_time": _shaking,
    "pump_in_time": _pump,
    "bump_at_an_angle": _bump,
    "detent_at_an_angle": _detent,
}


# --- commands ---------------------------------------------------------------------------------------------------------


def trapezoids(random: np.random.Generator, size: float, top: float, faster: float, dwell_s: float) -> Moves:
    """From one random level to the next with a trapezoid of speed, and a rest between; begins at rest at zero."""
    times, places = [0.0, 0.3], [0.0, 0.0]
    at, now = 0.0, 0.3
    ramp = top / faster
    shape = np.linspace(0.0, 1.0, 4001)
    while now < 5.0:
        to = float(size * random.uniform(-1.0, 1.0))
        way = abs(to - at)
        peak = min(top, math.sqrt(way * faster))
        ramp = peak / faster
        whole = way / peak + ramp
        t = shape * whole
        speed = np.minimum.reduce([t / ramp, np.ones_like(t), (whole - t) / ramp])
        gone = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))])
        times += [*(now + t[1:]).tolist(), now + whole + dwell_s]
        places += [*(at + (to - at) * gone[1:] / gone[-1]).tolist(), to]
        at, now = to, now + whole + dwell_s
    return lambda time: np.interp(time, times, places)


def chirp(random: np.random.Generator, size: float, end_Hz: float, duration_s: float) -> Moves:
    """A sine from 0.3 Hz up, the faster the smaller."""
    sign = float(random.choice([-1.0, 1.0]))

    def moves(time: Array) -> Array:
        rate = 0.3 + (end_Hz - 0.3) * time / duration_s
        turned = 2.0 * np.pi * (0.3 * time + 0.5 * (end_Hz - 0.3) / duration_s * time**2)
        begins = np.sin(0.5 * np.pi * np.minimum(time / 0.4, 1.0)) ** 2
        return sign * size * begins / np.sqrt(1.0 + (rate / 1.2) ** 2) * np.sin(turned)

    return moves


# --- what is drawn ----------------------------------------------------------------------------------------------------


@dataclass
class Rig:
    """A plant with its drive, its commands and its log."""

    plant: Plant
    drive: Drive
    commands: tuple[Moves, ...]  # the last is held out
    rate_Hz: float
    duration_s: float
    columns: tuple[tuple[str, str, str, str, float, float, float], ...]  # signal, source, name, unit, factor, σ, grain
    owner: Owner
    typical: Values = field(default_factory=dict)


KINDS = ("cascade", "joint", "servo", "unknown", "open_current", "open_voltage")
_SHARES = (34, 20, 16, 12, 8, 10)  # of a hundred
_COUNTS = {0: 20, 1: 50, 2: 30}
_OUTSIDE_OF = {1: 8, 2: 2}  # of those with one and two hidden, how many have one that the library does not hold
_LOADS = ("pendulum_load", "hinge_moment", "cubic_spring", "one_sided_spring")
_DRY = (
    "stribeck_friction",
    "asymmetric_friction",
    "friction_zone",
    "load_dependent_friction",
    "dry_friction",
    "quadratic_drag",
    "viscous_friction",
)
CLASSES = {  # what is hidden two at a time is of two classes
    **dict.fromkeys(_LOADS, "load"),
    **dict.fromkeys(_DRY, "friction"),
    **dict.fromkeys(("cogging_torque", "torque_ripple", "position_dependent_friction"), "periodic"),
    **dict.fromkeys(
        (
            "goal_delay",
            "goal_gain",
            "computation_delay",
            "current_loop_lag",
            "velocity_feedforward",
        ),
        "drive",
    ),
    "torsional_compliance": "two masses",
    "backlash": "two masses",
    "constant_load": "constant",
    "torque_saturation": "motor",
    "inertia_error": "inertia",
    **dict.fromkeys(OUTSIDE, "outside"),
}
_NOT_BESIDE = {"two masses": ("load", "constant", "outside")}  # where MuJoCo and the library put a load elsewhere
HIDES: dict[str, tuple[str, ...]] = {
    "cascade": (
        *_LOADS,
        *_DRY,
        "constant_load",
        "cogging_torque",
        "torque_ripple",
        "position_dependent_friction",
        "torque_saturation",
        "torsional_compliance",
        "backlash",
        "goal_delay",
        "computation_delay",
        "current_loop_lag",
        "velocity_feedforward",
        "inertia_error",
    ),
    # At a joint the library's viscous friction and cogging end below what a robot's would be, and MuJoCo's servo reads
    # the motor's side of a tendon.
    "joint": (
        *_LOADS,
        *(one for one in _DRY if one != "viscous_friction"),
        "constant_load",
        "goal_delay",
        "inertia_error",
    ),
    "servo": (
        *_LOADS,
        "stribeck_friction",
        "friction_zone",
        "load_dependent_friction",
        "dry_friction",
        "constant_load",
        "goal_delay",
        "goal_gain",
        "cogging_torque",
    ),
    "unknown": (
        *_LOADS,
        *_DRY,
        "constant_load",
        "cogging_torque",
        "torque_ripple",
        "position_dependent_friction",
        "torque_saturation",
        "inertia_error",
    ),
    "open_current": (
        "hinge_moment",
        "viscous_friction",
        "stribeck_friction",
        "asymmetric_friction",
        "quadratic_drag",
        "load_dependent_friction",
        "cogging_torque",
        "torque_saturation",
        "torsional_compliance",
    ),
    "open_voltage": (
        "quadratic_drag",
        "asymmetric_friction",
        "load_dependent_friction",
        "constant_load",
        "dry_friction",
        "inertia_error",
    ),
}
# Other names that say the same of such a log, and the base parameters whose value says it.
ALIKE: dict[str, tuple[str, ...]] = {
    "constant_load": ("current_sensor_bias",),
    "computation_delay": ("current_loop_lag", "sampled_control"),
    "current_loop_lag": ("computation_delay", "sampled_control"),
    "load_dependent_friction": ("mesh_friction",),
    "dry_friction": ("k1",),
    "backlash": ("k2",),
}
OUTSIDE_TOLERANCE = {
    "viscous_friction": ("viscous_friction",),
    "dry_friction": ("dynamic_friction",),
    "inertia_error": ("inertia", "mass"),
    "backlash": ("backlash",),
}


def what_is_hidden(seed: int) -> tuple[str, tuple[str, ...]]:
    """The kind of a seed's plant, and what it hides: a deck of a hundred, dealt anew for each hundred of seeds."""
    deal = np.random.default_rng([60, seed // 100])
    kinds = [kind for kind, share in zip(KINDS, _SHARES) for _ in range(share)]
    counts = [count for count, share in _COUNTS.items() for _ in range(share)]
    kinds = [str(one) for one in deal.permutation(kinds)]
    counts = [int(one) for one in deal.permutation(counts)]
    decks = {kind: [str(one) for one in deal.permutation(HIDES[kind])] for kind in KINDS}
    left, turn, dealt = dict(_OUTSIDE_OF), 0, []
    for kind, count in zip(kinds, counts):
        found: list[str] = []
        if count and left.get(count) and not kind.startswith("open"):
            left[count] -= 1
            found.append(list(OUTSIDE)[turn % len(OUTSIDE)])
            turn += 1
        while len(found) < count:
            deck = decks[kind]
            fits = [one for one in deck if all(_fit(one, other) for other in found)]
            found.append(fits[0])
            deck.remove(fits[0])
            deck.append(fits[0])  # under the deck
        dealt.append((kind, tuple(found)))
    return dealt[seed % 100]


def _fit(one: str, other: str) -> bool:
    a, b = CLASSES[one], CLASSES[other]
    return a != b and b not in _NOT_BESIDE.get(a, ()) and a not in _NOT_BESIDE.get(b, ())


def drawn(seed: int, kind: str = "", hidden: tuple[str, ...] | None = None) -> Rig:
    """The rig of a seed, whose kind and what it hides may be told instead."""
    dealt = what_is_hidden(seed)
    kind, hidden = kind or dealt[0], dealt[1] if hidden is None else hidden
    owner = Owner(np.random.default_rng([60, 1, seed]))
    rig = {"cascade": _cascade, "unknown": _cascade, "joint": _joint, "servo": _servo}.get(kind, _open)(
        kind, owner, hidden
    )
    # What the rig does without them, by which they are sized.
    seen = [simulated(rig.plant, rig.drive, one, rig.rate_Hz, rig.duration_s) for one in rig.commands[:2]]
    speed, output, current = (np.concatenate([one[name] for one in seen]) for name in ("speed", "output", "current"))
    rig.typical = {
        "speed": float(np.sqrt(np.mean(speed**2))),
        "top": float(np.max(np.abs(speed))),
        "travel": float(np.quantile(np.abs(output), 0.98)),
        "current": float(np.sqrt(np.mean(current**2))),
        "most": float(np.quantile(np.abs(current), 0.995)),
    }
    effects = dict(rig.plant.effects)
    for name in hidden:
        effects[name] = _sized(name, rig, owner)
    inertia = rig.plant.inertia
    if "torsional_compliance" in effects:
        inertia -= effects["torsional_compliance"]["inertia_kgm2"] / rig.plant.gear**2
        owner.truth["motor.inertia_kgm2"] = inertia
    rig.plant = replace(rig.plant, inertia=inertia, effects=effects)
    if "dry_friction" in effects:
        rig.plant = replace(rig.plant, dry=owner.truth["motor.dynamic_friction_Nm"] * effects["dry_friction"]["factor"])
        owner.truth["motor.dynamic_friction_Nm"] = rig.plant.dry
    if "inertia_error" in effects:
        rig.plant = replace(rig.plant, inertia=rig.plant.inertia * (1.0 + effects["inertia_error"]["ratio"]))
    rig.columns = _columns(rig, owner)
    mapping = ", ".join(f'"{signal}={name}[{unit}]"' for signal, _, name, unit, *_ in rig.columns)
    owner.says("recordings", f'mapping = ["time_s=t_ms[ms]", {mapping}]')
    return rig


def _sized(name: str, rig: Rig, owner: Owner) -> Values:
    """Settings by the library's names, of a size that a rig's owner would be troubled by."""
    random, plant, typical = owner.random, rig.plant, rig.typical
    n, dry, speed, travel = plant.gear, plant.dry, typical["speed"], typical["travel"]
    load = max(dry, 0.25 * plant.torque_constant * typical["current"])  # N·m at the motor
    u = random.uniform
    sign = float(random.choice([-1.0, 1.0]))
    phase = float(u(-3.0, 3.0))
    # So that a tooth is passed 80 times a second at most, at the usual speed.
    order = float(max(1, min(int(random.choice([1, 2, 4, 6, 12, 24])), math.floor(80.0 * 2.0 * np.pi / speed))))
    if plant.kind in ("joint", "servo"):
        order = float(random.integers(9, 30))
    match name:
        case "pendulum_load":
            return {"moment_Nm": n * load * u(0.8, 2.5), "angle_rad": u(-0.8, 0.8)}
        case "hinge_moment":
            return {"stiffness_Nm_rad": n * load * u(0.8, 2.0) / travel, "offset_Nm": 0.0}
        case "cubic_spring":
            return {"stiffness_Nm_rad3": n * load * u(1.0, 2.5) / travel**3}
        case "one_sided_spring":
            at = sign * u(0.15, 0.5) * travel
            return {"stiffness_Nm_rad": n * load * u(1.0, 2.5) / (0.5 * travel), "contact_rad": at}
        case "constant_load":
            return {"torque_Nm": sign * n * load * u(0.4, 1.2)}
        case "viscous_friction":
            return {"coefficient_Nms_rad": load * u(0.4, 1.2) / speed}
        case "stribeck_friction":
            return {"speed_rad_s": max(0.12, speed * u(0.06, 0.2)), "breakaway_ratio": u(1.4, 2.0)}
        case "asymmetric_friction":
            return {"ratio": sign * u(0.2, 0.45), "viscous_part_Nms_rad": 0.0, "sticks_below_rad_s": 1e-3 * speed}
        case "friction_zone":
            middle, half = u(-0.4, 0.4) * travel, u(0.2, 0.4) * travel
            return {"ratio": u(0.8, 2.0), "begin_rad": middle - half, "end_rad": middle + half}
        case "load_dependent_friction":
            return {"ratio": u(0.12, 0.3)}
        case "dry_friction":
            return {"factor": u(1.8, 2.6)}
        case "quadratic_drag":
            return {"speed_rad_s": speed / math.sqrt(load / dry * u(0.4, 1.2))}
        case "cogging_torque":
            return {"amplitude_Nm": load * u(0.3, 0.8), "order": order, "phase_rad": phase}
        case "torque_ripple":
            return {"ratio": u(0.08, 0.2), "order": order, "phase_rad": phase}
        case "position_dependent_friction":
            return {"ratio": u(0.3, 0.6), "order": order, "phase_rad": phase}
        case "torque_saturation":
            lost = u(0.14, 0.25)
            return {"saturation_1_A": lost / (1.0 - lost) / typical["most"]}
        case "torsional_compliance":
            inertia = u(0.3, 0.45) * plant.inertia * n * n
            # A loop on the output is stable where its gain is less than twice the mode's damping times its frequency.
            own, relative = (u(25.0, 45.0), u(0.08, 0.15)) if plant.kind == "cascade" else (u(9.0, 22.0), u(0.02, 0.06))
            stiffness = inertia * (2.0 * np.pi * own) ** 2
            damping = 2.0 * relative * math.sqrt(stiffness * inertia)
            return {"stiffness_Nm_rad": stiffness, "damping_Nms_rad": damping, "inertia_kgm2": inertia}
        case "backlash":
            return {"width_rad": u(3e-3, 9e-3)}
        case "goal_delay":
            return {"delay_s": round(u(6e-3, 25e-3) / STEP_S) * STEP_S}
        case "computation_delay":
            return {"delay_s": round(u(1e-3, 3e-3) / STEP_S) * STEP_S}
        case "current_loop_lag":
            return {"time_constant_s": u(1e-3, 3e-3)}
        case "velocity_feedforward":
            return {"ratio": u(0.4, 1.0)}
        case "goal_gain":
            return {"ratio": sign * u(0.03, 0.1)}
        case "inertia_error":
            return {"ratio": u(0.7, 1.3)}
        case "periodic_in_time":
            return {"torque_Nm": load * u(0.5, 1.2), "rate_Hz": u(2.5, 9.0), "phase_rad": phase}
        case "pump_in_time":
            return {"torque_Nm": load * u(0.8, 1.8), "rate_Hz": u(1.1, 2.7), "phase_rad": phase, "share": u(0.2, 0.5)}
        case "bump_at_an_angle" | "detent_at_an_angle":
            at = u(-0.4, 0.4) * travel
            return {"torque_Nm": load * u(1.0, 2.0), "at_rad": at, "width_rad": u(0.06, 0.14) * travel}
    raise ValueError(name)


def _motor(owner: Owner, hidden: tuple[str, ...], kt: float, inertia: float, viscous: float, dry: float) -> Values:
    """The motor's section of the file, and the true values of it."""
    known = {
        "torque_constant": owner.knows("motor.torque_constant_Nm_A", kt, 0.03),
        "inertia": owner.knows("motor.inertia_kgm2", inertia, 0.2 if "torsional_compliance" not in hidden else 0.25),
    }
    if "torsional_compliance" in hidden:  # a part of it swings apart, and the file must still allow the rest
        known["inertia"] = inertia * float(owner.random.uniform(0.95, 1.2))
    if "viscous_friction" in hidden:
        owner.says("motor", "viscous_friction_Nms_rad = 0.0")
        known["viscous"] = 0.0
    else:
        known["viscous"] = owner.knows("motor.viscous_friction_Nms_rad", viscous, 0.3)
    known["dry"] = owner.knows("motor.dynamic_friction_Nm", dry, 0.15)
    owner.says("motor", "static_friction_Nm = 0.0")  # never less than in motion
    return known


def _moves(owner: Owner, size: float, fastest_Hz: float, duration_s: float) -> tuple[Moves, ...]:
    """Two of three sorts to fit, and a multisine that is held out."""
    random = owner.random
    top = 2.0 * np.pi * 0.45 * fastest_Hz * size
    sorts = [
        waves(random, size, fastest_Hz),
        trapezoids(random, size, top, 2.0 * np.pi * 1.2 * fastest_Hz * top, 0.12),
        chirp(random, 0.8 * size, 1.3 * fastest_Hz, duration_s),
    ]
    chosen = random.permutation(3)[:2]
    return (*(sorts[one] for one in chosen), waves(random, size * float(random.uniform(0.8, 1.0)), 0.85 * fastest_Hz))


def _rate(owner: Owner) -> float:
    return float(owner.random.choice([500.0, 1000.0, 2000.0]))


def _cascade(kind: str, owner: Owner, hidden: tuple[str, ...]) -> Rig:
    """P position and PI speed over a current, behind a gear; of kind "unknown", a drive that the file leaves out."""
    gear = float(round(owner.near(45.0, 0.6)))
    kt, inertia, dry = owner.near(0.12, 0.5), owner.near(1.5e-4, 0.5), owner.near(0.03, 0.4)
    motor = _motor(owner, hidden, kt, inertia, owner.near(1.2e-4, 0.4), dry)
    plant = Plant(kind, gear=gear, **motor)
    owner.says("transmission", f"gear_ratio = {1.0 / gear!r}")
    speed, rate = owner.near(220.0 * inertia, 0.2), owner.near(20.0)
    drive = Drive(
        position_gain=rate,
        speed_gain=speed,
        integral_gain=owner.near(18.0) * speed,
        constant=kt,
        current_limit=25.0,
    )
    owner.says("controller", f'kind = "{"cascade" if kind == "cascade" else "unknown"}"')
    if kind == "cascade":
        drive = replace(
            drive,
            position_gain=owner.knows("controller.position_gain_1_s", rate * gear, 0.01) / gear,
            speed_gain=owner.knows("controller.speed_gain_Nms_rad", speed, 0.01),
            integral_gain=owner.knows("controller.integral_gain_Nm_rad", drive.integral_gain, 0.01),
        )
        _says_loop(owner, drive)
    if "backlash" in hidden:
        owner.says("transmission", "backlash_rad = { value = 2e-4, tolerance = 0.15 }")
    moves = _moves(owner, owner.near(1.0), owner.near(1.8), 3.0)
    return Rig(plant, drive, moves, _rate(owner), 3.0, (), owner)


def _says_loop(owner: Owner, drive: Drive) -> None:
    owner.says("controller", f"speed_limit_rad_s = {drive.speed_limit}", f"torque_constant_Nm_A = {drive.constant:.9g}")
    owner.says("controller", f"current_limit_A = {drive.current_limit:g}", "derivative_gain_Nms2_rad = 0.0")
    owner.says("controller", "integrator_window_rad = 10.0")
    owner.says("inverter", 'kind = "current"', f"current_limit_A = {drive.current_limit:g}")


def _joint(kind: str, owner: Owner, hidden: tuple[str, ...]) -> Rig:
    """A robot's joint under MuJoCo's own position servo: kp to the goal, kv against the speed; all at the output."""
    inertia = owner.near(0.2, 0.7)
    dry, viscous = inertia * owner.near(6.0, 0.4), inertia * owner.near(1.0, 0.5)
    motor = _motor(owner, hidden, owner.near(2.0, 0.5), inertia, viscous, dry)
    natural, relative = owner.near(22.0), owner.near(0.9, 0.2)
    kp, kv = inertia * natural**2, 2.0 * relative * natural * inertia
    owner.says("controller", 'kind = "cascade"')
    ratio = owner.knows("controller.position_gain_1_s", kp / kv, 0.01)
    kv = owner.knows("controller.speed_gain_Nms_rad", kv, 0.01)
    owner.says("controller", "integral_gain_Nm_rad = 0.0")
    told = owner.told["motor.torque_constant_Nm_A"]
    drive = Drive(constant=told, current_limit=500.0)
    _says_loop(owner, drive)
    # Of the torque that the servo's firmware asks for it makes a current by what it takes the motor to be.
    kv *= motor["torque_constant"] / told
    plant = Plant(kind, **motor, effects={"servo": {"kp": ratio * kv, "kv": kv}})
    moves = _moves(owner, owner.near(0.9), owner.near(1.6), 3.0)
    return Rig(plant, drive, moves, _rate(owner), 3.0, (), owner)


def _servo(kind: str, owner: Owner, hidden: tuple[str, ...]) -> Rig:
    """A hobby servo: MuJoCo's dcmotor, whose duty is in proportion to the position's error; all at the output."""
    motor = _motor(owner, hidden, owner.near(0.6, 0.2), owner.near(5e-3, 0.4), owner.near(0.01), owner.near(0.05))
    owner.says("controller", 'kind = "position"')
    supply = owner.near(7.4)
    gain = owner.knows("controller.gain_1_rad", owner.near(1.3), 0.05)
    resistance = owner.knows("motor.resistance_Ohm", owner.near(4.0), 0.1)
    owner.says("inverter", 'kind = "voltage"', f"bus_voltage_V = {supply}")
    owner.says("model", "step_s = 1e-4")
    plant = Plant(kind, **motor, resistance=resistance, supply=supply)
    moves = _moves(owner, owner.near(1.0), owner.near(1.5), 4.0)
    return Rig(plant, Drive(position_gain=gain, every=2), moves, 500.0, 4.0, (), owner)


def _open(kind: str, owner: Owner, hidden: tuple[str, ...]) -> Rig:
    """A motor without a loop: a current put into a torque motor, or a duty into MuJoCo's dcmotor."""
    owner.says("controller", 'kind = "open"')
    random = owner.random
    if kind == "open_current":
        kt, dry = owner.near(0.1, 0.5), owner.near(0.01, 0.4)
        motor = _motor(owner, hidden, kt, owner.near(1.2e-4, 0.4), owner.near(5e-5), dry)
        plant, size = Plant(kind, **motor), 6.0 * dry / kt
        moves = tuple(waves(random, size, fastest, 0.7) for fastest in (7.0, 4.0, 5.0))
        return Rig(plant, Drive(), moves, 1000.0, 3.0, (), owner)
    kt = owner.near(0.012, 0.4)
    motor = _motor(owner, hidden, kt, owner.near(2e-6, 0.4), owner.near(1e-6), owner.near(1.2e-3))
    resistance = owner.knows("motor.resistance_Ohm", owner.near(3.0), 0.1)
    supply = owner.near(12.0)
    owner.says("inverter", 'kind = "voltage"', f"bus_voltage_V = {supply}")
    plant = Plant(kind, **motor, resistance=resistance, supply=supply)
    levels = [steps(random, 0.7, dwell, 0.05) for dwell in (0.2, 0.3, 0.25)]
    moves = tuple((lambda time, one=one: np.round(one(time) * 999.0) / 999.0) for one in levels)
    return Rig(plant, Drive(), moves, 1000.0, 3.0, (), owner)


def _columns(rig: Rig, owner: Owner) -> tuple[tuple[str, str, str, str, float, float, float], ...]:
    """What the rig's logger writes: counts of encoders, a current with noise, in the units that it is made in."""
    random, kind = owner.random, rig.plant.kind
    unit, factor = ("deg", 180.0 / math.pi) if random.random() < 0.6 else ("rad", 1.0)
    turn = 2.0 * np.pi
    noise = rig.typical["current"] * float(random.uniform(0.01, 0.03))
    milli = ("mA", 1e3) if random.random() < 0.5 else ("A", 1.0)
    current = ("current_A", "current", f"iq_{milli[0]}", *milli, noise, float(f"{0.3 * noise:.1g}"))

    def angle(signal: str, source: str, name: str, grain: float) -> tuple[str, str, str, str, float, float, float]:
        return signal, source, f"{name}_{unit}", unit, factor, 0.0, grain

    goal = ("command_rad", "command", f"goal_{unit}", unit, factor, 0.0, 0.0)
    if kind in ("cascade", "unknown"):
        counts = turn / 2.0 ** int(random.integers(10, 13))
        found = [
            goal,
            angle("user_position_rad", "output", "joint", turn / 2.0 ** int(random.integers(14, 17))),
            angle("motor_position_rad", "motor", "rotor", counts),
            current,
        ]
        return tuple(found if kind == "cascade" else found[1:])
    if kind == "joint":
        return goal, angle("user_position_rad", "output", "joint", turn / 2.0 ** int(random.integers(13, 16))), current
    if kind == "servo":
        return goal, angle("user_position_rad", "output", "horn", turn / 4096.0), current
    if kind == "open_current":
        put_in = ("current_A", "command", "iq_A", "A", 1.0, 0.0, 0.0)
        found = [put_in, angle("motor_position_rad", "motor", "rotor", turn / 2.0**13)]
        if "torsional_compliance" in rig.plant.effects and random.random() < 0.5:
            found.append(angle("user_position_rad", "output", "table", turn / 2.0**13))
        return tuple(found)
    top = rig.typical["top"]
    speed = ("motor_speed_rad_s", "speed", "n_rpm", "rpm", 30.0 / math.pi, 0.003 * top, 5e-4 * top)
    return ("duty", "command", "pwm", "/999", 999.0, 0.0, 1.0 / 999.0), speed


# --- what is written --------------------------------------------------------------------------------------------------


def change_over_noise(rig: Rig, effect: str) -> Values:
    """By signal: the rms of what an effect changes beyond a constant and the parameters, over the sensor's noise."""
    without = replace(rig.plant, effects={k: v for k, v in rig.plant.effects.items() if k != effect})
    if effect == "dry_friction":
        without = replace(without, dry=without.dry / rig.plant.effects[effect]["factor"])
    elif effect == "inertia_error":
        without = replace(without, inertia=without.inertia / (1.0 + rig.plant.effects[effect]["ratio"]))
    elif effect == "torsional_compliance":
        without = replace(
            without, inertia=without.inertia + rig.plant.effects[effect]["inertia_kgm2"] / rig.plant.gear**2
        )
    measured = [one for one in rig.columns if one[1] != "command"]

    def seen(plant: Plant) -> list[Array]:
        runs = [simulated(plant, rig.drive, one, rig.rate_Hz, rig.duration_s) for one in rig.commands[:-1]]
        return [
            np.concatenate([run[source] for run in runs]) / math.hypot(noise, grain / math.sqrt(12.0))
            for _, source, _, _, _, noise, grain in measured
        ]

    with_it, base = seen(rig.plant), seen(without)
    moved = OUTSIDE_TOLERANCE.get(effect, ())
    columns = []
    for name in PARAMETERS:
        value = getattr(without, name)
        said = {"viscous": "viscous_friction", "dry": "dynamic_friction"}.get(name, name)
        if said in moved:  # of which the file is too sure
            continue
        other = seen(replace(without, **{name: value * 1.03} if value else {name: 1e-3 * without.dry}))
        columns.append(np.concatenate([a - b for a, b in zip(other, base)]))
    sizes = [one.size for one in base]
    if effect != "constant_load":
        for i in range(len(base)):
            columns.append(np.concatenate([np.full(size, float(i == j)) for j, size in enumerate(sizes)]))
    change = np.concatenate([a - b for a, b in zip(with_it, base)])
    matrix = np.column_stack(columns)
    left = change - matrix @ np.linalg.lstsq(matrix, change, rcond=None)[0]
    ends = np.cumsum(sizes)[:-1]
    return {one[0]: float(np.sqrt(np.mean(part**2))) for one, part in zip(measured, np.split(left, ends))}


def written(seed: int, folder: Path, kind: str = "", hidden: tuple[str, ...] | None = None) -> dict[str, Any]:
    """The files of a plant; returns its truth."""
    rig = drawn(seed, kind, hidden)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "base.toml").write_text(rig.owner.text, encoding="utf-8")
    for number, command in enumerate(rig.commands):
        random = np.random.default_rng([60, 2, seed, number])
        seen = simulated(rig.plant, rig.drive, command, rig.rate_Hz, rig.duration_s)
        table = {"t_ms": 1e3 * seen["time"]}
        for _, source, name, _, factor, noise, grain in rig.columns:
            values = seen[source] + noise * random.standard_normal(seen["time"].size)
            table[name] = factor * (np.round(values / grain) * grain if grain else values)
        rows = [",".join(table), *(",".join(f"{x:.9g}" for x in row) for row in zip(*table.values()))]
        name = ("fit_1", "fit_2", "held")[number]
        (folder / f"{name}.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    effects = {name: one for name, one in rig.plant.effects.items() if name != "servo"}
    told = {}
    for name, values in effects.items():
        shows = change_over_noise(rig, name)
        told[name] = {
            "in_library": name not in OUTSIDE,
            "right": [] if name in OUTSIDE else [name, *ALIKE.get(name, ())],
            "outside": list(OUTSIDE_TOLERANCE.get(name, ())),
            "values": {key: one for key, one in values.items() if key != "sticks_below_rad_s"},
            "change_over_noise": shows,
            "showable": max(shows.values()) >= SHOWABLE,
        }
    truth = {
        "seed": seed,
        "kind": rig.plant.kind,
        "mujoco": mujoco.__version__,
        "hidden": told,
        "parameters": rig.owner.truth,
        "rate_Hz": rig.rate_Hz,
        "typical": rig.typical,
    }
    (folder / "truth.json").write_text(json.dumps(truth, indent=1), encoding="utf-8")
    return truth


def turn(seed: int) -> int:
    """Where a seed stands in the order of work: mixed, so that an interrupted study is a sample of the whole."""
    return seed * 37 % 100


def main(arguments: list[str]) -> None:
    """As the module says."""
    folder = Path(arguments[0])
    first, _, last = (arguments[1] if len(arguments) > 1 else f"{STUDY[0]}-{STUDY[-1]}").partition("-")
    seeds = range(int(first), int(last or first) + 1)
    groups = ['title = "Plants of MuJoCo"', 'about = "Plants of a kind that nobody tuned to, an owner\'s file each."']
    for seed in sorted(seeds, key=turn):
        name = f"plant_{seed:03d}"
        saved = folder / name / "truth.json"  # written last
        truth = json.loads(saved.read_text(encoding="utf-8")) if saved.exists() else written(seed, folder / name)
        shows = ", ".join(f"{n} {max(one['change_over_noise'].values()):.3g}" for n, one in truth["hidden"].items())
        print(f"{name} {truth['kind']:13}{shows or '-'}", flush=True)
    for name in (f"plant_{seed:03d}" for seed in seeds):
        recordings = f'{{ each = "{name}", fit = ["fit_1.csv", "fit_2.csv"], holdout = ["held.csv"] }}'
        groups.append(f'\n[groups.{name}]\ndoes = "discover"\nactuator = "{name}/base.toml"\nrecordings = {recordings}')
    (folder / "mujoco_plants.toml").write_text("\n".join(groups) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
