"""The Monitor Model's step as a program: the kernels' own functions, read as syntax trees and made plain.

What C and Python are written from is what the kernels inline: `ema_model.kernels.monitor_step` with a stack's
composition, the physics, and the functions of each effect's file.  Their subset of Python is small: arithmetic,
comparisons, choices, tuples, rows of parameters and states, calls of each other.  What is none of that is refused with
its file and line, and not guessed.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import math
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ema_model.errors import InputError
from ema_model.physics.rows import LANES, STATE_ROWS
from ema_model.stacks import Stack

# --- the program as data ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Number:
    """A constant."""

    value: float


@dataclass(frozen=True)
class Flag:
    """A constant that is true or false."""

    value: bool


@dataclass(frozen=True)
class Name:
    """A variable of a function."""

    name: str


@dataclass(frozen=True)
class Row:
    """A field of the state or of the parameters."""

    of: str  # "s" or "p"
    name: str


@dataclass(frozen=True)
class Operation:
    """operator: + − * / and the comparisons, "and", "or", "not", "neg", "abs", "max", "min", "pow",
    and what C's library and numpy call by one name, as "sqrt"."""

    operator: str
    operands: tuple[Expression, ...]


@dataclass(frozen=True)
class Choice:
    """One of two values."""

    test: Expression
    then: Expression
    otherwise: Expression


@dataclass(frozen=True)
class Call:
    """A call of a function of the program; state and parameters are handed on as it needs them."""

    function: Function
    arguments: tuple[Expression, ...]


@dataclass(frozen=True)
class Part:
    """One of the values that a call returns."""

    of: Expression
    index: int


Expression = Number | Flag | Name | Row | Operation | Choice | Call | Part


@dataclass(frozen=True)
class Assign:
    """Targets that take the values of an expression, as many as it has; none for a call for its effect alone."""

    targets: tuple[Name | Row, ...]
    value: Expression


@dataclass(frozen=True)
class If:
    """What is done where something holds."""

    test: Expression
    body: tuple[Statement, ...]


@dataclass(frozen=True)
class Return:
    """The values of a function."""

    values: tuple[Expression, ...]


Statement = Assign | If | Return


@dataclass(eq=False)
class Function:
    """A function of the program; variables are numbers unless they are among `flags`."""

    name: str
    says: str  # the first line of its docstring
    parameters: tuple[str, ...] = ()
    body: tuple[Statement, ...] = ()
    returns: int = 0  # how many values
    returns_flag: bool = False
    flags: frozenset[str] = frozenset()
    reads: frozenset[str] = frozenset()  # "s" and "p", where it takes them
    writes: bool = False  # whether it changes the state

    @property
    def own(self) -> tuple[str, ...]:
        """ "s" and "p", those that it takes, in this order."""
        return tuple(one for one in ("s", "p") if one in self.reads)

    def called(self, *arguments: str) -> str:
        """A call of it, as C and Python spell it alike."""
        return f"{self.name}({', '.join([*self.own, *arguments])})"


@dataclass(frozen=True, eq=False)
class Program:
    """The step of one stack."""

    functions: tuple[Function, ...]  # each behind those that it calls
    entries: dict[str, Function]  # by the kernel's name
    states: tuple[str, ...]  # rows of the state, all of them
    parameters: tuple[str, ...]  # rows of the parameters that the program reads, in their order
    rows: tuple[str, ...]  # the same of all, as kernels have them


ENTRIES = {  # the arguments besides state, parameters and lane
    "is_driven": (),
    "sense": (),
    "advance_demand": ("command", "supply", "dt"),
    "advance": ("command", "load", "supply", "driven", "dt"),
    "shown_current": (),
    "shown_speed": (),
    "shown_angle": (),
}


