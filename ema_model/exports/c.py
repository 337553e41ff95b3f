"""The exported model as C: one header, one source, float64, no allocation, C99."""

from __future__ import annotations

import ctypes
import math
import os
import shutil
import subprocess
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.child_processes import start_program
from ema_model.errors import InputError, quoted
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
)

Array = NDArray[np.float64]

FLAGS = ("-std=c99", "-Wall", "-Werror", "-ffp-contract=off", "-O2")
_WORDS = set(  # that no variable can be called
    "auto break case char const continue default do double else enum extern float for goto if inline int long register "
    "restrict return short signed sizeof static struct switch typedef union unsigned void volatile while main abs fabs "
    "floor sqrt pow sin cos tan tanh exp log time clock signal div remainder gamma j0 j1 y0 y1 s p".split()
)
_WIDTH = 110
SHOWN = ("current", "motor_speed", "motor_position", "user_position")

# --- expressions and functions ----------------------------------------------------------------------------------------

_BINDING = {"or": 1, "and": 2, "==": 3, "!=": 3, "<": 4, "<=": 4, ">": 4, ">=": 4, "+": 5, "-": 5, "*": 6, "/": 6}
_SPELT = {"or": "||", "and": "&&"}
_HIGHEST = 9

_HELPERS = {  # written where they are called, since an unused function is an error under -Werror
    "larger": "static double larger(double a, double b)\n{\n    return b > a ? b : a;\n}\n",
    "smaller": "static double smaller(double a, double b)\n{\n    return b < a ? b : a;\n}\n",
}


