"""The exported model as MJCF, and back: a joint with armature, damping and dry friction, and the motor that drives it.

Everything stands at the joint, which is the user's side: an inertia J of the motor is J/τ² there, a torque T/τ, a
motor constant k_t/τ.  MuJoCo's `dcmotor` has the circuit R i = V − k ω, a torque limit, a PID loop in torque whose
voltage is limited, one cogging harmonic and LuGre friction.  What it cannot hold is left out and told, and the joint's
values are fitted by replay in MuJoCo, so that the rest makes up for it as well as it can.
"""

from __future__ import annotations

import importlib
import importlib.util
import itertools
import math
import re
import time
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.effects import catalogue_name, find
from ema_model.effects.user import UserEffect
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.exports.exported import Exported
from ema_model.exports.replay import CannotHold, Proof, RecordingLoss, kernel_values, loss_of, shortened
from ema_model.models.loop_window import COMPARED, LoopWindow
from ema_model.quantities import MOTOR, USER, Axes, in_sentence

Array = NDArray[np.float64]

HELD = {  # effects that have a form in MJCF
    "cogging_torque": "the dcmotor's cogging",
    "constant_load": "the joint's spring",
    "demagnetisation": "the motor constant",
    "dry_friction": "the joint's frictionloss",
    "goal_delay": "the actuator's delay",
    "hinge_moment": "the joint's spring",
    "inertia_error": "the armature",
    "pendulum_load": "a mass on an arm",
    "presliding_friction": "the dcmotor's LuGre friction",
    "speed_loop_gain": "the controller's gains",
    "stribeck_friction": "the dcmotor's LuGre friction",
    "viscous_friction": "the joint's damping",
    "winding_resistance": "the dcmotor's resistance",
}
_GRAVITY = 9.81
_LIGHT = 1e-6  # of the inertia: the body's own, which MuJoCo must have
_SLIDES = 0.5  # the same of one that slides, whose dry friction MuJoCo weighs by the mass alone
_ARM = 0.01  # of the inertia, that a pendulum's mass makes at most
_SOFT = 1e-6  # of a constant load, that a spring changes by in 1 rad
_STIFF = 2.0  # steps in which dry friction takes hold; MuJoCo's own 20 ms let a joint creep
_BRISTLES = 0.2  # rad in a step, by which bristles swing that stand for none
_DAMPED = 0.02  # of their critical damping: more is felt in motion


def check() -> None:
    """InputError where MuJoCo is not installed."""
    if importlib.util.find_spec("mujoco") is None:
        raise InputError("MuJoCo is not installed, which replays the MJCF: pip install 'emaviz[export]'")


# --- the joint --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Joint:
    """What MuJoCo holds of an actuator, all at the user: rad and N·m, or m and N of a linear axis."""

    armature: float
    damping: float
    frictionloss: float
    low: float
    high: float
    stiffness: float = 0.0
    springref: float = 0.0
    moment: float = 0.0  # m g l of a pendulum
    hangs_at: float = 0.0  # rad
    motorconst: float = 1.0  # N·m/A
    resistance: float = 1.0  # Ω
    torque_limit: float = math.inf
    voltage: float = math.inf  # the most that the loop puts on
    bus_voltage: float = 1.0  # what a duty is a share of
    kp: float = 0.0
    ki: float = 0.0
    kd: float = 0.0
    ki_of_speed: float = 0.0  # of ∫ω dt, that the loop takes off
    begins_at: float = 0.0  # where that is 0
    is_duty: bool = False  # whether the loop puts on a share of the bus, and compensates no back-EMF
    lugre: tuple[float, float, float, float, float] | None = None
    cogging: tuple[float, float, float] | None = None
    delay_s: float = 0.0


