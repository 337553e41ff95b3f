"""The exported model as a Python file that stands alone: numpy or torch in, signals or a joint's torque out."""

from __future__ import annotations

import importlib.util
import keyword
import math
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.errors import quoted
from ema_model.exports.exported import Exported, Field
from ema_model.exports.program import (
    Assign,
    Call,
    Choice,
    Expression,
    Flag,
    Function,
    If,
    Name,
    Number,
    Operation,
    Part,
    Return,
    Row,
    Statement,
    shown_part,
)

Array = NDArray[np.float64]

_WIDTH = 110
_BINDING = {"or": 1, "and": 2, "==": 0, "!=": 0, "<": 0, "<=": 0, ">": 0, ">=": 0, "+": 5, "-": 5, "*": 6, "/": 6}
_SPELT = {"or": "|", "and": "&"}
_HIGHEST = 9
_OWN = {
    "s",
    "p",
    "where",
    "larger",
    "smaller",
    "anywhere",
    "xp",
    "math",
    "Model",
    "State",
    "Parameters",
    "numpy",
    "abs",
    "vars",
}
# What `advance` finds before it moves the rotor, which a simulator does itself.
_OF_TORQUE = ("current", "active", "static", "dynamic", "dry", "resisting")

# --- functions --------------------------------------------------------------------------------------------------------


def _function(one: Function) -> str:
    taken = [*one.own, *map(_variable, one.parameters)]
    says = one.says.replace("\\", "/").replace('"""', "'''")
    head = textwrap.wrap(f"def {one.name}({', '.join(taken)}):", _WIDTH, subsequent_indent="        ")
    lines = [*head, *([f'    """{says}"""'] if says else [])]
    body = [line for statement in one.body for line in _statement(statement)]
    return "\n".join([*lines, *(f"    {line}" for line in body or ["return"]), ""])


def _statement(one: Statement) -> list[str]:
    match one:
        case Assign(targets=(), value=value):
            return _wrapped("", value)
        case Assign(targets=targets, value=value):
            places = ", ".join(map(_text, targets))
            return _wrapped(f"({places}) = " if len(targets) > 3 else f"{places} = ", value)
        case If(test=test, body=body):
            return [f"if anywhere({_text(test)}):", *(f"    {line}" for it in body for line in _statement(it))]
        case Return(values=values):
            return _wrapped("return ", *values)
    raise TypeError(one)


def _text(one: Expression, binding: int = 0) -> str:
    """An expression; in parentheses where what is around it binds more."""
    own = _HIGHEST
    match one:
        case Number(value=value):
            text, own = _number(value), _HIGHEST if value >= 0.0 else 7
        case Flag(value=value):
            text = str(value)
        case Name(name=name):
            text = _variable(name)
        case Row(of=of, name=name):
            text = f"{of}.{name}"
        case Operation(operator="neg", operands=(operand,)):
            text, own = f"-{_text(operand, 8)}", 7
        case Operation(operator="not", operands=(operand,)):
            text = f"where({_text(operand)}, False, True)"
        case Operation(operator="max", operands=(left, right)):
            text = f"larger({_text(left)}, {_text(right)})"
        case Operation(operator="min", operands=(left, right)):
            text = f"smaller({_text(left)}, {_text(right)})"
        case Operation(operator="pow", operands=(left, right)):
            text = f"({_text(left, 9)}) ** ({_text(right)})"
        case Operation(operator=operator, operands=operands) if operator in _BINDING:
            own = _BINDING[operator]
            # & and | bind more than comparisons, which so stand in parentheses
            first, others = (3, 3) if operator in _SPELT else (max(own, 1), own + 1)
            parts = [_text(operands[0], first), *(_text(inner, others) for inner in operands[1:])]
            text = f" {_SPELT.get(operator, operator)} ".join(parts)
        case Operation(operator=operator, operands=operands):
            text = f"{'' if operator == 'abs' else 'xp.'}{operator}({', '.join(map(_text, operands))})"
        case Choice(test=test, then=then, otherwise=otherwise):
            text = f"where({_text(test)}, {_text(then)}, {_text(otherwise)})"
        case Call(function=function, arguments=arguments):
            text = function.called(*map(_text, arguments))
        case Part(of=of, index=index):
            text = f"{_text(of)}[{index}]"
        case _:
            raise TypeError(one)
    return text if own >= binding else f"({text})"


def _number(value: float) -> str:
    if math.isfinite(value):
        return repr(float(value))
    return "math.nan" if math.isnan(value) else "math.inf" if value > 0.0 else "-math.inf"


def _variable(name: str) -> str:
    return f"{name}_" if name in _OWN or keyword.iskeyword(name) else name