class _Writer:
    """Writes functions of a program; prefix: of their names."""

    def __init__(self, prefix: str) -> None:
        self.prefix = prefix
        self.sizes: set[int] = set()  # of the values that functions return together
        self.helpers: set[str] = set()  # of _HELPERS, that are called

    def function(self, one: Function, name: str = "", linkage: str = "static ") -> str:
        """A whole function, with what it says above it."""
        taken = []
        if "s" in one.own:
            taken.append(f"{'' if one.writes else 'const '}{self.prefix}_state *s")
        if "p" in one.own:
            taken.append(f"const {self.prefix}_parameters *p")
        taken += [f"{'int' if it in one.flags else 'double'} {_variable(it)}" for it in one.parameters]
        head = f"{linkage}{self.kind(one)} {name or one.name}({', '.join(taken) or 'void'})"
        lines = [f"/* {one.says.replace('*/', '* /')} */"] if one.says else []
        lines += textwrap.wrap(head, _WIDTH, subsequent_indent="    ", break_long_words=False)
        return "\n".join([*lines, "{", *self.body(one), "}", ""])

    def kind(self, one: Function) -> str:
        """What it returns."""
        if one.returns > 1:
            self.sizes.add(one.returns)
            return f"values{one.returns}"
        return "void" if one.returns == 0 else "int" if one.returns_flag else "double"

    def body(self, one: Function) -> list[str]:
        """The statements' lines."""
        counts: dict[str, int] = {}
        for statement in one.body:
            for place in statement.targets if isinstance(statement, Assign) else ():
                if isinstance(place, Name):
                    counts[place.name] = counts.get(place.name, 0) + 1
        self.declared, self.counts, self.flags = set(one.parameters), counts, one.flags
        self.number = 0
        return [f"    {line}" for statement in one.body for line in self.statement(statement)]

    def statement(self, one: Statement) -> list[str]:
        """The lines of one."""
        match one:
            case Assign(targets=(), value=value):
                return [f"{self.text(value)};"]
            case Assign(targets=(place,), value=value):
                return _wrapped(f"{self.place(place)} = {self.text(value)};")
            case Assign(targets=targets, value=Call() as value):
                size, self.number = len(targets), self.number + 1
                self.sizes.add(size)
                whole = f"r{self.number}"
                lines = _wrapped(f"const values{size} {whole} = {self.text(value)};")
                return [*lines, *(f"{self.place(place)} = {whole}.v[{i}];" for i, place in enumerate(targets))]
            case If(test=test, body=body):
                inner = [f"    {line}" for statement in body for line in self.statement(statement)]
                return [f"if ({self.text(test)}) {{", *inner, "}"]
            case Return(values=()):
                return ["return;"]
            case Return(values=(value,)):
                return _wrapped(f"return {self.text(value)};")
            case Return(values=values):
                self.sizes.add(len(values))
                inner = ", ".join(map(self.text, values))
                return [*_wrapped(f"const values{len(values)} r = {{{{{inner}}}}};"), "return r;"]
        raise TypeError(one)

    def place(self, one: Name | Row) -> str:
        """A target, declared where it is met first."""
        if isinstance(one, Row):
            return f"s->{one.name}"
        name = _variable(one.name)
        if one.name in self.declared:
            return name
        self.declared.add(one.name)
        kind = "int" if one.name in self.flags else "double"
        return f"{'const ' if self.counts.get(one.name) == 1 else ''}{kind} {name}"

    def text(self, one: Expression, binding: int = 0) -> str:
        """An expression; in parentheses where what is around it binds more."""
        match one:
            case Number(value=value):
                text, own = _number(value), _HIGHEST if value >= 0.0 else 7
            case Flag(value=value):
                text, own = str(int(value)), _HIGHEST
            case Name(name=name):
                text, own = _variable(name), _HIGHEST
            case Row(of=of, name=name):
                text, own = f"{of}->{name}", _HIGHEST
            case Operation(operator="neg", operands=(operand,)):
                text, own = f"-{self.text(operand, 8)}", 7
            case Operation(operator="not", operands=(operand,)):
                text, own = f"!{self.text(operand, 8)}", 7
            case Operation(operator="max", operands=(left, right)):
                self.helpers.add("larger")
                text, own = f"larger({self.text(left)}, {self.text(right)})", _HIGHEST
            case Operation(operator="min", operands=(left, right)):
                self.helpers.add("smaller")
                text, own = f"smaller({self.text(left)}, {self.text(right)})", _HIGHEST
            case Operation(operator="abs", operands=(operand,)):
                text, own = f"fabs({self.text(operand)})", _HIGHEST
            case Operation(operator=operator, operands=operands) if operator in _BINDING:
                own = _BINDING[operator]
                # Sums and products keep the order in which Python takes them; compilers ask for parentheses in logic.
                first, others = (3, 3) if operator in _SPELT else (own, own + 1)
                parts = [self.text(operands[0], first), *(self.text(inner, others) for inner in operands[1:])]
                text = f" {_SPELT.get(operator, operator)} ".join(parts)
            case Operation(operator=operator, operands=operands):
                text, own = f"{operator}({', '.join(map(self.text, operands))})", _HIGHEST
            case Choice(test=test, then=then, otherwise=otherwise):
                text, own = f"{self.text(test, 1)} ? {self.text(then, 1)} : {self.text(otherwise, 1)}", 0
            case Call(function=function, arguments=arguments):
                text, own = function.called(*map(self.text, arguments)), _HIGHEST
            case Part(of=of, index=index):
                text, own = f"{self.text(of)}.v[{index}]", _HIGHEST
            case _:
                raise TypeError(one)
        return text if own >= binding else f"({text})"


def _number(value: float) -> str:
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    return repr(float(value))


def _variable(name: str) -> str:
    return f"{name}_" if name in _WORDS or (name.startswith("r") and name[1:].isdigit()) else name


def _wrapped(line: str) -> list[str]:
    return textwrap.wrap(line, _WIDTH, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False)


# --- header and source ------------------------------------------------------------------------------------------------