def joint_of(actuator: Actuator, rows: Mapping[str, float]) -> Joint:
    """The joint of an actuator whose kernels' parameters are these, by name."""
    tau = rows["gear_ratio"]
    # of several of a kind the first
    effects = {catalogue_name(name): given for name, given in reversed(list(actuator.effects.items()))}

    def of(effect: str, name: str, default: float = 0.0) -> float:
        return float(effects[effect][name]) if effect in effects else default

    inertia = (1.0 + of("inertia_error", "ratio")) / rows["inverse_inertia"]
    constant = rows["torque_constant"] * rows["flux_0"] * (1.0 - of("demagnetisation", "ratio"))
    resistance = rows["resistance"] * (1.0 + of("winding_resistance", "ratio"))
    stiffness = of("hinge_moment", "stiffness_Nm_rad")
    steady = of("hinge_moment", "offset_Nm") + of("constant_load", "torque_Nm")
    if stiffness == 0.0 and steady != 0.0:
        stiffness = _SOFT * abs(steady)
    dynamic = max(rows["dynamic_friction"] + of("dry_friction", "torque_Nm"), 0.0)
    static = max(rows["static_friction"], dynamic)
    lugre = _lugre(actuator, effects, dynamic, static, inertia, tau)
    cogging = None
    if "cogging_torque" in effects:
        order, phase = (of("cogging_torque", name) for name in ("order", "phase_rad"))
        # a torque in phase with the user's angle: θ = q/τ
        cogging = (of("cogging_torque", "amplitude_Nm") / tau, order / tau, phase)
    joint = Joint(
        armature=inertia / tau**2,
        damping=(rows["viscous"] + of("viscous_friction", "coefficient_Nms_rad")) / tau**2,
        frictionloss=0.0 if lugre else dynamic / tau,
        low=rows["stop_low"] * tau,
        high=rows["stop_high"] * tau,
        stiffness=stiffness,
        springref=-steady / stiffness if stiffness else 0.0,
        moment=of("pendulum_load", "moment_Nm"),
        hangs_at=of("pendulum_load", "angle_rad"),
        motorconst=constant / tau,
        resistance=resistance,
        torque_limit=min(rows["torque_limit"], constant * rows["output_limit"] if _has_current(actuator) else math.inf)
        / tau,
        lugre=lugre,
        cogging=cogging,
        delay_s=of("goal_delay", "delay_s"),
        bus_voltage=rows["bus_voltage"],
    )
    return _with_loop(joint, actuator, rows, constant, resistance, of)


def _has_current(actuator: Actuator) -> bool:
    """Whether the controller's output is a current."""
    return actuator.controller.kind != "open" and actuator.circuit() != "voltage"


def _with_loop(
    joint: Joint,
    actuator: Actuator,
    rows: Mapping[str, float],
    constant: float,
    resistance: float,
    of: Callable[..., float],
) -> Joint:
    """The joint with its controller's gains, in torque."""
    tau, most = rows["gear_ratio"], rows["voltage_ratio"] * rows["bus_voltage"]
    match actuator.controller.kind, actuator.circuit():
        case "position", "voltage":
            kp = joint.motorconst / resistance * rows["bus_voltage"] * rows["position_gain"]
            return replace(joint, kp=kp, is_duty=True, voltage=most * rows["output_limit"])
        case "position", _:
            return replace(joint, kp=constant * rows["output_limit"] * rows["position_gain"] / tau, voltage=math.inf)
        case "cascade", drive:
            gain = rows["speed_gain"] * (1.0 + of("speed_loop_gain", "ratio"))
            scale = constant * rows["current_per_torque"]
            integral = rows["integral_gain"]
            # K_I ∫(G e − ω) dt is an integral of e, less K_I (θ − θ_0)
            return replace(
                joint,
                ki_of_speed=scale * integral / tau**2,
                kp=scale * gain * rows["position_gain"] / tau,
                ki=scale * integral * rows["position_gain"] / tau,
                kd=scale * gain / tau**2,
                voltage=math.inf if drive == "current" else most,
            )
    return joint


def _lugre(
    actuator: Actuator, effects: Mapping[str, Any], dynamic: float, static: float, inertia: float, tau: float
) -> tuple[float, float, float, float, float] | None:
    """LuGre friction's five values, where bristles or Stribeck's law ask for them."""
    speed, breakaway = 1.0, static
    if "stribeck_friction" in effects:
        speed = effects["stribeck_friction"]["speed_rad_s"]
        breakaway = max(static, effects["stribeck_friction"]["breakaway_ratio"] * dynamic)
    elif "presliding_friction" not in effects:
        return None
    stiffness = inertia * (_BRISTLES / actuator.step_s) ** 2
    damping = 2.0 * _DAMPED * math.sqrt(stiffness * inertia)
    if "presliding_friction" in effects:
        stiffness = effects["presliding_friction"]["stiffness_Nm_rad"]
        damping = effects["presliding_friction"]["damping_Nms_rad"]
    return stiffness / tau**2, damping / tau**2, dynamic / tau, breakaway / tau, speed * tau


# --- the file ---------------------------------------------------------------------------------------------------------


