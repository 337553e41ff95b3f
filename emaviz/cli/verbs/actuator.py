"""`emaviz actuator`: describe an actuator in a file, check one, and read what its keys mean."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from ema_model.errors import InputError, quoted
from ema_model.members import stated_in
from ema_model.text import Document, Lines
from emaviz.cli import options
from emaviz.cli.options import FINITE, SAMPLE_RATE
from emaviz.cli.parser import add_verbs

if TYPE_CHECKING:
    from ema_model.actuator import Actuator
    from emaviz.cli.output import CheckedActuatorJson, KeysJson, NewActuatorJson


HELP = "describe an actuator in a file, check one, or read what every key of it means"
PLACE = 7


@dataclass(frozen=True)
class _Verb:
    """One of the verbs, with what a command's file states."""

    HELP: str
    PLACE: int
    add_arguments: Callable[[argparse.ArgumentParser], None]
    documents: Callable[[], tuple[type, ...]]
    run: Callable[[argparse.Namespace], int]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The verbs with their own options."""
    verbs = parser.add_subparsers(title="what to do", metavar="new|check|keys", dest="verb", required=True)
    add_verbs(verbs, VERBS, "run_verb")


def run(arguments: argparse.Namespace) -> int:
    """Runs the verb."""
    run_verb = vars(arguments).pop("run_verb")  # not one of the options that results repeat
    return run_verb(arguments)


# --- `emaviz actuator new`: an actuator file with comments, from options or from answers on the terminal --------------

_HERE = "actuator new"
_TEXTS = ("expression", "variable", "modulator")  # of a user's effect


def _new_arguments(parser: argparse.ArgumentParser) -> None:
    """The kinds, the values that are known, effects, and how recordings are read."""
    kinds, axes = stated_in("ema_model.actuator.parameters", "KINDS"), stated_in("ema_model.quantities", "KINDS")
    parser.add_argument("file", type=options.SAVED_ACTUATOR, metavar="FILE.toml", help="the file to write")
    parser.add_argument(
        "--from",
        dest="model",
        type=options.JOINT,
        metavar="MODEL.xml#JOINT",
        help="what an MJCF model says of a joint and of the actuator that drives it; options add to it",
    )
    parser.add_argument("--name", help="what the actuator is called; without it, the file's name")
    parser.add_argument("--description", default="", help="a sentence about it")
    parser.add_argument("--motor", choices=axes, help="whether the motor turns; rotary without it")
    parser.add_argument("--user", choices=axes, help="whether what it moves turns or slides; rotary without it")
    parser.add_argument("--gear", metavar="RATIO", help="user's motion per motor's: 0.002, 1/500 or 500:1")
    parser.add_argument("--lead-mm", type=FINITE, metavar="mm", help="of a screw, per turn of the motor")
    parser.add_argument("--controller", choices=tuple(kinds["controller"]), help="unknown: inverse dynamics")
    parser.add_argument(
        "--drive", choices=(*kinds["inverter"], "unknown"), help="what the controller's output acts through"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="section.name=value",
        dest="settings",
        help="a parameter, with its tolerance where it is known: motor.inertia_kgm2=1e-4±5%%; repeat for more",
    )
    parser.add_argument(
        "--sample-rate",
        type=SAMPLE_RATE,
        metavar="Hz",
        help="of the recordings that it is for: the model's step, and the filter of a measured motion, fit it",
    )
    options.add_effects(parser)
    options.add_mapping(parser)
    parser.add_argument(
        "--where",
        action="append",
        default=[],
        metavar="PATTERN:section.name=value,…",
        help="what differs for recordings of such names, or PATTERN:map for static maps; repeat for more",
    )
    options.add_json(parser)
    options.add_force(parser)


def _new_documents() -> tuple[type, ...]:
    """What --json holds."""
    from emaviz.cli.output import NewActuatorJson

    return (NewActuatorJson,)


def _new(arguments: argparse.Namespace) -> int:
    """Asks for what no option says where a terminal is there, guesses the rest, and writes the file."""
    from ema_model.actuator import save_actuator
    from ema_model.actuator.describe import described, implausible, missing
    from emaviz.cli import output

    document = _document(arguments)
    read: list[str] = []
    if arguments.model is not None:
        read = _from_model(document, arguments)
    if arguments.controller is None and sys.stdin.isatty():
        ask(document, arguments)
    controller, drive, notes = _kinds(arguments)
    actuator = described(document, controller, drive, _HERE, arguments.sample_rate)
    save_actuator(actuator, arguments.file, with_comments=True)
    found: NewActuatorJson = {
        "file": arguments.file,
        "name": actuator.name,
        "notes": [*read, *notes],
        "missing": list(missing(actuator)),
        "implausible": list(implausible(actuator)),
    }
    print(f"{arguments.file}: {actuator.name}, controller {controller}, {len(actuator.tolerances)} parameters to fit")
    for line in (*found["notes"], *found["missing"], *found["implausible"]):
        print(f"! {line}")
    output.write_json(arguments, found)
    return 0


def _from_model(document: dict[str, Any], arguments: argparse.Namespace) -> list[str]:
    """Puts what an MJCF model says into the tables, where no option says otherwise; notes."""
    from ema_model.exports.mjcf import joint_tables

    tables, controller, drive, notes = joint_tables(arguments.model)
    for section, table in tables.items():
        document[section] = {**table, **document.get(section, {})} if section != "axes" else table
    if arguments.controller is None:
        arguments.controller, arguments.drive = controller, arguments.drive or drive
    if arguments.drive == "current" and arguments.controller in ("open", "unknown"):
        arguments.drive = None  # which have no other
    return notes


def _kinds(arguments: argparse.Namespace) -> tuple[str, str, list[str]]:
    """The kinds of controller and drive, and a line for each that the options say otherwise or not at all.

    What is not known of a loop is left to inverse dynamics.
    """
    from ema_model.actuator.describe import DRIVES
    from ema_model.actuator.parameters import KINDS

    controller, drive = arguments.controller, arguments.drive
    if controller is None:
        raise InputError(f"{_HERE}: say --controller {', '.join(KINDS['controller'])}; unknown is always an answer")
    drives = DRIVES[controller]
    if not drives or (controller == "open" and drive != "voltage"):
        reason = "the recorded current or torque is put in" if controller == "open" else "inverse dynamics has none"
        if drive not in (None, "unknown"):
            return controller, "current", [f"--drive {drive} is left out: {reason}"]
        other = f"{reason}; --drive voltage is for a recorded voltage or duty"
        return controller, "current", [f"--drive is not given: {other}"] if controller == "open" else []
    if drive is None:
        return controller, drives[0], [f"--drive is not given: {drives[0]}, {KINDS['inverter'][drives[0]]}, is taken"]
    if drive == "unknown" and controller == "cascade":
        return controller, "current", [f"--drive is unknown: current, {KINDS['inverter']['current']}, is taken"]
    if drive == "unknown":
        line = f"--controller {controller} is left out: nothing tells what its output does where the drive is unknown"
        return "unknown", "current", [line]
    return controller, drive, []


def _document(arguments: argparse.Namespace) -> dict[str, Any]:
    """The tables of a file, with the names that files have."""
    document: dict[str, Any] = {"name": arguments.name or Path(arguments.file).stem}
    document["description"] = arguments.description
    document["axes"] = {side: getattr(arguments, side) or "rotary" for side in ("motor", "user")}
    for text in arguments.settings:
        path, separator, value = text.partition("=")
        section, dot, name = path.strip().partition(".")
        if not (separator and dot and name):
            raise InputError(f"--set {quoted(text)}: write it as section.name=value, e.g. motor.inertia_kgm2=1e-4±5%")
        _put(document, section, name, _setting(section, value, f"--set {quoted(path)}"), f"--set {quoted(path)}")
    if (gear := _gear(arguments)) is not None:
        _put(document, "transmission", "gear_ratio", gear, "--gear" if arguments.gear else "--lead-mm")
    for name, table in map(_effect, arguments.effect):
        _put(document, "effects", name, table, f"--effect {quoted(name)}")
    recordings: dict[str, Any] = {"mapping": list(arguments.mapping)} if arguments.mapping else {}
    if arguments.where:
        recordings["where"] = [_rule(text) for text in arguments.where]
    if recordings:
        document["recordings"] = recordings
    return document


def _put(document: dict[str, Any], section: str, name: str, entry: Any, where: str) -> None:
    table = document.setdefault(section, {})
    if not isinstance(table, dict):
        raise InputError(f"{where}: {quoted(section)} is no section of an actuator file")
    if name in table:
        raise InputError(f"{where}: {quoted(section)}.{quoted(name)} is given twice; leave one of them out")
    table[name] = entry


def _setting(section: str, text: str, where: str) -> Any:
    from ema_model.actuator.describe import entry_of, number_of

    known = {"true": True, "false": False}
    if section == "model" and text in known:
        return known[text]
    return number_of(text, where) if section in ("model", "faults") else entry_of(text, where)


def _gear(arguments: argparse.Namespace) -> dict[str, Any] | None:
    if arguments.lead_mm is not None:
        if arguments.gear is not None:
            raise InputError("--gear and --lead-mm say the same; give one of them")
        return {"value": 1e-3 * arguments.lead_mm / math.tau}
    from ema_model.actuator.describe import gear_of

    return None if arguments.gear is None else gear_of(arguments.gear, "--gear")


def _effect(text: str) -> tuple[str, dict[str, Any]]:
    """The table of --effect NAME:param=value±tolerance,…"""
    from ema_model.actuator.describe import entry_of, number_of
    from ema_model.effects.user.torque import kind_of
    from emaviz.cli import flow

    name, _, rest = text.partition(":")
    table: dict[str, Any] = {}
    for part in flow.split_at_commas(rest):
        key, separator, value = (piece.strip() for piece in part.partition("="))
        where = f"--effect {quoted(name)}: {quoted(key)}"
        if not separator:
            raise InputError(f"{where}: write it as name=value")
        if key in table:
            raise InputError(f"{where}: is given twice; leave one of them out")
        if kind_of(name) and key in _TEXTS:
            table[key] = value
        elif kind_of(name) and key == "values":
            table[key] = [entry_of(one, where) for one in flow.split_at_commas(value.strip("[]"))]
        else:
            table[key] = (number_of if kind_of(name) == "torque_curve" else entry_of)(value, where)
    return name, table


def _rule(text: str) -> dict[str, Any]:
    from ema_model.actuator.describe import number_of
    from emaviz.cli import flow

    pattern, separator, rest = text.partition(":")
    if not separator or not rest:
        raise InputError(f"--where {quoted(text)}: write it as PATTERN:section.name=value,… or PATTERN:map")
    if rest in ("map", "run"):
        return {"match": pattern, "kind": rest}
    values = {}
    for part in flow.split_at_commas(rest):
        path, _, value = part.partition("=")
        values[path.strip()] = number_of(value, f"--where {quoted(path)}")
    return {"match": pattern, "set": values}


# --- the questions of `emaviz actuator new` on a terminal: an empty answer takes the guess ----------------------------

_GEAR = "transmission.gear_ratio"


def ask(document: dict[str, Any], arguments: argparse.Namespace) -> None:
    """Asks for the kinds and for each parameter that the options leave open; fills in document and arguments."""
    from ema_model.actuator.describe import DRIVES, actuator_axes, asked
    from ema_model.actuator.parameters import KINDS, on_axes
    from ema_model.quantities import KINDS as AXES

    axes = document["axes"]
    for side, about in (("motor", "Does the motor turn or slide"), ("user", "Does what it moves turn or slide")):
        if getattr(arguments, side) is None:
            axes[side] = _choice(about, dict.fromkeys(AXES, ""))
    arguments.controller = _choice("Which controller", KINDS["controller"])
    drives = DRIVES[arguments.controller]
    if drives and arguments.drive not in drives:
        arguments.drive = _choice("Which drive", {name: KINDS["inverter"][name] for name in drives})
    if arguments.sample_rate is None:
        arguments.sample_rate = _sample_rate()
    print("Now the parameters: a number, with its tolerance if you know it (1e-4 ± 5%); Enter for what you don't know.")
    shown = actuator_axes(document)
    for path in asked(arguments.controller, arguments.drive if drives else "current"):
        section, name = path.partition(".")[0], on_axes(path, shown).name
        if name not in document.get(section, {}) and (entry := _number(path, shown, arguments.controller)) is not None:
            document.setdefault(section, {})[name] = entry


def _choice(question: str, choices: dict[str, str]) -> str:
    for name, meaning in choices.items():
        if meaning:
            print(f"  {name:11} {meaning}")
    first = next(iter(choices))
    while True:
        answer = input(f"{question}: {', '.join(choices)}? [{first}] ").strip() or first
        found = [name for name in choices if name.startswith(answer)]
        if len(found) == 1:
            return found[0]
        print(f"  one of {', '.join(choices)}, please")


def _sample_rate() -> float | None:
    while True:
        text = input("How many samples a second have its recordings, Hz [not known] ").strip()
        if not text:
            return None
        try:
            return SAMPLE_RATE(text)
        except argparse.ArgumentTypeError as error:
            print(f"  {error}")


def _number(path: str, axes: Any, controller: str) -> dict[str, Any] | None:
    from ema_model.actuator.describe import entry_of, gear_of, unanswered
    from ema_model.actuator.parameters import facts_of, on_axes

    named, facts, usual = on_axes(path, axes), facts_of(path, axes), unanswered(path, axes, controller)
    while True:
        text = input(f"{named.title}: {facts.meaning}{f', {named.unit}' if named.unit else ''} [{usual}] ").strip()
        if not text:
            return None
        try:
            return (gear_of if path == _GEAR else entry_of)(text, "not a number")
        except InputError as error:
            print(f"  {error}")


# --- `emaviz actuator check`: what an actuator file lacks, what is hard to believe, what a recording cannot tell ------


def _check_arguments(parser: argparse.ArgumentParser) -> None:
    """FILE.toml, and a recording with its mapping."""
    parser.add_argument("file", type=options.ACTUATOR, metavar="FILE.toml", help="the actuator file")
    parser.add_argument("recording", nargs="?", type=options.RECORDING, metavar="RECORDING", help="of this actuator")
    options.add_mapping(parser)
    options.add_json(parser)


def _check_documents() -> tuple[type, ...]:
    """What --json holds."""
    from emaviz.cli.output import CheckedActuatorJson

    return (CheckedActuatorJson,)


def _check(arguments: argparse.Namespace) -> int:
    """Loads, checks, and calibrates where there is a recording."""
    from ema_model.actuator import load_actuator
    from ema_model.actuator.describe import implausible, missing
    from emaviz.cli import output

    actuator = load_actuator(arguments.file)
    found = {"missing": list(missing(actuator)), "implausible": list(implausible(actuator)), "unidentifiable": []}
    if arguments.recording:
        for kind, lines in _beside(actuator, arguments).items():
            found[kind] += lines
    print(_checked(actuator, found, arguments).text)
    document: CheckedActuatorJson = {
        "name": actuator.name,
        "missing": found["missing"],
        "implausible": found["implausible"],
        "unidentifiable": found["unidentifiable"],
    }
    output.write_json(arguments, document)
    return 0


def _beside(actuator: Actuator, arguments: argparse.Namespace) -> dict[str, list[str]]:
    """What the recording and a calibration by it say."""
    from ema_model.actuator.actuator import usual_filter
    from ema_model.actuator.parameters import on_axes
    from emaviz.cli import flow, output

    progress = output.Progress(arguments)
    try:
        recording = flow.read_one(arguments.recording, arguments, actuator, progress)
        from ema_model.comparison import compare  # takes a second: recordings are refused before

        result = compare([recording], actuator, on_progress=progress.show)
    finally:
        progress.done()
    lacking, strange, unseen = [], [], []
    with_values = [rule for rule in actuator.rules if rule.values]
    if with_values and not actuator.rules_for(recording.name):
        patterns = ", ".join(rule.match for rule in with_values)
        lacking.append(f"no [[recordings.where]] is for {recording.name}; there are {patterns}")
    calibration = result.calibration
    if calibration is None:
        return {}
    filter_s = usual_filter(1.0 / recording.sample_period_s) if recording.sample_period_s > 0.0 else 0.0
    if actuator.controller.kind == "unknown" and actuator.filter_s < 0.99 * filter_s:
        strange.append(
            f"model.filter_s = {actuator.filter_s:g} s is shorter than three samples of {recording.name} "
            f"({recording.sample_period_s:g} s apart); write {filter_s:g}"
        )
    if not calibration.converged:
        strange.append("the calibration did not converge: the parameters begin too far off, or are too many")
    for path in calibration.outside_tolerance:
        one = calibration.parameters[path]
        shown = on_axes(path, actuator.axes).path
        strange.append(f"{shown} ends at the edge of its tolerance, at {one.value:g} {one.unit}".rstrip())
    from ema_model.estimation.calibrate import together, told

    unseen += [sentence.rstrip(".") for sentence in together(calibration, actuator.axes)]
    for one in told(calibration):
        shown = on_axes(one.name, actuator.axes).path
        if one.is_unseen:
            unseen.append(f"{shown}: {recording.name} says nothing of it ({_left(one.left)}); the file's value counts")
        elif one.is_confounded:
            others = " and ".join(on_axes(name, actuator.axes).path for name in one.like[:2])
            unseen.append(f"{shown}: {recording.name} does not tell it from {others} ({_left(one.left)})")
    return {"missing": lacking, "implausible": strange, "unidentifiable": unseen}


def _left(share: float) -> str:
    return f"{share:.0%} of its tolerance is left"


def _checked(actuator: Actuator, found: dict[str, list[str]], arguments: argparse.Namespace) -> Document:
    from ema_model.actuator.parameters import on_axes, says_drive
    from ema_model.quantities import in_sentence

    free = [path for path, tolerance in actuator.tolerances.items() if tolerance.free]
    count = sum(map(len, found.values()))
    state = "nothing to complain of" if not count else f"{count} thing{'s' if count > 1 else ''} to look at"
    told_of = [in_sentence(on_axes(path, actuator.axes).title) for path in free]
    kinds = actuator.controller.kind, actuator.inverter.kind
    drive = f", drive {kinds[1]}" if says_drive(*kinds) else ""
    lines = [
        f"{actuator.name}: {state}",
        f"controller {actuator.controller.kind}{drive}; free to calibrate: {', '.join(told_of) or 'nothing'}",
    ]
    if not arguments.recording:
        lines.append("which of them a recording can tell: emaviz actuator check FILE.toml RECORDING")
    return Document([Lines(lines), *(Lines(said, title) for title, said in found.items() if said)])


# --- `emaviz actuator keys`: the reference of every key of an actuator file -------------------------------------------


def _keys_arguments(parser: argparse.ArgumentParser) -> None:
    """--json."""
    options.add_json(parser)


def _keys_documents() -> tuple[type, ...]:
    """What --json holds."""
    from emaviz.cli.output import KeysJson

    return (KeysJson,)


def _keys(arguments: argparse.Namespace) -> int:
    """Prints it."""
    from ema_model.actuator.reference import markdown, parameter_rows
    from emaviz.cli import output

    print(markdown())
    document = cast("KeysJson", {"parameters": [asdict(row) for row in parameter_rows()]})
    output.write_json(arguments, document)
    return 0


# --- the verbs, each with its help and its place in the list ----------------------------------------------------------

VERBS = {
    "new": _Verb(
        "write an actuator file with comments, from options or from answers on the terminal",
        1,
        _new_arguments,
        _new_documents,
        _new,
    ),
    "check": _Verb(
        "say what an actuator file lacks, what is hard to believe, and what a recording cannot tell of it",
        2,
        _check_arguments,
        _check_documents,
        _check,
    ),
    "keys": _Verb(
        "print the reference of every key of an actuator file, as Markdown", 3, _keys_arguments, _keys_documents, _keys
    ),
}