def header(one: Exported) -> str:
    """NAME.h."""
    n, guard = one.name, f"{one.name.upper()}_H"
    about = [f"{_plain(one.given.name)}: {_plain(one.given.description)}".rstrip(": "), *one.notes]
    shown = "\n".join(
        f"double {n}_{name}(const {n}_state *s, const {n}_parameters *p); /* {_of(out)} */"
        for name, out in zip(SHOWN, one.outputs)
    )
    return f"""\
/* {_comment(about)}

   One step of the actuator's monitor model, exported by emaviz.  No allocation, no global state.

       {n}_parameters p = {n}_defaults;
       {n}_state s;
       {n}_init(&s, &p, 0.0, 0.0, 0.0);
       for (;;) {n}_step(&s, &p, command, load, 1.0, {n.upper()}_STEP_S);
*/
#ifndef {guard}
#define {guard}

#ifdef __cplusplus
extern "C" {{
#endif

#define {n.upper()}_STEP_S {_number(one.step_s)} /* s, the step that it was checked at */

typedef struct {{
{_struct(one.parameters)}
}} {n}_parameters;

typedef struct {{
{_struct(one.states)}
}} {n}_state;

extern const {n}_parameters {n}_defaults;

/* At rest or in motion: where the motor stands, as the user's position; speed; place in the play, 0 the middle. */
void {n}_init({n}_state *s, const {n}_parameters *p, double user_position, double motor_speed, double play);

/* What the sensors tell, anew, where fields of the state were set by hand. */
void {n}_sense({n}_state *s, const {n}_parameters *p);

/* One step of dt, s.
   command: {_of(one.command)}; load: {_of(one.load)};
   supply: the bus voltage over its nominal value, 0 for a drive that is switched off. */
void {n}_step({n}_state *s, const {n}_parameters *p, double command, double load, double supply, double dt);

/* What the sensors show. */
{shown}

#ifdef __cplusplus
}}
#endif

#endif
"""


def source(one: Exported) -> str:
    """NAME.c."""
    n, entries = one.name, one.program.entries
    writer = _Writer(n)
    body = "\n".join(writer.function(it) for it in one.program.functions)
    helpers = "".join(f"{text}\n" for name, text in _HELPERS.items() if name in writer.helpers)
    tuples = "\n".join(f"typedef struct {{ double v[{size}]; }} values{size};" for size in sorted(writer.sizes))
    defaults = "\n".join(f"    {_number(it.value)}, /* {it.name} */" for it in one.parameters)
    command = "command / p->torque_constant" if one.takes_torque else "command"
    readings = (*(entries[f"shown_{name}"].called() for name in ("current", "speed", "angle")), "s->told")
    shown = "\n".join(
        f"double {n}_{name}(const {n}_state *s, const {n}_parameters *p)\n{{\n    return {text};\n}}\n"
        for name, text in zip(SHOWN, readings)
    )
    return f"""\
/* {_plain(one.given.name)}: exported by emaviz; see {n}.h.  Compile without fused sums (-ffp-contract=off), so that
   every machine gives the same numbers. */
#include "{n}.h"

#include <math.h>

{tuples}

const {n}_parameters {n}_defaults = {{
{defaults}
}};

{helpers}{body}
void {n}_init({n}_state *s, const {n}_parameters *p, double user_position, double motor_speed, double play)
{{
    static const {n}_state zero;
    const double free_angle = user_position / p->gear_ratio;
    const double raised = free_angle < p->stop_low ? p->stop_low : free_angle;
    const double angle = raised > p->stop_high ? p->stop_high : raised;
    const double rotor = angle + p->rotor_offset;
    *s = zero;
    s->theta = angle;
    s->omega = motor_speed;
    s->play = angle + play;
    s->sin_rotor = sin(rotor);
    s->cos_rotor = cos(rotor);
    s->sin_electrical = sin(2.0 * p->pole_pairs * rotor);
    s->cos_electrical = cos(2.0 * p->pole_pairs * rotor);
    {n}_sense(s, p);
}}

void {n}_sense({n}_state *s, const {n}_parameters *p)
{{
    {entries["sense"].called()};
}}

void {n}_step({n}_state *s, const {n}_parameters *p, double command, double load, double supply, double dt)
{{
    const double asked = {command};
    const int driven = {entries["is_driven"].called()};
    if (driven)
        {entries["advance_demand"].called("asked", "supply", "dt")};
    {entries["advance"].called("asked", "load", "supply", "driven", "dt")};
}}

{shown}"""


def _struct(fields: Sequence[Field]) -> str:
    return "\n".join(f"    double {one.name}; /* {_of(one)} */" for one in fields)