def document(one: Exported, joint: Joint, notes: Sequence[str] = ()) -> str:
    """NAME.xml."""
    stiff = _n(_STIFF * one.step_s)
    linear = one.actuator.axes.is_linear(USER)
    about = [f"{one.given.name}: {one.given.description}".rstrip(": "), *one.notes, *notes]
    arm = min(0.1, _ARM * joint.armature * _GRAVITY / abs(joint.moment)) if joint.moment else 0.0
    mass = abs(joint.moment) / (_GRAVITY * arm) if joint.moment else (_SLIDES if linear else _LIGHT) * joint.armature
    light = _LIGHT * joint.armature
    armature = joint.armature - (mass if linear else mass * arm**2 + light)
    angle = joint.hangs_at + (0.0 if joint.moment >= 0.0 else math.pi)
    # two actuators make the torque of a loop with an integral of the speed: both together are limited
    summed = bool(joint.ki_of_speed) and _is_limited(joint)
    most = f' actuatorfrcrange="{_n(-joint.torque_limit)} {_n(joint.torque_limit)}"' if summed else ""
    limits = f' range="{_n(joint.low)} {_n(joint.high)}"' if abs(joint.low) < 1e3 or abs(joint.high) < 1e3 else ""
    spring = f' stiffness="{_n(joint.stiffness)}" springref="{_n(joint.springref)}"' if joint.stiffness else ""
    kind, axis = ("slide", "1 0 0") if linear else ("hinge", "0 1 0")
    sensors = [
        f'    <jointpos name="{one.name}_position" joint="{one.name}"/>',
        f'    <jointvel name="{one.name}_speed" joint="{one.name}"/>',
        f'    <jointactuatorfrc name="{one.name}_torque" joint="{one.name}"/>'
        if joint.ki_of_speed
        else f'    <actuatorfrc name="{one.name}_torque" actuator="{one.name}"/>',
    ]
    return f"""\
<mujoco model={quoteattr(quoted(one.given.name, 100))}>
  <!-- {_comment(about)}

       Exported by emaviz, all at the joint.  ctrl: {_comment([_control(one)])}.  The motor's own current is the
       actuator's force over motorconst. -->
  <compiler angle="radian" autolimits="true"/>
  <option timestep="{_n(one.step_s)}" integrator="implicitfast" gravity="0 0 -{_GRAVITY}"/>
  <worldbody>
    <body name="{one.name}">
      <joint name="{one.name}" type="{kind}" axis="{axis}" armature="{_n(armature)}" damping="{_n(joint.damping)}"
             frictionloss="{_n(joint.frictionloss)}" solreffriction="{stiff} 1"{spring}{limits}{most}/>
      <inertial pos="{_n(arm * math.sin(angle))} 0 {_n(-arm * math.cos(angle))}" mass="{_n(mass)}"
                diaginertia="{_n(light)} {_n(light)} {_n(light)}"/>
    </body>
  </worldbody>
  <actuator>
{_motor(one, joint)}
  </actuator>
  <sensor>
{chr(10).join(sensors)}
  </sensor>
</mujoco>
"""


def _motor(one: Exported, joint: Joint) -> str:
    named = f'name="{one.name}" joint="{one.name}"'
    late = ""
    if joint.delay_s > 0.0:
        late = f' delay="{_n(joint.delay_s)}" nsample="{math.ceil(joint.delay_s / one.step_s) + 2}" interp="linear"'
    limited = _is_limited(joint) and not joint.ki_of_speed
    circuit = f'motorconst="{_n(joint.motorconst)}" resistance="{_n(joint.resistance)}"'
    saturation = f' saturation="{_n(joint.torque_limit)}"' if limited else ""
    if one.takes_torque:
        force = f' forcerange="{_n(-joint.torque_limit)} {_n(joint.torque_limit)}"' if limited else ""
        lines = [f"    <motor {named}{late}{force}/>"]
    elif one.actuator.takes_voltage:
        lines = [f"    <dcmotor {named} {circuit}{saturation}{late}/>"]
    else:
        # MuJoCo's loop compensates the back-EMF, and this kd takes that away where v = V g e
        kd = joint.motorconst**2 / joint.resistance if joint.is_duty else joint.kd
        most = f" {_n(joint.voltage)}" if math.isfinite(joint.voltage) else " 0"
        loop = f'input="pos" controller="{_n(joint.kp)} {_n(joint.ki)} {_n(kd)} 0 0{most}"'
        lines = [f"    <dcmotor {named} {circuit}{saturation}\n             {loop}{late}/>"]
    if joint.ki_of_speed:
        bias = f"{_n(joint.ki_of_speed * joint.begins_at)} {_n(-joint.ki_of_speed)} 0"
        lines.append(f'    <general name="{one.name}_speed_integral" joint="{one.name}" gainprm="0" biastype="affine"')
        lines.append(f'             biasprm="{bias}"/>')
    passive = ""
    if joint.cogging:
        passive += f' cogging="{" ".join(map(_n, joint.cogging))}"'
    if joint.lugre:
        passive += f' lugre="{" ".join(map(_n, joint.lugre))}"'
    if passive:
        lines.append(f'    <dcmotor joint="{one.name}" input="none" motorconst="0" resistance="1"{passive}/>')
    return "\n".join(lines)


