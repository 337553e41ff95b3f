"""`emaviz actuator new`: an actuator file with comments, from options or from answers on the terminal."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ema_model.actuator import save_actuator
from ema_model.actuator.describe import described, entry_of, gear_of
from ema_model.actuator.keys import KINDS
from ema_model.actuator.plausible import implausible, missing
from ema_model.effects.user.entries import kind_of
from ema_model.errors import InputError, quoted
from ema_model.quantities.axes import KINDS as AXES
from emaviz.cli import files, given, options, output
from emaviz.cli.numbers import FINITE
from emaviz.cli.verbs.actuator.questions import ask

if TYPE_CHECKING:
    from emaviz.cli.documents import NewActuatorJson

HELP = "write an actuator file with comments, from options or from answers on the terminal"
PLACE = 1
_HERE = "actuator new"
_TEXTS = ("expression", "variable", "modulator")  # of a user's effect


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The kinds, the values that are known, effects, and how recordings are read."""
    parser.add_argument("file", type=files.SAVED_ACTUATOR, metavar="FILE.toml", help="the file to write")
    parser.add_argument("--name", help="what the actuator is called; without it, the file's name")
    parser.add_argument("--description", default="", help="a sentence about it")
    parser.add_argument("--motor", choices=AXES, help="whether the motor turns; rotary without it")
    parser.add_argument("--user", choices=AXES, help="whether what it moves turns or slides; rotary without it")
    parser.add_argument("--gear", metavar="RATIO", help="user's motion per motor's: 0.002, 1/500 or 500:1")
    parser.add_argument("--lead-mm", type=FINITE, metavar="mm", help="of a screw, per turn of the motor")
    parser.add_argument("--controller", choices=tuple(KINDS["controller"]), help="unknown: inverse dynamics")
    parser.add_argument(
        "--drive", choices=(*KINDS["inverter"], "unknown"), help="what the controller's output acts through"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="section.name=value",
        dest="settings",
        help="a parameter, with its tolerance where it is known: motor.inertia_kgm2=1e-4±5%%; repeat for more",
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
    files.add_force(parser)


def documents() -> tuple[type, ...]:
    """What --json holds."""
    from emaviz.cli.documents import NewActuatorJson

    return (NewActuatorJson,)


def run(arguments: argparse.Namespace) -> int:
    """Asks for what no option says where a terminal is there, guesses the rest, and writes the file."""
    document = _document(arguments)
    if arguments.controller is None and sys.stdin.isatty():
        ask(document, arguments)
    controller, drive = _kinds(arguments)
    actuator = described(document, controller, drive, _HERE)
    save_actuator(actuator, arguments.file, with_comments=True)
    found: NewActuatorJson = {
        "file": arguments.file,
        "name": actuator.name,
        "missing": list(missing(actuator)),
        "implausible": list(implausible(actuator)),
    }
    print(f"{arguments.file}: {actuator.name}, controller {controller}, {len(actuator.tolerances)} parameters to fit")
    for line in (*found["missing"], *found["implausible"]):
        print(f"! {line}")
    output.write_json(arguments, found)
    return 0


def _kinds(arguments: argparse.Namespace) -> tuple[str, str]:
    """The kinds of controller and drive: what is not known of a loop is left to inverse dynamics."""
    if arguments.controller is None:
        raise InputError(f"{_HERE}: say --controller {', '.join(KINDS['controller'])}; unknown is always an answer")
    drive = arguments.drive or "unknown"
    if arguments.controller == "cascade":
        return "cascade", "current" if drive == "unknown" else drive
    if arguments.controller == "position" and drive != "unknown":
        return "position", drive
    return "open" if arguments.controller == "open" else "unknown", "current"


def _document(arguments: argparse.Namespace) -> dict[str, Any]:
    """The tables of a file, with the names that files have."""
    document: dict[str, Any] = {"name": arguments.name or Path(arguments.file).stem}
    document["description"] = arguments.description
    document["axes"] = {side: getattr(arguments, side) or AXES[0] for side in ("motor", "user")}
    for text in arguments.settings:
        path, separator, value = text.partition("=")
        section, dot, name = path.strip().partition(".")
        if not (separator and dot and name):
            raise InputError(f"--set {quoted(text)}: write it as section.name=value, e.g. motor.inertia_kgm2=1e-4±5%")
        document.setdefault(section, {})[name] = _setting(section, value, f"--set {quoted(path)}")
    if (gear := _gear(arguments)) is not None:
        document.setdefault("transmission", {})["gear_ratio"] = {"value": gear}
    effects = dict(_effect(text) for text in arguments.effect)
    if effects:
        document["effects"] = effects
    recordings: dict[str, Any] = {"mapping": list(arguments.mapping)} if arguments.mapping else {}
    if arguments.where:
        recordings["where"] = [_rule(text) for text in arguments.where]
    if recordings:
        document["recordings"] = recordings
    return document


def _setting(section: str, text: str, where: str) -> Any:
    if section == "model":
        known = {"true": True, "false": False}
        return known[text] if text in known else entry_of(text, where)["value"]
    return entry_of(text, where)["value"] if section == "faults" else entry_of(text, where)


def _gear(arguments: argparse.Namespace) -> float | None:
    if arguments.lead_mm is not None:
        if arguments.gear is not None:
            raise InputError("--gear and --lead-mm say the same; give one of them")
        return 1e-3 * arguments.lead_mm / (2.0 * math.pi)
    if arguments.gear is None:
        return None
    return gear_of(arguments.gear, "--gear")


def _effect(text: str) -> tuple[str, dict[str, Any]]:
    """The table of --effect NAME:param=value±tolerance,…"""
    name, _, rest = text.partition(":")
    table: dict[str, Any] = {}
    for part in given.split_at_commas(rest):
        key, separator, value = (piece.strip() for piece in part.partition("="))
        where = f"--effect {quoted(name)}: {quoted(key)}"
        if not separator:
            raise InputError(f"{where}: write it as name=value")
        if kind_of(name) and key in _TEXTS:
            table[key] = value
        elif kind_of(name) and key == "values":
            table[key] = [entry_of(one, where) for one in given.split_at_commas(value.strip("[]"))]
        else:
            entry = entry_of(value, where)
            table[key] = entry["value"] if kind_of(name) == "torque_curve" else entry
    return name, table


def _rule(text: str) -> dict[str, Any]:
    pattern, separator, rest = text.partition(":")
    if not separator or not rest:
        raise InputError(f"--where {quoted(text)}: write it as PATTERN:section.name=value,… or PATTERN:map")
    if rest in ("map", "run"):
        return {"match": pattern, "kind": rest}
    values = {}
    for part in given.split_at_commas(rest):
        path, _, value = part.partition("=")
        values[path.strip()] = entry_of(value, f"--where {quoted(path)}")["value"]
    return {"match": pattern, "set": values}