def _of(one: Field) -> str:
    return _plain(f"{one.meaning}, {one.unit}" if one.unit else one.meaning)


def _comment(lines: Sequence[str]) -> str:
    return "\n   ".join(_plain(line) for line in lines)


def _plain(text: str) -> str:
    """What a file's author wrote, as a part of a comment."""
    return quoted(text).replace("*/", "* /").replace("/*", "/ *").replace("\\", "/").replace("??", "? ?")


# --- compiled and run -------------------------------------------------------------------------------------------------

_COMPILING_S = 120.0
_REPLAY = """\
#include "{n}.h"

void replay({n}_state *s, const {n}_parameters *p, const double *command, const double *load, const double *supply,
            long samples, long period, double dt, double *shown)
{{
    {n}_sense(s, p);
    for (long sample = 0; sample < samples; sample++) {{
        double sum = 0.0;
        for (long i = sample * period; i < (sample + 1) * period; i++) {{
            {n}_step(s, p, command[i], load[i], supply[i], dt);
            sum += {n}_current(s, p);
        }}
        shown[4 * sample] = sum / (double)period;
        shown[4 * sample + 1] = {n}_motor_speed(s, p);
        shown[4 * sample + 2] = {n}_motor_position(s, p);
        shown[4 * sample + 3] = {n}_user_position(s, p);
    }}
}}

void begin({n}_state *s, const {n}_parameters *p, double user_position, double motor_speed, double play)
{{
    {n}_init(s, p, user_position, motor_speed, play);
}}
"""


def compiler() -> str:
    """The whole path of the C compiler; InputError where there is none."""
    for name in filter(None, (os.environ.get("CC"), "cc", "gcc", "clang")):
        if (found := shutil.which(name)) is not None:
            return found
    raise InputError("no C compiler found, and an export is compiled to be checked; install gcc, or name one in CC")


def compile_library(sources: Sequence[Path], library: Path, flags: Sequence[str] = FLAGS) -> None:
    """Compiles C into a shared library; InputError with the compiler's first complaint."""
    command = [compiler(), *flags, "-shared", "-fPIC", "-o", str(library), *map(str, sources), "-lm"]
    done = start_program(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        told, _ = done.communicate(timeout=_COMPILING_S)
    except subprocess.TimeoutExpired:
        done.kill()
        raise InputError(f"{command[0]}: did not end within {_COMPILING_S:g} s") from None
    if done.returncode != 0:
        lines = [line for line in told.splitlines() if "error" in line] or told.splitlines() or ["no message"]
        raise InputError(f"{command[0]} refuses {sources[0].name}: {quoted(lines[0], 200)}")


class CompiledC:
    """The exported C, compiled in a folder, as a replay takes it."""

    def __init__(self, one: Exported, folder: Path) -> None:
        """folder: with NAME.c and NAME.h; the replay and the library are put into it."""
        replay, library = folder / "replay.c", folder / "replay.so"
        replay.write_text(_REPLAY.format(n=one.name), encoding="utf-8")
        compile_library([folder / f"{one.name}.c", replay], library)
        self._library: Any = ctypes.CDLL(str(library))
        array = np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS")
        number, count = ctypes.c_double, ctypes.c_long
        self._library.replay.argtypes = [array] * 5 + [count, count, number, array]
        self._library.begin.argtypes = [array, array, number, number, number]
        self._states = len(one.states)

    def replay(self, state: Array, parameters: Array, run: tuple[Array, ...], period: int, step_s: float) -> Array:
        """The four signals of each sample of `period` steps, (samples, 4); state is left as it is at the end.

        run: what is put in, load and supply at each step.
        """
        shown = np.empty((len(run[0]) // period, 4))
        inputs = (np.ascontiguousarray(one, dtype=float) for one in run)
        self._library.replay(state, parameters, *inputs, len(shown), period, step_s, shown)
        return shown

    def begin(self, parameters: Array, user: float, speed: float = 0.0, play: float = 0.0) -> Array:
        """The state that `init` makes."""
        state = np.empty(self._states)
        self._library.begin(state, parameters, user, speed, play)
        return state