def _is_limited(joint: Joint) -> bool:
    return joint.torque_limit < 1e8


def _control(one: Exported) -> str:
    if one.takes_torque:
        return "the motor's torque at the joint"
    return "the motor's voltage, V" if one.actuator.takes_voltage else f"{one.command.meaning}, {one.command.unit}"


def _n(value: float) -> str:
    return f"{float(value):.10g}"


def _comment(lines: Sequence[str]) -> str:
    return "\n       ".join(quoted(line).replace("--", "− −") for line in lines)


# --- run --------------------------------------------------------------------------------------------------------------

_MOST_STEPS = 60_000  # of one replay while values are fitted
_EVALUATIONS = 30
_FARTHEST = math.log(20.0)  # that a value may go from its own
_FITTED = ("armature", "damping", "frictionloss", "kp", "motorconst")
_PULL = 0.02  # toward the model's own values, where the recordings tell nothing of them
_CHANGED = 0.005  # of a value, from which on its fit is told


def run(one: Exported, joint: Joint, proof: Proof, place: int) -> dict[str, Array]:
    """The four signals of a window in MuJoCo, (samples,) each, as the sensors show them.

    A drive that is switched off meanwhile is a joint without its motor.
    """
    window = proof.windows[place]
    actuator, values, state = kernel_values(proof, window)
    tau = values["gear_ratio"]
    joint = replace(joint, begins_at=state["theta"] * tau)
    put_in = window.command
    if one.takes_torque:
        put_in = put_in * values["torque_constant"] / tau
    elif one.actuator.takes_voltage:
        put_in = put_in * values["bus_voltage"] * window.supply
    text = document(_at_step(one, window.step_s), joint)
    integral = 0.0
    if joint.ki > 0.0:
        integral = state["integral"] * values["torque_constant"] * values["current_per_torque"] / tau / joint.ki
    at = (state["theta"] * tau, state["omega"] * tau)
    is_on = window.supply > 0.0
    switched = [0, *(np.flatnonzero(np.diff(is_on)) + 1), is_on.size]
    parts = []
    for first, last in itertools.pairwise(switched):
        own = text if is_on[first] else _ACTUATORS.sub("", text)
        part = _rolled_out(own, at, integral, put_in[first:last], window.load[first:last])
        at, integral = tuple(part[-1, :2]), 0.0
        parts.append(part)
    moved = np.concatenate(parts)
    current = moved[:, 2].reshape(-1, window.steps_per_sample).mean(axis=1) / joint.motorconst
    position, speed = moved[window.steps_per_sample - 1 :: window.steps_per_sample, :2].T
    shown = dict(zip(COMPARED, (current, speed / tau, position / tau, position)))
    signals = {name: np.ascontiguousarray(shown[name][None]) for name in COMPARED}
    return {name: of[0] for name, of in proof.model.sensed(signals, actuator, window.block_s).items()}


_ACTUATORS = re.compile(r"  <actuator>.*?</actuator>\n|    <(joint)?actuatorfrc .*?/>\n", re.DOTALL)


def _rolled_out(text: str, at: Sequence[float], integral: float, put_in: Array, load: Array) -> Array:
    """Position, speed and the motor's torque at the end of each step, (steps, 3)."""
    mujoco: Any = importlib.import_module("mujoco")  # which states no types
    rollout: Any = importlib.import_module("mujoco.rollout")
    try:
        model = mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        raise InputError(f"MuJoCo refuses the MJCF: {quoted(error, 200)}") from None
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0] = at
    if integral:
        data.act[0] = integral
    whole = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.empty(mujoco.mj_stateSize(model, int(whole)))
    mujoco.mj_getState(model, data, start, int(whole))
    columns = [put_in, 0.0 * put_in][: model.nu]
    control = np.column_stack([*columns, -load])
    kinds = int(mujoco.mjtState.mjSTATE_CTRL | mujoco.mjtState.mjSTATE_QFRC_APPLIED)
    states, sensed = rollout.rollout(model, data, start[None], control[None], control_spec=kinds)
    torque = sensed[0, :, 2] if model.nsensor > 2 else 0.0 * load
    return np.column_stack([states[0, :, 1:3], torque])


