"""`emaviz actuator new`: an actuator file with comments, from options or from answers on the terminal."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ema_model.errors import InputError, quoted
from ema_model.members import stated_in
from emaviz.cli import options
from emaviz.cli.options import FINITE, SAMPLE_RATE

if TYPE_CHECKING:
    from emaviz.cli.output import NewActuatorJson

HELP = "write an actuator file with comments, from options or from answers on the terminal"
PLACE = 1
_HERE = "actuator new"
_TEXTS = ("expression", "variable", "modulator")  # of a user's effect


def add_arguments(parser: argparse.ArgumentParser) -> None:
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


def documents() -> tuple[type, ...]:
    """What --json holds."""
    from emaviz.cli.output import NewActuatorJson

    return (NewActuatorJson,)


def run(arguments: argparse.Namespace) -> int:
    """Asks for what no option says where a terminal is there, guesses the rest, and writes the file."""
    from ema_model.actuator import save_actuator
    from ema_model.actuator.describe import described, implausible, missing
    from emaviz.cli import output
    from emaviz.cli.verbs.actuator.questions import ask

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
    from emaviz.cli import option_values

    name, _, rest = text.partition(":")
    table: dict[str, Any] = {}
    for part in option_values.split_at_commas(rest):
        key, separator, value = (piece.strip() for piece in part.partition("="))
        where = f"--effect {quoted(name)}: {quoted(key)}"
        if not separator:
            raise InputError(f"{where}: write it as name=value")
        if key in table:
            raise InputError(f"{where}: is given twice; leave one of them out")
        if kind_of(name) and key in _TEXTS:
            table[key] = value
        elif kind_of(name) and key == "values":
            table[key] = [entry_of(one, where) for one in option_values.split_at_commas(value.strip("[]"))]
        else:
            table[key] = (number_of if kind_of(name) == "torque_curve" else entry_of)(value, where)
    return name, table


def _rule(text: str) -> dict[str, Any]:
    from ema_model.actuator.describe import number_of
    from emaviz.cli import option_values

    pattern, separator, rest = text.partition(":")
    if not separator or not rest:
        raise InputError(f"--where {quoted(text)}: write it as PATTERN:section.name=value,… or PATTERN:map")
    if rest in ("map", "run"):
        return {"match": pattern, "kind": rest}
    values = {}
    for part in option_values.split_at_commas(rest):
        path, _, value = part.partition("=")
        values[path.strip()] = number_of(value, f"--where {quoted(path)}")
    return {"match": pattern, "set": values}