def _wrapped(head: str, *values: Expression) -> list[str]:
    """A line, or several within parentheses, which Python lets it go on in."""
    text = ", ".join(map(_text, values))
    if len(head) + len(text) <= _WIDTH:
        return [f"{head}{text}".rstrip()]
    lines = textwrap.wrap(text, _WIDTH - 4, break_long_words=False, break_on_hyphens=False)
    return [f"{head}(", *(f"    {line}" for line in lines), ")"]


# --- the file ---------------------------------------------------------------------------------------------------------

_HEAD = '''\
"""{about}

One step of the actuator's monitor model, exported by emaviz; float64, a number or an array a joint.

    model = Model()                                # Model(torch) for tensors
    state = model.begin(user_position)             # (n,) joints side by side
    state = model.step(state, command)             # the whole actuator moves by STEP_S
    torque, friction = model.torque(state, command, position, speed, dt)   # a simulator moves the joint
"""

import math

import numpy

STEP_S = {step}  # s, the step that it was checked at
PARAMETERS = {{
{parameters}
}}
STATES = (
{states}
)
xp = numpy  # or torch, as the last `Model` was made with


class Parameters:
    """The numbers of PARAMETERS as attributes; each may be an array, one a joint."""

    def __init__(self, **changed):
        unknown = set(changed) - set(PARAMETERS)
        if unknown:
            raise ValueError(f"no parameter {{', '.join(sorted(unknown))}}; there are {{', '.join(PARAMETERS)}}")
        vars(self).update({{name: changed.get(name, value) for name, value in PARAMETERS.items()}})


class State:
    """The numbers of STATES as attributes, an array a joint."""

    def __init__(self, **values):
        vars(self).update(values)


def where(test, then, otherwise):
    """One of two, joint by joint."""
    if isinstance(test, bool):
        return then if test else otherwise
    if isinstance(then, float) and isinstance(otherwise, float):  # of which torch would make float32
        then = xp.asarray(then, dtype=xp.float64)
    return xp.where(test, then, otherwise)


def larger(a, b):
    """The larger of two."""
    return where(b > a, b, a)


def smaller(a, b):
    """The smaller of two."""
    return where(b < a, b, a)


def anywhere(test):
    """Whether something holds for any joint."""
    return test if isinstance(test, bool) else bool(xp.any(test))


'''
_MODEL = '''

class Model:
    """The actuator; `parameters` may be changed."""

    def __init__(self, arrays=numpy, **changed):
        """arrays: numpy or torch; changed: parameters by name."""
        global xp
        xp = arrays
        self.parameters = Parameters(**changed)

    def begin(self, user_position, motor_speed=0.0, play=0.0):
        """The state where the motor stands, as the user's position; its speed; the place in the play, 0 the middle."""
        p = self.parameters
        position = user_position if hasattr(user_position, "shape") else xp.asarray(user_position)
        angle = larger(position / p.gear_ratio, p.stop_low)
        angle = smaller(angle, p.stop_high)
        zero = 0.0 * angle
        s = State(**{{name: zero for name in STATES}})
        s.theta, s.omega, s.play = angle, zero + motor_speed, angle + play
        _turn(s, p)
        return self.sense(s)

    def sense(self, s):
        """What the sensors tell, anew, where attributes of the state were set by hand; the state."""
        p = self.parameters
        {sense}
        return s

    def step(self, s, command, load=0.0, supply=1.0, dt=STEP_S):
        """Moves the whole actuator by dt, s; the state, changed.

        command: {command}; load: {load}; supply: the bus voltage over its nominal value, 0 for a drive that is off.
        """
        p = self.parameters
        with numpy.errstate(all="ignore"):
            asked = {asked}
            driven = {is_driven}
            if driven:
                {advance_demand}
            {advance}
        return s

    def shown(self, s):
        """What the sensors show: {outputs}."""
        p = self.parameters  # noqa: F841
        return {{
{shown}
        }}
'''
_TORQUE = '''
    def torque(self, s, command, position, speed, dt, supply=1.0):
        """Of a joint that a simulator moves: the actuator's torque at the user without dry friction, and that friction.

        position, speed: of the joint, as the user's.  Give the simulator the second as the joint's dry friction
        (frictionloss), and the motor's inertia over gear_ratio² as its armature; it moves the joint, and stops it.
        """
        p = self.parameters
        gear = p.gear_ratio
        with numpy.errstate(all="ignore"):
            before, s.theta, s.omega = s.play, position / gear, speed / gear
            s.play = smaller(larger(before, s.theta - p.half_play), s.theta + p.half_play)
            _turn(s, p)
            {sense}
            asked = {asked}
            driven = {is_driven}
            if driven:
                {advance_demand}
            current, active, static, dynamic, dry, resisting = {part}
            s.current, s.time = current, s.time + dt
            bristles = resisting != dry
            load = still = 0.0 * s.omega
            {advance_states}
            return where(bristles, active - resisting, active) / gear, where(bristles, still, still + dynamic) / gear
'''
_TURN = '''

def _turn(s, p):
    """Sines and cosines of the rotor where it stands."""
    rotor = s.theta + p.rotor_offset
    s.sin_rotor, s.cos_rotor = xp.sin(rotor), xp.cos(rotor)
    s.sin_electrical, s.cos_electrical = xp.sin(2.0 * p.pole_pairs * rotor), xp.cos(2.0 * p.pole_pairs * rotor)
'''