def program_of(stack: Stack) -> Program:
    """The program of a stack's Monitor Model; InputError for an effect with a line that has no form in it."""
    reader = _Reader(stack)
    entries = {name: reader.entry(getattr(stack.monitor, name)) for name in ENTRIES}
    reached = _reached(entries.values())  # some have turned out to be nothing but a constant
    functions = tuple(one for one in reader.functions if one in reached)
    needed = {"gear_ratio", "pole_pairs", "stop_low", "stop_high"}  # to begin with
    used = needed | {one.name for function in functions for one in _rows(function.body) if one.of == "p"}
    return Program(
        functions,
        entries,
        tuple(map(field_name, (*STATE_ROWS, *stack.states))),
        tuple(name for name in map(field_name, stack.parameter_rows) if name in used),
        tuple(map(field_name, stack.parameter_rows)),
    )


def field_name(row: str) -> str:
    """A row of parameters or states as a field's name: "cogging_torque.order" → "cogging_torque_order"."""
    return row.replace(".", "_")


def shown_part(function: Function, last: str, values: Sequence[str]) -> Function:
    """A function up to where it finds `last`, with the values found by then: a part of the step, for simulators."""
    at = next(i for i, one in enumerate(function.body) if isinstance(one, Assign) and Name(last) in one.targets)
    body = (*function.body[: at + 1], Return(tuple(map(Name, values))))
    return Function(
        f"{function.name}_to_{last}",
        f"What `{function.name}` finds on its way: {', '.join(values)}.",
        function.parameters,
        _alive(body),
        len(values),
        flags=function.flags,
        reads=function.reads,
    )


# --- from syntax trees ------------------------------------------------------------------------------------------------

_COMPARISONS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
_ARITHMETIC = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_BOTH = {ast.BitAnd: "and", ast.BitOr: "or"}
_OF_FLAGS = {*_COMPARISONS.values(), "and", "or", "not"}
_CALLED: dict[Any, str] = {abs: "abs", max: "max", min: "min", math.pow: "pow", math.fabs: "abs", np.abs: "abs"}
for _name in ("sqrt", "floor", "sin", "cos", "tan", "exp", "log", "tanh"):  # called so in C, numpy and torch alike
    _CALLED |= {getattr(math, _name): _name, getattr(np, _name): _name}
_LANE, _STATE, _PARAMETERS = "i", "s", "p"
_MOST_FACTORS = 64  # of a whole power


@dataclass(frozen=True)
class _Tuple:
    """Values that stand together while the tree is read."""

    values: tuple[Any, ...]


@dataclass
class _Reader:
    """Reads functions, each once for the kinds of its arguments."""

    stack: Stack
    functions: list[Function] = field(default_factory=list)
    known: dict[tuple[Any, ...], Function] = field(default_factory=dict)
    reading: list[Any] = field(default_factory=list)

    def entry(self, function: Any) -> Function:
        """A kernel's function, of the arguments that `ENTRIES` says."""
        names = inspect.signature(_plain(function)).parameters
        kinds = tuple("flag" if name == "driven" else name if name in ("s", "p", "i") else "number" for name in names)
        return self.function(function, kinds)

    def function(self, function: Any, kinds: tuple[Any, ...]) -> Function:
        """The function for arguments of these kinds: "number", "flag", "s", "p", "i", whole numbers, tuples' sizes."""
        key = (_plain(function), kinds)
        if key not in self.known:
            if key[0] in self.reading:
                raise InputError(f"{_where(key[0])}: calls itself, which an export has no form for")
            self.reading.append(key[0])
            self.known[key] = made = _OfFunction(self, key[0], kinds).read()
            self.reading.pop()
            self.functions.append(made)
        return self.known[key]

    def name_for(self, function: Any) -> str:
        """A name that tells the file, where the function's own does not: 'cogging_torque_shaft_torque'."""
        module = function.__module__.rpartition(".")[2]
        own = function.__name__.lstrip("_")
        base = f"{module}_{own}" if function.__module__.startswith("ema_model.effects.") else own
        if function.__module__.startswith(("ema_model_user", "ema_model_torque")):
            base = f"{module.removeprefix('ema_model_')}_{own}"
        taken = {one.name for one in self.functions}
        names = (base if number == 1 else f"{base}_{number}" for number in range(1, len(taken) + 2))
        return next(name for name in names if name not in taken)