def _at_step(one: Exported, step_s: float) -> Exported:
    """The same at another step."""
    return replace(one, actuator=replace(one.actuator, step_s=step_s))


def joints_of(proof: Proof) -> list[Joint]:
    """The joint of each window, which may have values of its own."""
    found = []
    for window in proof.windows:
        actuator, values, _ = kernel_values(proof, window)
        supply = float(_even(window).max())
        at_step = replace(actuator, step_s=window.step_s)
        found.append(joint_of(at_step, {**values, "bus_voltage": values["bus_voltage"] * supply}))
    return found


def _even(window: LoopWindow) -> Array:
    """The supply at its mean wherever the drive is on."""
    is_on = window.supply > 0.0
    return np.where(is_on, window.supply[is_on].mean() if np.any(is_on) else 1.0, 0.0)


def fitted(proof: Proof, joint: Joint, progress: Callable[[str], None]) -> tuple[Joint, dict[str, float]]:
    """The joint with values by which MuJoCo comes nearest to the recordings; and by which factor each has changed.

    A value of each window's own changes by the same factor.  Without recordings it comes nearest to the monitor model.
    """
    from scipy.optimize import least_squares  # takes a third of a second to import

    short = shortened(proof, _MOST_STEPS)
    names = [
        name for name in _FITTED if getattr(joint, name) > 0.0 and not (name == "motorconst" and proof.one.takes_torque)
    ]
    sizes = [_sizes(short, place) for place in range(len(short.windows))]
    joints = joints_of(short)
    count = 0

    def away(logs: Array) -> Array:
        nonlocal count
        count += 1
        progress(f"fitting MuJoCo's joint ({count} of about {_EVALUATIONS})")
        parts = []
        for place, own in enumerate(joints):
            changed = scaled(own, dict(zip(names, np.exp(logs))))
            shown = run(proof.one, changed, short, place)
            for name, (aim, size) in sizes[place].items():
                error = np.nan_to_num((shown[name] - aim) / size, nan=1e6, posinf=1e6, neginf=-1e6)
                parts.append(np.clip(error, -1e6, 1e6) / math.sqrt(error.size))
        return np.concatenate([*parts, _PULL * logs])

    found = least_squares(
        away,
        np.zeros(len(names)),
        bounds=(-_FARTHEST, _FARTHEST),
        diff_step=1e-3,
        max_nfev=max(2, _EVALUATIONS // (len(names) + 1)),
        loss="linear",
    )
    factors = dict(zip(names, np.exp(found.x).tolist()))
    return scaled(joint, factors), factors


def scaled(joint: Joint, factors: Mapping[str, float]) -> Joint:
    """The joint with values times these factors."""
    return replace(joint, **{name: getattr(joint, name) * factor for name, factor in factors.items()})


def _sizes(proof: Proof, place: int) -> dict[str, tuple[Array, float]]:
    """Of a window, what each signal is to come near to, and what its error is counted by."""
    window, ours = proof.windows[place], proof.ours[place]
    found = {}
    for name, shown in ours.items():
        aim = shown if proof.simulated else window.measured.get(name)
        if aim is None:
            continue
        spread = float(np.std(aim))
        size = 0.01 * spread if proof.simulated else max(float(np.sqrt(np.mean((shown - aim) ** 2))), 1e-3 * spread)
        if size > 0.0:
            found[name] = (aim, size)
    return found


def replayed_in_mujoco(
    proof: Proof, factors: Mapping[str, float], progress: Callable[[str], None]
) -> list[RecordingLoss]:
    """MuJoCo over every window."""
    found = []
    for place, (window, own) in enumerate(zip(proof.windows, joints_of(proof))):
        progress(f"replaying {window.name or 'a run'} in MuJoCo ({place + 1} of {len(proof.windows)})")
        began = time.perf_counter()
        shown = run(proof.one, scaled(own, factors), proof, place)
        elapsed = time.perf_counter() - began
        found.append(loss_of(proof.one, window, proof.ours[place], shown, elapsed))
    return found


def in_words(joint: Joint, factors: Mapping[str, float]) -> list[str]:
    """'Fitted by replay: frictionloss 0.0312, 1.08 times the model's.'; of values that have changed."""
    parts = [
        f"{name} {getattr(joint, name):.4g}, {factor:.3g} times the model's"
        for name, factor in factors.items()
        if abs(factor - 1.0) > _CHANGED
    ]
    return [f"Fitted by replay in MuJoCo: {'; '.join(parts)}."] if parts else []


# --- what MuJoCo cannot hold ------------------------------------------------------------------------------------------

_LEAST = 5e-4  # of our error, from which on a part is told


def losses(proof: Proof, progress: Callable[[str], None]) -> list[CannotHold]:
    """Each part of the model that MuJoCo has no form for, the greatest first.

    share: by how much of itself our own error grows without it; without recordings, how far the model without it is
    from the whole model, of the signals' size.
    """
    actuator = proof.one.actuator
    left_out: list[tuple[str, dict[str, float], bool]] = []  # what, the values without it, whether the supply is even
    found: list[CannotHold] = []
    seen: set[str] = set()
    for name in actuator.effects:
        kind = catalogue_name(name)
        if kind in HELD and kind not in seen:
            seen.add(kind)  # a second one of the kind has no place
            continue
        effect = find(name, actuator.axes)
        without = {f"effects.{name}.{parameter.name}": 0.0 for parameter in effect.parameters}
        if not isinstance(effect, UserEffect):
            without = {f"effects.{name}.{effect.parameters[0].name}": effect.nothing}
        elif effect.kind != "torque_curve":  # nobody knows with which values an expression is nothing
            found.append(CannotHold(in_sentence(effect.title), math.nan))
            continue
        left_out.append((in_sentence(effect.title), without, False))
    motor, controller, transmission = actuator.motor, actuator.controller, actuator.transmission
    if transmission.backlash_rad > 0.0:
        left_out.append(("backlash", {"transmission.backlash_rad": 0.0}, False))
    has_lugre = bool({"stribeck_friction", "presliding_friction"} & set(map(catalogue_name, actuator.effects)))
    if motor.static_friction_Nm > motor.dynamic_friction_Nm and not has_lugre:
        equal = {"motor.static_friction_Nm": motor.dynamic_friction_Nm}
        left_out.append(("more friction at rest than in motion", equal, False))
    if controller.kind == "cascade":
        left_out.append(("the speed limit of the position loop", {"controller.speed_limit_rad_s": 1e9}, False))
        if controller.derivative_gain_Nms2_rad > 0.0:
            left_out.append(("the derivative action", {"controller.derivative_gain_Nms2_rad": 0.0}, False))
    if not actuator.takes_voltage and any(np.any(_even(one) != one.supply) for one in proof.windows):
        left_out.append(("a supply that changes in a run", {}, True))
    for what, values, even in left_out:
        progress(f"the model without {what}")
        share = _share(proof, actuator.varied(values), even)
        if not math.isfinite(share) or share >= _LEAST:
            found.append(CannotHold(what, share))
    return sorted(found, key=lambda one: -one.share if math.isfinite(one.share) else 0.0)


def _share(proof: Proof, without: Actuator, even: bool) -> float:
    squares, counts = 0.0, 0
    model = copy(proof.model)
    if even:
        model.windows = [replace(one, supply=_even(one)) for one in model.windows]
    for place, ours in enumerate(proof.ours):
        shown = model.signals(place, actuator=without)
        for name, (aim, size) in _sizes(proof, place).items():
            if proof.simulated:
                size = float(np.std(ours[name]))
            error = np.nan_to_num(shown[name][0] - aim, nan=1e6)
            squares += float(np.mean((error / size) ** 2))
            counts += 1
    if counts == 0:
        return math.nan
    rms = math.sqrt(squares / counts)
    return rms if proof.simulated else rms - 1.0


# --- back again: a joint of an MJCF model, with the actuator that drives it, as the tables of an actuator file --------

_FAST = 1e4  # rad/s: a speed limit that is none
_STRONG = 1e3  # times the dry friction: a torque limit where the model has none
_SAME = 1e-3  # relative


def joint_tables(text: str) -> tuple[dict[str, Any], str, str, list[str]]:
    """A joint of "model.xml#joint": tables with the names of files, kinds of controller and drive, and notes.

    The inertia is that of the joint at the model's own position, links and armature.  What MuJoCo's actuator is
    decides the controller: a position servo with damping is a cascade, one without it a position loop, a `motor` an
    open loop, a `dcmotor` what its input says; any other is unknown, and left to inverse dynamics.
    Raises InputError where MuJoCo is not installed, for a file that is no MJCF, and for a joint that it does not have.
    """
    check()
    file, _, wanted = text.rpartition("#") if "#" in text else (text, "", "")
    model, mujoco = _model(file)
    joint = _joint(model, mujoco, file, wanted)
    kind, slide = int(model.jnt_type[joint]), int(mujoco.mjtJoint.mjJNT_SLIDE)
    if kind not in (slide, int(mujoco.mjtJoint.mjJNT_HINGE)):
        raise InputError(f"{quoted(text)}: is a free or ball joint; name a hinge or a slide")
    linear = kind == slide
    axes = Axes("linear", "linear") if linear else Axes()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    dof = model.jnt_dofadr[joint]
    friction = float(model.dof_frictionloss[dof])
    motor = {
        "inertia_kgm2": float(model.dof_M0[dof]),
        "viscous_friction_Nms_rad": float(_first(model.dof_damping[dof])),
        "static_friction_Nm": friction,
        "dynamic_friction_Nm": friction,
        "torque_constant_Nm_A": 1.0,
    }
    sections: dict[str, dict[str, float]] = {"motor": motor, "transmission": {}}
    if model.jnt_limited[joint]:
        low, high = model.jnt_range[joint].tolist()
        sections["transmission"] |= {"stop_low_rad": low, "stop_high_rad": high}
    controller, drive, notes = _driven(model, mujoco, joint, sections)
    if controller == "unknown":
        sections["transmission"].clear()
    tables: dict[str, Any] = {"axes": {"motor": axes.motor, "user": axes.user}}
    for section, values in sections.items():
        side = USER if section == "transmission" else MOTOR
        named = {_name(axes, name, side): {"value": value} for name, value in values.items()}
        if named:
            tables[section] = named
    if float(_first(model.jnt_stiffness[joint])) != 0.0:
        tables["effects"] = {"hinge_moment": _spring(model, joint, axes)}
    return tables, controller, drive, notes


def _model(file: str) -> tuple[Any, Any]:
    mujoco: Any = importlib.import_module("mujoco")  # which states no types
    if not Path(file).is_file():
        raise InputError(f"{quoted(file)}: no such file; name an MJCF model and its joint, as model.xml#joint")
    try:
        return mujoco.MjModel.from_xml_path(file), mujoco
    except ValueError as error:
        raise InputError(f"{quoted(file)}: MuJoCo cannot read it: {quoted(error, 200)}") from None


def _joint(model: Any, mujoco: Any, file: str, wanted: str) -> int:
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, i) or "" for i in range(model.njnt)]
    if wanted in names and wanted:
        return names.index(wanted)
    if not wanted and model.njnt == 1:
        return 0
    known = [quoted(name, 40) for name in names if name]
    listed = ", ".join(known[:12]) + (" …" if len(known) > 12 else "")
    if not wanted:
        raise InputError(
            f"{quoted(file)}: say which joint, as {quoted(file)}#NAME; it has {listed or 'none with a name'}"
        )
    like = did_you_mean(wanted, known)
    raise InputError(f"{quoted(file)}: has no joint {quoted(wanted)!r}; it has {listed or 'none with a name'}{like}")


