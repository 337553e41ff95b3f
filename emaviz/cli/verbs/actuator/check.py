"""`emaviz actuator check`: what an actuator file lacks, what is hard to believe, what a recording cannot tell."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from ema_model.text import Document, Lines
from emaviz.cli import options

if TYPE_CHECKING:
    from ema_model.actuator import Actuator

if TYPE_CHECKING:
    from emaviz.cli.output import CheckedActuatorJson

HELP = "say what an actuator file lacks, what is hard to believe, and what a recording cannot tell of it"
PLACE = 2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """FILE.toml, and a recording with its mapping."""
    parser.add_argument("file", type=options.ACTUATOR, metavar="FILE.toml", help="the actuator file")
    parser.add_argument("recording", nargs="?", type=options.RECORDING, metavar="RECORDING", help="of this actuator")
    options.add_mapping(parser)
    options.add_json(parser)


def documents() -> tuple[type, ...]:
    """What --json holds."""
    from emaviz.cli.output import CheckedActuatorJson

    return (CheckedActuatorJson,)


def run(arguments: argparse.Namespace) -> int:
    """Loads, checks, and calibrates where there is a recording."""
    from ema_model.actuator import load_actuator
    from ema_model.actuator.describe import implausible, missing
    from emaviz.cli import output

    actuator = load_actuator(arguments.file)
    found = {"missing": list(missing(actuator)), "implausible": list(implausible(actuator)), "unidentifiable": []}
    if arguments.recording:
        for kind, lines in _beside(actuator, arguments).items():
            found[kind] += lines
    print(_document(actuator, found, arguments).text)
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
    from emaviz.cli import option_values, output

    progress = output.Progress(arguments)
    try:
        recording = option_values.read_one(arguments.recording, arguments, actuator, progress)
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


def _document(actuator: Actuator, found: dict[str, list[str]], arguments: argparse.Namespace) -> Document:
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