@dataclass
class _OfFunction:
    """Reads one function."""

    reader: _Reader
    function: Any
    kinds: tuple[Any, ...]
    names: dict[str, Any] = field(default_factory=dict)  # variables in scope: expressions, or what stands for a kind
    flags: set[str] = field(default_factory=set)
    taken: set[str] = field(default_factory=set)
    writes: bool = False
    returns: list[tuple[Expression, ...]] = field(default_factory=list)

    def read(self) -> Function:
        """The function as a part of the program."""
        tree = _tree(self.function)
        parameters: list[str] = []
        given = [one.arg for one in tree.args.args]
        for name, kind in zip(given, self.kinds, strict=True):
            if kind in (_STATE, _PARAMETERS, _LANE) or isinstance(kind, int):
                self.names[name] = kind
            elif isinstance(kind, tuple):
                parts = [f"{name}_{number}" for number in range(kind[1])]
                parameters += parts
                self.names[name] = _Tuple(tuple(map(Name, parts)))
            else:
                parameters.append(name)
                self.names[name] = Name(name)
                if kind == "flag":
                    self.flags.add(name)
        self.taken = {*given, *parameters}
        body = _alive(tuple(self.block(tree.body, outermost=True)))
        counts = {len(values) for values in self.returns}
        if len(counts) > 1:
            raise self.wrong(tree, "returns now so many values, now others")
        flag = bool(self.returns) and all(len(one) == 1 and self.is_flag(one[0]) for one in self.returns)
        own = {one.of for one in _rows(body)} | {of for call in _calls(body) for of in call.function.reads}
        return Function(
            self.reader.name_for(self.function),
            (ast.get_docstring(tree) or "").partition("\n")[0],
            tuple(parameters),
            body,
            counts.pop() if counts else 0,
            flag,
            frozenset(self.flags),
            frozenset(own),
            self.writes,
        )

    # statements

    def block(self, nodes: Sequence[ast.stmt], *, outermost: bool = False) -> Iterator[Statement]:
        """The statements of a body."""
        for node in nodes:
            match node:
                case ast.Expr(value=ast.Constant()) | ast.Pass():
                    continue
                case ast.Expr(value=ast.Call()):
                    value = self.expression(node.value)
                    if isinstance(value, Call) and value.function.writes:
                        yield Assign((), value)
                case ast.Assign(targets=[target], value=value):
                    yield from self.assign(node, target, self.expression(value), outermost)
                case ast.AugAssign(target=ast.Name() as target, op=op, value=value):
                    whole = ast.copy_location(ast.BinOp(ast.Name(target.id, ast.Load()), op, value), node)
                    yield from self.assign(node, target, self.expression(ast.fix_missing_locations(whole)), outermost)
                case ast.Return(value=value):
                    found = self.expression(value) if value is not None else _Tuple(())
                    values = found.values if isinstance(found, _Tuple) else (found,)
                    if isinstance(found, Call) and found.function.returns > 1:  # which is called once
                        values = tuple(self.fresh(f"value_{number}") for number in range(found.function.returns))
                        yield Assign(values, found)
                    self.returns.append(values)
                    yield Return(values)
                case ast.If(test=test, body=body, orelse=[]):
                    condition = self.truth(test)
                    yield If(condition, tuple(self.block(body)))
                case ast.For(target=ast.Name(id=name), iter=ast.Call(func=ast.Name(id="range"), args=[count])):
                    if self.whole(count) != LANES:
                        raise self.wrong(node, "a loop has no form in it but the one over lanes")
                    self.names[name] = _LANE  # of which an export has one
                    yield from self.block(node.body, outermost=outermost)
                case _:
                    raise self.wrong(node, "has no form in it")

    def assign(self, node: ast.stmt, target: ast.expr, value: Any, outermost: bool) -> Iterator[Statement]:
        """A statement that gives names, or rows of the state, their values."""
        places = target.elts if isinstance(target, ast.Tuple) else [target]
        if isinstance(value, _Tuple):
            if len(value.values) != len(places):
                raise self.wrong(node, "has other names than values")
            for place, one in zip(places, value.values):
                yield Assign((self.place(place, one, outermost),), one)
            return
        count = value.function.returns if isinstance(value, Call) else 1
        if count != len(places):
            raise self.wrong(node, "has other names than values")
        yield Assign(tuple(self.place(place, value, outermost) for place in places), value)

    def place(self, target: ast.expr, value: Expression, outermost: bool) -> Name | Row:
        """What takes a value: a row of the state, or a name, a new one where the old one is of another kind."""
        if isinstance(target, ast.Subscript):
            row = self.subscript(target)
            if not isinstance(row, Row) or row.of != _STATE:
                raise self.wrong(target, "only a state can be changed")
            self.writes = True
            return row
        if not isinstance(target, ast.Name):
            raise self.wrong(target, "has no form in it")
        is_flag = self.is_flag(value)
        before = self.names.get(target.id)
        if isinstance(before, Name) and (before.name in self.flags) == is_flag:
            return before
        if before is not None and not outermost:
            raise self.wrong(target, "a name must not change its kind here")
        self.names[target.id] = name = self.fresh(target.id)
        if is_flag:
            self.flags.add(name.name)
        return name

    def fresh(self, name: str) -> Name:
        """A variable of this name, or of one like it that is not taken."""
        while name in self.taken:
            name += "_"
        self.taken.add(name)
        return Name(name)

    # expressions

    def expression(self, node: ast.expr) -> Any:
        """The expression of a node; a `_Tuple` of several."""
        match node:
            case ast.Constant(value=bool() as value):
                return Flag(value)
            case ast.Constant(value=int() | float() as value):
                return Number(float(value))
            case ast.Name() | ast.Attribute():
                return self.named(node)
            case ast.Tuple(elts=parts):
                return _Tuple(tuple(self.expression(one) for one in parts))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                inner = self.expression(operand)
                return Number(-inner.value) if isinstance(inner, Number) else Operation("neg", (inner,))
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return Operation("not", (self.truth(operand),))
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                return self.power(node, self.expression(left), self.whole(right))
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _ARITHMETIC:
                return Operation(_ARITHMETIC[type(op)], (self.number(left), self.number(right)))
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _BOTH:
                return Operation(_BOTH[type(op)], (self.truth(left), self.truth(right)))
            case ast.BoolOp(op=op, values=values):
                return self.joined("and" if isinstance(op, ast.And) else "or", [self.truth(one) for one in values])
            case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _COMPARISONS:
                return Operation(_COMPARISONS[type(op)], (self.expression(left), self.expression(right)))
            case ast.IfExp(test=test, body=body, orelse=otherwise):
                return Choice(self.truth(test), self.expression(body), self.expression(otherwise))
            case ast.Subscript():
                return self.subscript(node)
            case ast.Call(keywords=[]):
                return self.call(node)
        raise self.wrong(node, "has no form in it")

    def number(self, node: ast.expr) -> Any:
        """An expression that is a number."""
        found = self.expression(node)
        if isinstance(found, _Tuple) or self.is_flag(found):
            raise self.wrong(node, "must be a number")
        return found

    def truth(self, node: ast.expr) -> Any:
        """An expression that is true or false."""
        found = self.expression(node)
        if not self.is_flag(found):
            raise self.wrong(node, "must be a comparison")
        return found

    def joined(self, operator: str, parts: list[Any]) -> Any:
        """Conditions without those that decide nothing."""
        open_ = [one for one in parts if not (isinstance(one, Flag) and one.value == (operator == "and"))]
        if not open_:
            return Flag(operator == "and")
        return open_[0] if len(open_) == 1 else Operation(operator, tuple(open_))

    def named(self, node: ast.Name | ast.Attribute) -> Any:
        """A variable, or a constant of the module."""
        if isinstance(node, ast.Name) and node.id in self.names:
            found = self.names[node.id]
            if not isinstance(found, Name | _Tuple):
                raise self.wrong(node, "has no form in it")
            return found
        value = self.value(node)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.wrong(node, "has no form in it")
        return Number(float(value))

    def value(self, node: ast.expr) -> Any:
        """What a name of the module, or of one that it imports, stands for."""
        match node:
            case ast.Name(id=name):
                places = (self.function.__globals__, vars(builtins))
                for place in places:
                    if name in place:
                        return place[name]
            case ast.Attribute(value=of, attr=name):
                module = self.value(of)
                if isinstance(module, ModuleType) and hasattr(module, name):
                    return getattr(module, name)
        raise self.wrong(node, "is not known")

    def whole(self, node: ast.expr) -> int:
        """A whole number that is known while the tree is read."""
        match node:
            case ast.Constant(value=int() as value) if not isinstance(value, bool):
                return value
            case ast.Name(id=name) if name in self.names:
                found = self.names[name]
                if found == _LANE:
                    return 0
                if isinstance(found, int):
                    return found
            case ast.Name():
                found = self.value(node)
                if isinstance(found, int):
                    return found
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return -self.whole(operand)
            case ast.BinOp(left=left, op=ast.Add(), right=right):
                return self.whole(left) + self.whole(right)
            case ast.BinOp(left=left, op=ast.Mult(), right=right):
                return self.whole(left) * self.whole(right)
        raise self.wrong(node, "must be a whole number that is known beforehand")

    def subscript(self, node: ast.Subscript) -> Any:
        """A row of the state or of the parameters, or one of several values."""
        if isinstance(node.value, ast.Name) and self.names.get(node.value.id) in (_STATE, _PARAMETERS):
            of = self.names[node.value.id]
            names = self.reader.stack.parameter_rows
            if of == _STATE:
                names = (*STATE_ROWS, *self.reader.stack.states)
            return Row(of, field_name(names[self.whole(node.slice) // LANES]))
        found = self.expression(node.value)
        index = self.whole(node.slice)
        if isinstance(found, _Tuple):
            return found.values[index]
        if isinstance(found, Call) and 0 <= index < found.function.returns:
            return Part(found, index)
        raise self.wrong(node, "has no form in it")

    def power(self, node: ast.expr, base: Expression, exponent: int) -> Expression:
        """A whole power as numba takes it: by squares, multiplied from the lowest on."""
        if not isinstance(base, Name | Number | Row):
            raise self.wrong(node, "a power must be of a name")
        if not 0 <= exponent <= _MOST_FACTORS:
            raise self.wrong(node, f"a power must be from 0 to {_MOST_FACTORS}")
        result: Expression = Number(1.0)
        square: Expression = base
        while exponent:
            if exponent & 1:
                result = square if result == Number(1.0) else Operation("*", (result, square))
            exponent >>= 1
            if exponent:
                square = Operation("*", (square, square))
        return result

    def call(self, node: ast.Call) -> Any:
        """A call: of an elementary function, or of a function that is read as well."""
        called = self.value(node.func)
        if (elementary := _CALLED.get(called) if called.__hash__ else None) is not None:
            return Operation(elementary, tuple(self.number(one) for one in node.args))
        arguments: list[Expression] = []
        kinds: list[Any] = []
        for one in node.args:
            special = self.names.get(one.id) if isinstance(one, ast.Name) else None
            if isinstance(one, ast.Name) and special is None and isinstance(self._constant(one), int):
                special = self._constant(one)  # the row from which effects have their states
            if special in (_STATE, _PARAMETERS, _LANE) or isinstance(special, int):
                kinds.append(special)
                continue
            found = self.expression(one)
            if isinstance(found, _Tuple):
                arguments += found.values
                kinds.append(("tuple", len(found.values)))
            else:
                arguments.append(found)
                kinds.append("flag" if self.is_flag(found) else "number")
        plain = getattr(called, "py_func", called)
        if not inspect.isfunction(plain):
            raise self.wrong(node, "has no form in it")
        if kinds[:1] in (["number"], ["flag"]) and _passed_on(plain):
            return arguments[0]
        function = self.reader.function(called, tuple(kinds))
        self.writes |= function.writes
        if isinstance(constant := _constant_of(function), Flag | Number):
            return constant
        return Call(function, tuple(arguments))

    def _constant(self, node: ast.Name) -> Any:
        try:
            return self.value(node)
        except InputError:
            return None

    def is_flag(self, value: Any) -> bool:
        """Whether an expression is true or false, and no number."""
        match value:
            case Flag():
                return True
            case Name(name=name):
                return name in self.flags
            case Operation(operator=operator):
                return operator in _OF_FLAGS
            case Choice(then=then):
                return self.is_flag(then)
            case Call(function=function):
                return function.returns_flag
        return False

    def wrong(self, node: ast.AST, problem: str) -> InputError:
        """A refusal that says where, and shows the piece."""
        return InputError(f"{_where(self.function, node)}: `{ast.unparse(node).splitlines()[0][:80]}` {problem}")


def _plain(function: Any) -> Any:
    """The Python function of one that numba has compiled."""
    return getattr(function, "py_func", function)


def _tree(function: Callable[..., Any]) -> ast.FunctionDef:
    try:
        source = textwrap.dedent(inspect.getsource(function))
    except OSError:
        raise InputError(f"{_where(function)}: its source cannot be read, and an export is made of it") from None
    (tree,) = ast.parse(source).body
    assert isinstance(tree, ast.FunctionDef)
    return tree


def _where(function: Any, node: ast.AST | None = None) -> str:
    """'cogging_torque.py, line 31'."""
    file = Path(function.__code__.co_filename).name
    return f"{file}, line {function.__code__.co_firstlineno + getattr(node, 'lineno', 1) - 1}"


def _passed_on(function: Any) -> bool:
    """Whether a function does nothing but hand on its first argument."""
    tree = _tree(function)
    body = [one for one in tree.body if not isinstance(one, ast.Expr)]
    match body:
        case [ast.Return(value=ast.Name(id=name))]:
            return bool(tree.args.args) and name == tree.args.args[0].arg
    return False


def _constant_of(function: Function) -> Expression | None:
    match function.body:
        case (Return(values=(Flag() | Number() as value,)),):
            return value
    return None


# --- what is not needed goes ------------------------------------------------------------------------------------------


def _alive(body: tuple[Statement, ...]) -> tuple[Statement, ...]:
    """Without assignments to names that nobody reads and that change no state."""
    while True:
        read = {one.name for one in _names(body)}
        kept = tuple(one for one in body if not _is_dead(one, read))
        if len(kept) == len(body):
            return kept
        body = kept


def _is_dead(one: Statement, read: set[str]) -> bool:
    if not isinstance(one, Assign) or not one.targets or any(isinstance(place, Row) for place in one.targets):
        return False
    if any(call.function.writes for call in _calls((one,))):
        return False
    return not any(place.name in read for place in one.targets)


def _expressions(body: Sequence[Statement]) -> Iterator[Expression]:
    """Every expression of these statements, those within others too; targets are none."""
    open_: list[Any] = []
    for one in body:
        match one:
            case Assign(value=value):
                open_.append(value)
            case If(test=test, body=inner):
                open_.append(test)
                yield from _expressions(inner)
            case Return(values=values):
                open_ += values
    while open_:
        one = open_.pop()
        yield one
        match one:
            case Operation(operands=operands):
                open_ += operands
            case Choice(test=test, then=then, otherwise=otherwise):
                open_ += [test, then, otherwise]
            case Call(arguments=arguments):
                open_ += arguments
            case Part(of=of):
                open_.append(of)


def _reached(entries: Iterable[Function]) -> set[Function]:
    """These, and those that they call."""
    found: set[Function] = set()
    open_ = list(entries)
    while open_:
        one = open_.pop()
        if one not in found:
            found.add(one)
            open_ += [call.function for call in _calls(one.body)]
    return found


def _names(body: Sequence[Statement]) -> Iterator[Name]:
    return (one for one in _expressions(body) if isinstance(one, Name))


def _calls(body: Sequence[Statement]) -> Iterator[Call]:
    return (one for one in _expressions(body) if isinstance(one, Call))


def _rows(body: Sequence[Statement]) -> Iterator[Row]:
    """Those that are read or written."""
    yield from (one for one in _expressions(body) if isinstance(one, Row))
    for one in body:
        if isinstance(one, Assign):
            yield from (place for place in one.targets if isinstance(place, Row))
        elif isinstance(one, If):
            yield from _rows(one.body)