def _driven(model: Any, mujoco: Any, joint: int, sections: dict[str, dict[str, float]]) -> tuple[str, str, list[str]]:
    """The kinds of controller and drive, of the first actuator of the joint; its values are put into the sections."""
    on_joint = int(mujoco.mjtTrn.mjTRN_JOINT)
    found = [
        i for i in range(model.nu) if model.actuator_trntype[i] == on_joint and model.actuator_trnid[i, 0] == joint
    ]
    if not found:
        return "unknown", "current", ["no actuator drives the joint: its controller is unknown"]
    one = found[0]
    notes = [f"the joint has {len(found)} actuators, and the first is taken"] if len(found) > 1 else []
    gear = float(model.actuator_gear[one, 0])
    if gear <= 0.0:
        return (
            "unknown",
            "current",
            [*notes, f"the actuator's gear is {gear:g}, and only one above 0 is a transmission"],
        )
    _at_motor(sections, gear)
    gain, bias = model.actuator_gainprm[one], model.actuator_biasprm[one]
    limit = float(model.actuator_forcerange[one, 1]) if model.actuator_forcelimited[one] else math.inf
    kinds = int(model.actuator_gaintype[one]), int(model.actuator_biastype[one])
    fixed, of_dcmotor = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_DCMOTOR)
    none, affine = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)
    if kinds == (fixed, none):
        sections["motor"]["torque_limit_Nm"] = min(limit, 1e9)
        return "open", "current", notes
    if kinds == (fixed, affine) and gain[0] > 0.0 and abs(gain[0] + bias[1]) <= _SAME * gain[0]:
        return (*_servo(sections, float(gain[0]), -float(bias[2]), 0.0, gear, limit), notes)
    if kinds[0] == of_dcmotor:
        return _dcmotor(model, mujoco, one, sections, gear, limit, notes)
    return "unknown", "current", [*notes, "its actuator is no motor and no position servo: its controller is unknown"]


