"""What every analysis answers with: a frozen dataclass that says, shows, exports and restores itself.

A field is in the JSON form where its type says what it means: `Annotated[float, Meta(description="Hz")]`.  So is a
property with such a type, which is told and not restored.  The schema is made of the same types.  A result that has
fields beside its JSON form, as the series of a comparison, is told by it and not restored of it.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from importlib.metadata import entry_points
from operator import attrgetter
from pathlib import Path
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    Protocol,
    Self,
    TypedDict,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

import msgspec
import numpy as np
from msgspec import Meta

from ema_model.errors import InputError, quoted
from ema_model.files.written import write_text
from ema_model.quantities import plain
from ema_model.text import InWords, Lines

Kind = TypeVar("Kind")

VIEWS = "ema_model.views"  # the group of entry points of packages that show results


NAME = {"is_name": True}  # `Meta(…, extra=NAME)`: a signal's or a parameter's name inside, or several, or keys
NULL = {"null": True}  # `Meta(…, extra=NULL)`: a number, or each of several, that may not be finite

FLAT = {"flat": True}  # `Meta(extra=FLAT)`: a part of the result whose fields stand among the result's own


def as_named(name: str, description: str, **more: Any) -> Meta:
    """What a field means that has another name in the JSON form; more: of `NAME`, `NULL` and dimensions."""
    return Meta(description=description, extra={"as": name, **more})


class Shows(Protocol):
    """What a package offers that shows results; its entry point in the group `VIEWS` is a module with these."""

    SUFFIXES: tuple[str, ...]
    figures: Callable[[Any], list[Any]]  # of a result, in reading order
    export: Callable[[Any, Path], None]  # writes a result in the form that the suffix names


class Result(InWords):
    """Base of the frozen dataclasses that analyses return; `document` says it in words, for print and notebooks."""

    def to_dict(self) -> dict[str, Any]:
        """The JSON form: plain values only; a number that is not finite is None."""
        return json_form(self, self.name_in_files)

    def name_in_files(self, name: str) -> str:
        """A signal or a parameter as files call it, by its name inside; asked of what is a `NAME`."""
        return name

    @classmethod
    def from_dict(cls, given: Mapping[str, Any]) -> Self:
        """What `to_dict` gave; InputError, one line, for what does not fit the types."""
        try:
            return msgspec.convert(_stored(given, cls), cls, dec_hook=_array)
        except (msgspec.ValidationError, ValueError, TypeError) as error:
            raise InputError(f"no {cls.__name__} can be made of it ({quoted(error, 120)}); compute it anew") from None

    def stored(self) -> dict[str, Any]:
        """All its fields, series too: plain values and arrays.  InputError for a result that holds what has none."""
        return stored(self)

    @classmethod
    def restored(cls, given: Any) -> Self:
        """What `stored` gave, nothing computed; InputError, one line, for what is damaged or of another version.

        What cannot be told of it is damaged, too.
        """
        return restored(given, cls, lambda found: (found.to_dict(), str(found.document)))

    @property
    def lines(self) -> list[str]:
        """All that `document` says in sentences, its tables left out."""
        told = self.document.blocks
        return [line for block in told if isinstance(block, Lines) for line in block.lines]

    def figures(self) -> list[Any]:
        """Plotly figures in reading order, of the package that shows results."""
        return _shows().figures(self)

    def export(self, path: str | Path) -> None:
        """Writes a file whose suffix names its form: .json, .csv, .html (a report), .rrd (for the Rerun viewer).

        It is written whole or not at all; InputError, one line, where it cannot be.
        """
        target = Path(path)
        if target.suffix == ".json":
            text = msgspec.json.format(msgspec.json.encode(self.to_dict()), indent=1).decode()
            write_text(target, f"{text}\n", "the result")
            return
        shows = _shows()
        if target.suffix not in shows.SUFFIXES:
            known = ", ".join((".json", *shows.SUFFIXES))
            raise InputError(f"{quoted(target)}: a result is written as {known}; let the name end in one of these")
        shows.export(self, target)


_at_hand: list[Shows] = []


def shown_by(package: Shows) -> None:
    """Has a package show results that is imported already, as where the program runs from its sources."""
    _at_hand[:] = [package]


def _shows() -> Shows:
    """The package that shows results, else the installed one: the science itself knows none."""
    if not _at_hand:
        for one in entry_points(group=VIEWS):
            shown_by(cast(Shows, importlib.import_module(one.value)))  # a module is what it offers
    if not _at_hand:
        raise InputError("no package is installed that shows results; install emaviz anew")
    return _at_hand[0]


# --- the JSON form and its schema, both of a class's types ------------------------------------------------------------


@dataclass(frozen=True)
class Described:
    """A field, or a property, that is in the JSON form."""

    attribute: str  # dotted where it is of a flat part
    type: Any  # with what it means
    is_name: bool


@cache
def described(kind: type) -> dict[str, Described]:
    """What is in the JSON form of a dataclass, by its name there: its fields, then its properties.

    That is the attribute's own name, unless `Meta(extra={"as": …})` says another.
    """
    hints = get_type_hints(kind, include_extras=True)
    types = {one.name: hints[one.name] for one in fields(kind)}
    for base in reversed(kind.__mro__):
        for name, one in vars(base).items():
            if isinstance(one, property) and one.fget is not None:
                types[name] = get_type_hints(one.fget, include_extras=True).get("return")
    found = {}
    for name, of in types.items():
        extra = _extra(of)
        if extra is not None:
            if extra.get("flat"):
                part = described(get_args(of)[0])
                found |= {key: Described(f"{name}.{one.attribute}", one.type, one.is_name) for key, one in part.items()}
                continue
            found[extra.get("as", name)] = Described(name, of, extra.get("is_name", False))
    return found


def _extra(of: Any) -> dict[str, Any] | None:
    """What is said of a field beside its meaning; None of one that is not in the JSON form."""
    said = [one for one in getattr(of, "__metadata__", ()) if isinstance(one, Meta)]
    return (said[0].extra or {}) if said else None


@cache
def json_type(kind: type, *more: type) -> Any:
    """A TypedDict of the JSON form of a dataclass: what its schema is made of, and what a document is held against.

    more: TypedDicts of what a verb says besides.
    """
    types = {name: _json(one.type) for name, one in described(kind).items()}
    for one in more:
        types |= get_type_hints(one, include_extras=True)
    name = "".join([kind.__name__, *(one.__name__.removesuffix("Json") for one in more)])  # one form has one name
    made = TypedDict(name, types)  # type: ignore[operator]
    made.__doc__ = (kind.__doc__ or "").strip().partition("\n")[0]
    return made


def _json(of: Any) -> Any:
    """A type of the JSON form, of one of a field."""
    origin, parts = get_origin(of), get_args(of)
    if origin is Annotated:
        inner, *said = parts
        dimensions = next((one.extra.get("dimensions", 1) for one in said if isinstance(one, Meta) and one.extra), 1)
        made = _rows(dimensions) if get_origin(inner) is np.ndarray else _json(inner)
        if any(one.extra.get("null") for one in said if isinstance(one, Meta) and one.extra):
            made = _or_null(made)
        return Annotated[(made, *said)]
    if origin is np.ndarray:
        return _rows(1)
    if isinstance(of, type) and is_dataclass(of):
        return json_type(of)
    if origin is tuple:
        if parts[-1] is ...:
            return list[_json(parts[0])]
        return Annotated[list[_either(parts)], Meta(min_length=len(parts), max_length=len(parts))]
    if origin in (Union, UnionType):
        return _either(parts)
    if parts:
        return origin[tuple(_json(one) for one in parts)]  # type: ignore[index]
    return of


def _either(parts: tuple[Any, ...]) -> Any:
    """One of several types."""
    return Union[tuple(_json(one) for one in parts)]  # noqa: UP007  made of parts


def _or_null(of: Any) -> Any:
    """A type of numbers, of which each may be null."""
    if get_origin(of) is Annotated:
        return _or_null(get_args(of)[0])
    parts = get_args(of)
    return get_origin(of)[tuple(_or_null(one) for one in parts)] if parts else float | None if of is float else of


def _rows(dimensions: int) -> Any:
    return list[_rows(dimensions - 1)] if dimensions else float | None


def json_form(value: Any, in_files: Callable[[str], str]) -> Any:
    """Of a result, or of a part of one, in plain values; in_files: as `Result.name_in_files`."""
    if isinstance(value, Result):
        in_files = value.name_in_files
    if is_dataclass(value) and not isinstance(value, type):
        found = {}
        for name, one in described(type(value)).items():
            told = json_form(attrgetter(one.attribute)(value), in_files)
            found[name] = _renamed(told, in_files) if one.is_name else told
        return found
    if isinstance(value, Mapping):
        return {name: json_form(one, in_files) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [json_form(one, in_files) for one in value]
    return plain(value.tolist() if isinstance(value, np.ndarray) else value)


def _renamed(value: Any, in_files: Callable[[str], str]) -> Any:
    """A name, several, or what is told by name; None where there is none."""
    if value is None:
        return None
    if isinstance(value, dict):
        return {in_files(name): one for name, one in value.items()}
    return in_files(value) if isinstance(value, str) else [_renamed(one, in_files) for one in value]


def _stored(given: Any, kind: Any) -> Any:
    """The same without what properties tell, which fields hold already; None in place of a number is NaN."""
    if get_origin(kind) is Annotated:
        return _stored(given, get_args(kind)[0])
    if isinstance(given, Mapping) and isinstance(kind, type) and is_dataclass(kind):
        hints = get_type_hints(kind, include_extras=True)
        found = {}
        for one in fields(kind):
            extra = _extra(hints[one.name])
            if extra is None:
                continue
            if extra.get("flat"):
                found[one.name] = _stored(given, hints[one.name])
            elif (key := extra.get("as", one.name)) in given:
                found[one.name] = _stored(given[key], hints[one.name])
        return found
    if given is None:
        return float("nan") if kind is float else None
    parts = [one for one in get_args(kind) if one not in (NoneType, ...)]
    if isinstance(given, Mapping) and get_origin(kind) in (dict, Mapping):
        return {name: _stored(one, parts[1]) for name, one in given.items()}
    if get_origin(kind) in (Union, UnionType):
        return _stored(given, parts[0]) if len(parts) == 1 else given
    if isinstance(given, list | tuple) and get_origin(kind) in (list, tuple, Sequence):
        return [_stored(one, parts[min(i, len(parts) - 1)]) for i, one in enumerate(given)]
    return given


def _array(kind: Any, given: Any) -> Any:
    """Of msgspec: what it has no reader for."""
    if get_origin(kind) is np.ndarray or kind is np.ndarray:
        return np.array(given, dtype=float)  # None becomes NaN
    raise NotImplementedError(f"{kind} is not restored")


# --- a result whole, as a session stores it: each dataclass by its fields, each object once ---------------------------


class MadeOf(Protocol):
    """What is stored by the parts that it is made of, a dataclass with `made()`, which the type of `made_of` names."""

    def made_of(self) -> Any:
        """Of which the same is made again."""
        ...


_DAMAGED = (
    ArithmeticError, AssertionError, AttributeError, LookupError, MemoryError, RecursionError, TypeError, ValueError
)  # fmt: skip


def stored(value: Any) -> Any:
    """A dataclass and all that it holds, as plain values and arrays.  InputError for what has none."""
    return _stored_whole(value, {})


def restored(given: Any, kind: type[Kind], told: Callable[[Kind], object] = lambda found: None) -> Kind:
    """What `stored` gave of a value of a type.  InputError, one line, for what is damaged or of another version.

    told(found): what it must be able to tell, as its parts may not fit each other; any error says that they do not.
    """
    try:
        found = _restored_whole(given, kind, [])
        told(found)
        return found
    except InputError:
        raise
    except _DAMAGED as error:
        raise InputError(
            f"it was stored by another version, or is damaged ({quoted(error, 80)}); compute it anew"
        ) from None


def _stored_whole(value: Any, known: dict[int, int]) -> Any:
    """Plain values and arrays; known: the places of objects that are stored, by their id."""
    if value is None or isinstance(value, str | bool | int | float | np.ndarray):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, slice):
        return [value.start, value.stop, value.step]
    made = _is_made_of(type(value))
    if made or (is_dataclass(value) and not isinstance(value, type)):
        if id(value) in known:
            return {"same": known[id(value)]}
        of = cast(MadeOf, value).made_of() if made else value
        own = {
            one.name: _stored_whole(getattr(of, one.name), known)
            for one in fields(of)
            if one.init and not one.name.startswith("_")
        }
        known[id(value)] = len(known)
        return {"class": type(of).__name__, "fields": own}
    if isinstance(value, Mapping):
        return [[_stored_whole(name, known), _stored_whole(one, known)] for name, one in value.items()]
    if isinstance(value, list | tuple | set | frozenset):
        return [_stored_whole(one, known) for one in value]
    raise InputError(f"a {type(value).__name__} is not stored; compute it anew")


def _restored_whole(given: Any, kind: Any, known: list[tuple[type, Any]]) -> Any:
    """The same as the type says that it is, and as nothing else."""
    origin, parts = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return _restored_whole(given, parts[0], known)
    if origin in (Union, UnionType):
        return _restored_whole(given, _of_several(given, parts), known)
    if origin is np.ndarray or kind is np.ndarray:
        return _as_said(given, np.ndarray)
    if origin is Literal:
        if given not in parts:
            raise ValueError(f"none of {parts}")
        return given
    if isinstance(kind, type) and (is_dataclass(kind) or _is_made_of(kind)):
        return _restored_object(_as_said(given, dict), kind, known)
    of = origin or kind
    if of is slice:
        start, stop, step = (one if one is None else _as_said(one, int) for one in _as_said(given, list))
        return slice(start, stop, step)
    if isinstance(of, type) and issubclass(of, Mapping):
        return {
            _restored_whole(name, parts[0], known): _restored_whole(one, parts[1], known)
            for name, one in _as_said(given, list)
        }
    if of is tuple and parts[-1:] != (...,):
        if len(_as_said(given, list)) != len(parts):
            raise ValueError(f"{len(parts)} values are expected")
        return tuple(_restored_whole(one, part, known) for one, part in zip(given, parts))
    if of in _MANY:
        return _MANY[of](_restored_whole(one, parts[0], known) for one in _as_said(given, list))
    if of is float:
        return float(_as_said(given, int | float))
    if of in (str, int, bool, NoneType):
        return _as_said(given, of)
    raise TypeError(f"{kind} is not restored")


_MANY: dict[Any, Callable[[Any], Any]] = {
    tuple: tuple, list: list, Sequence: list, Collection: list, set: set, frozenset: frozenset
}  # fmt: skip


def _restored_object(given: dict[str, Any], kind: type, known: list[tuple[type, Any]]) -> Any:
    made = _is_made_of(kind)
    parts = get_type_hints(kind.made_of)["return"] if made else kind
    if "same" in given:
        was, found = known[_as_said(given["same"], int)]
        if not issubclass(was, parts):
            raise TypeError(f"a {was.__name__} stands where another type is expected")
        return found
    of = {one.__name__: one for one in _kinds(parts)}[given["class"]]
    hints, own = get_type_hints(of, include_extras=True), given["fields"]
    wanted = [one.name for one in fields(of) if one.init and not one.name.startswith("_")]
    if set(wanted) != set(own):
        raise ValueError(f"a {of.__name__} has other fields")
    found = of(**{name: _restored_whole(own[name], hints[name], known) for name in wanted})
    found = found.made() if made else found
    known.append((of, found))
    return found


def _is_made_of(kind: Any) -> bool:
    """Whether it, a type, is `MadeOf`."""
    return isinstance(kind, type) and callable(getattr(kind, "made_of", None))


def _kinds(kind: type) -> list[type]:
    """A dataclass and all that are made of it."""
    return [kind, *(one for more in kind.__subclasses__() for one in _kinds(more))]


def _of_several(given: Any, kinds: Sequence[Any]) -> Any:
    """Which of several types a stored value is of."""
    if given is None:
        return NoneType
    others = [one for one in kinds if one is not NoneType]
    for one in others:
        plain_type = get_origin(one) or one
        if plain_type is Annotated:
            plain_type = get_origin(get_args(one)[0]) or get_args(one)[0]
        is_object = isinstance(plain_type, type) and (is_dataclass(plain_type) or _is_made_of(plain_type))
        if isinstance(given, dict):
            names = [each.__name__ for each in _kinds(plain_type)] if is_object else []
            if is_object and ("same" in given or given.get("class") in names or _is_made_of(plain_type)):
                return one
        elif isinstance(given, list) and not is_object and plain_type not in (str, int, float, bool, np.ndarray):
            return one
        elif isinstance(plain_type, type) and isinstance(given, plain_type):
            return one
    return others[0]


def _as_said(given: Any, kind: Any) -> Any:
    if not isinstance(given, kind) or (isinstance(given, bool) and kind is not bool):
        raise TypeError(f"a {type(given).__name__} stands where another type is expected")
    return given