def source(one: Exported) -> str:
    """NAME.py."""
    entries = one.program.entries
    functions = list(one.program.functions)
    torque = ""
    asked = "command / p.torque_constant" if one.takes_torque else "command"
    calls = {
        "asked": asked,
        "sense": entries["sense"].called(),
        "is_driven": entries["is_driven"].called(),
        "advance_demand": entries["advance_demand"].called("asked", "supply", "dt"),
        "advance": entries["advance"].called("asked", "load", "supply", "driven", "dt"),
    }
    if "torsional_compliance" not in one.actuator.effects and "half_play" in {it.name for it in one.parameters}:
        part = shown_part(entries["advance"], "resisting", _OF_TORQUE)
        functions.append(part)
        states = next((it for it in functions if it.name == "advance_states"), None)
        torque = _TORQUE.format(
            part=part.called("asked", "0.0", "supply", "driven", "dt"),
            advance_states="pass"
            if states is None
            else states.called(
                "dt", "s.theta", "s.omega", "gear * before", "gear * s.play", "gear * (s.play - before)",
                "gear", "load", "active", "static", "dynamic",
            ),
            **calls,
        )  # fmt: skip
    readings = (*(entries[f"shown_{name}"].called() for name in ("current", "speed", "angle")), "s.told")
    shown = "\n".join(f'            "{out.name}": {text},  # {out.unit}' for out, text in zip(one.outputs, readings))
    about = "\n".join([f"{one.given.name}: {one.given.description}".rstrip(": "), *one.notes])
    return (
        _HEAD.format(
            about=quoted(about, 2000).replace("␊", "\n").replace("\\", "/").replace('"""', "'''"),
            step=_number(one.step_s),
            parameters="\n".join(f'    "{it.name}": {_number(it.value)},  # {_of(it)}' for it in one.parameters),
            states="\n".join(f'    "{it.name}",  # {_of(it)}' for it in one.states),
        )
        + "\n\n".join(map(_function, functions))
        + _TURN
        + _MODEL.format(
            command=_of(one.command),
            load=_of(one.load),
            outputs=", ".join(it.name for it in one.outputs),
            shown=shown,
            **calls,
        )
        + torque
    )


def _of(one: Field) -> str:
    """Its meaning and unit, as a part of a line's comment or of a docstring."""
    return quoted(f"{one.meaning}, {one.unit}" if one.unit else one.meaning).replace('"""', "'''").replace("\\", "/")


# --- run --------------------------------------------------------------------------------------------------------------


class ImportedPython:
    """The exported file, imported from a folder, as a replay takes it."""

    def __init__(self, one: Exported, folder: Path) -> None:
        spec = importlib.util.spec_from_file_location(f"emaviz_export_{one.name}", folder / f"{one.name}.py")
        assert spec is not None and spec.loader is not None
        self.module: Any = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(self.module)
        self._one = one

    def replay(self, state: Array, parameters: Array, run: tuple[Array, ...], period: int, step_s: float) -> Array:
        """As `c.CompiledC.replay`."""
        names = (field.name for field in self._one.parameters)
        model = self.module.Model(**dict(zip(names, parameters.tolist())))
        at = self.module.State(**{field.name: np.array([x]) for field, x in zip(self._one.states, state)})
        model.sense(at)
        shown = np.empty((len(run[0]) // period, 4))
        outputs = [out.name for out in self._one.outputs]
        for sample in range(len(shown)):
            total = 0.0
            for i in range(sample * period, (sample + 1) * period):
                at = model.step(at, run[0][i], run[1][i], run[2][i], step_s)
                reading = model.shown(at)
                total = total + reading[outputs[0]]
            # of a number, or of an array of one
            shown[sample] = [np.asarray(one).item() for one in (total / period, *map(reading.get, outputs[1:]))]
        return shown