def _at_motor(sections: dict[str, dict[str, float]], gear: float) -> None:
    """What stands at the joint, as the motor before the gear feels it."""
    motor = sections["motor"]
    motor["inertia_kgm2"] /= gear**2
    motor["viscous_friction_Nms_rad"] /= gear**2
    motor["static_friction_Nm"] /= gear
    motor["dynamic_friction_Nm"] /= gear
    if gear != 1.0:
        sections["transmission"]["gear_ratio"] = 1.0 / gear


def _servo(
    sections: dict[str, dict[str, float]], kp: float, kd: float, ki: float, gear: float, limit: float
) -> tuple[str, str]:
    """A loop in torque at the motor: kp and ki per motor angle that is missing, kd per motor speed."""
    motor = sections["motor"]
    most = limit if math.isfinite(limit) else _STRONG * max(motor["dynamic_friction_Nm"], kp * 1e-3)
    sections["inverter"] = {"current_limit_A": most}
    if kd <= 0.0:
        sections["controller"] = {"gain_1_rad": kp * gear / (most * motor["torque_constant_Nm_A"])}
        return "position", "current"
    sections["controller"] = {
        "position_gain_1_s": kp / kd * gear,
        "speed_limit_rad_s": _FAST,
        "speed_gain_Nms_rad": kd,
        "integral_gain_Nm_rad": ki * kd / kp,
        "torque_constant_Nm_A": motor["torque_constant_Nm_A"],
        "current_limit_A": most,
    }
    return "cascade", "current"


