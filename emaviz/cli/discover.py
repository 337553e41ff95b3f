"""`emaviz discover`: which physical effects are missing, added one after another; the error ladder."""

from __future__ import annotations

import argparse

from ema_model.actuator import save_actuator
from ema_model.actuator.naming import on_axes
from ema_model.comparison.summary import plain
from ema_model.discovery import Discovery, as_dict, discover, verified
from ema_model.effects import find
from ema_model.effects.effect import FAMILIES
from emaviz.cli import files, options, output
from emaviz.cli.numbers import whole
from emaviz.text.discovery import (
    VERDICTS,
    faults,
    next_experiment,
    not_claimed,
    remains,
    settings,
    verification,
)

HELP = "find the physical effects that the model lacks, and add them"
_CURRENT_ONLY = ("current_A",)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of INTERFACES."""
    parser.add_argument(
        "files", nargs="+", type=files.RECORDING, metavar="FILE", help="recordings of one actuator, fitted together"
    )
    options.add_fit(parser, "the discovery")
    parser.add_argument("--signals", choices=("current", "all"), default="all", help="what is fitted")
    parser.add_argument("--max-effects", type=whole(0, 100), default=3, metavar="N", help="at most so many are added")
    options.add_seed(parser)


def run(arguments: argparse.Namespace) -> int:
    """Reads, discovers, writes and prints."""
    actuator = options.actuator_of(arguments)
    progress = output.Progress()
    try:
        fitted, held = (
            options.read_all(named, arguments, actuator, progress) for named in (arguments.files, arguments.holdout)
        )
        found = discover(
            fitted,
            actuator,
            holdout=held,
            signals=_CURRENT_ONLY if arguments.signals == "current" else None,
            most_effects=arguments.max_effects,
            on_progress=progress.show,
        )
        told, document = text(found), as_dict(found)
        if arguments.save_actuator:
            save_actuator(found.actuator, arguments.save_actuator)
            progress.show("simulating the saved model")
            saved = verified(found, arguments.save_actuator)
            told += f"\n\nsaved {arguments.save_actuator}, {verification(found, saved)}"
            document["saved_actuator"] = {
                "file": arguments.save_actuator,
                "verified_rmse": saved.rmse,
                "verified_holdout_rmse": saved.holdout_rmse,
            }
    finally:
        progress.done()
    output.write_json(arguments.json, plain(document), arguments.seed, output.configuration(arguments))
    print(told)
    _write(found, arguments)
    return 0


def _write(found: Discovery, arguments: argparse.Namespace) -> None:
    """The recording and the report, last: if one fails, the answer is there."""
    if arguments.record:
        from emaviz.recording.discovery.write import write_discovery  # rerun takes a second to import

        write_discovery(found, arguments.record, output.configuration(arguments))
    if arguments.report:
        from emaviz.report import write_discovery_report  # as does plotly

        write_discovery_report(found, arguments.report, output.configuration(arguments))


def text(found: Discovery) -> str:
    """The answer as the terminal shows it: the verdict, the effects, the ladder, the candidates."""
    lines = [f"{found.verdict}: {VERDICTS[found.verdict]}"]
    lines += [f"! {warning}" for warning in found.warnings]
    for one in found.effects:
        effect = find(one.name)
        lines += ["", f"{effect.title}: {effect.equation}"]
        names = {name: on_axes(f"effects.{one.key}.{name}", found.actuator.axes).name for name in one.parameters}
        lines += [f"  {names.get(name, name):24}  {told}" for name, told in settings(found, one).items()]
        if effect.family == "drive":
            lines.append(f"  it belongs to {FAMILIES[effect.family]}")
        if one.same_as:
            lines.append(f"  these recordings cannot tell it from {', '.join(one.same_as)}")
    if found.faults:
        lines += ["", "faults of the actuator", *(f"  {told}" for told in faults(found).values())]
    lines += ["", f"{'error ladder':34}{'fitted':>10}{'held out':>10}   (1 is the floor)"]
    for rung in found.ladder:
        held = "" if rung.holdout_rmse is None else f"{rung.holdout_rmse:10.3f}"
        lines.append(f"  {rung.label:32}{rung.rmse:10.3f}{held}")
    if found.candidates:
        lines += ["", f"{'candidates':34}{'predicted':>10}{'refitted':>10}   (fall of χ²)"]
        for candidate in found.candidates:
            drop = "" if candidate.refitted_drop is None else f"{candidate.refitted_drop:10.0f}"
            why = f"   {candidate.untestable_reason}" if candidate.untestable_reason else ""
            lines.append(f"  {candidate.name:32}{candidate.predicted_drop:10.0f}{drop:>10}{why}")
    if found.parameters_outside_tolerance:
        outside = ", ".join(on_axes(name, found.actuator.axes).path for name in found.parameters_outside_tolerance)
        lines += ["", f"outside their tolerance: {outside}"]
    if found.verdict in ("partly_explained", "unknown_effect"):
        lines += ["", f"{remains(found)}"]
    if found.unknown is not None:
        lines += ["", found.unknown.sentence]
    if refused := not_claimed(found):
        lines += ["", *refused]
    if experiment := next_experiment(found):
        lines += ["", *experiment]
    return "\n".join(lines)