def _dcmotor(
    model: Any,
    mujoco: Any,
    one: int,
    sections: dict[str, dict[str, float]],
    gear: float,
    limit: float,
    notes: list[str],
) -> tuple[str, str, list[str]]:
    resistance, constant = (float(value) for value in model.actuator_gainprm[one][:2])
    motor = sections["motor"]
    motor["torque_constant_Nm_A"] = constant
    if math.isfinite(limit):
        motor["torque_limit_Nm"] = limit
    spec = int(model.actuator_ctrlspec[one])
    kp, ki, kd, most = (float(value) for value in model.actuator_gainprm[one][4:8])
    if spec & int(mujoco.mjtCtrlInput.mjINPUT_POS) and kp > 0.0:
        braking = constant**2 / resistance
        if most > 0.0 and ki == 0.0 and abs(kd - braking) <= _SAME * braking:
            motor["resistance_Ohm"] = resistance
            sections["inverter"] = {"bus_voltage_V": most}
            sections["controller"] = {"gain_1_rad": kp * resistance / (constant * most) * gear}
            return "position", "voltage", notes
        controller, drive = _servo(sections, kp, kd, ki, gear, limit / constant)
        if most > 0.0:
            notes = [*notes, f"the limit of its voltage, {most:g} V, is left out: its current comes at once here"]
        return controller, drive, notes
    if spec & int(mujoco.mjtCtrlInput.mjINPUT_VOLTAGE):
        motor["resistance_Ohm"] = resistance
        return "open", "voltage", notes
    return (
        "unknown",
        "current",
        [*notes, "its dcmotor follows no position and takes no voltage: its controller is unknown"],
    )


def _spring(model: Any, joint: int, axes: Axes) -> dict[str, Any]:
    stiffness = float(_first(model.jnt_stiffness[joint]))
    offset = -stiffness * float(model.qpos_spring[model.jnt_qposadr[joint]])
    return {
        axes.name("stiffness_Nm_rad", USER): {"value": stiffness},
        axes.name("offset_Nm", USER): {"value": offset},
    }


def _name(axes: Axes, name: str, side: Any) -> str:
    if name == "gear_ratio":
        return name
    return axes.name(name, USER if name == "gain_1_rad" else side)


def _first(value: Any) -> Any:
    """Of a polynomial's coefficients the linear one."""
    return value.flat[0] if getattr(value, "ndim", 0) else value
