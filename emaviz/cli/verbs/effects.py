"""`emaviz effects`: the library of physical effects."""

from __future__ import annotations

import argparse
import textwrap
from dataclasses import asdict
from typing import TYPE_CHECKING, cast

from emaviz.cli import options
from emaviz.cli.options import add_json, effect_name

if TYPE_CHECKING:
    from ema_model.effects import Effect, Parameter
    from emaviz.cli.output import EffectJson, EffectParameterFactsJson

HELP = "list the physical effects that can be added to the models, or explain one"
PLACE = 8


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """NAME, --html and --json."""
    parser.add_argument("name", nargs="?", type=effect_name, metavar="NAME", help="one effect; all without it")
    parser.add_argument(
        "--html", type=options.Folder(), metavar="DIR", help="write the library as pages, with typeset equations"
    )
    add_json(parser)


def documents() -> tuple[type, ...]:
    """What --json holds."""
    from emaviz.cli.output import EffectsJson

    return (EffectsJson,)


def run(arguments: argparse.Namespace) -> int:
    """Prints the list or the explanation, or writes the pages."""
    from ema_model.effects import CATALOGUE, find
    from ema_model.effects.user.torque import KEYS, TITLES
    from emaviz.cli.output import write_json

    if arguments.name in KEYS:
        print(explain_users(arguments.name))
        write_json(arguments, {"effects": [_users_facts(arguments.name)]})
        return 0
    chosen = [find(arguments.name)] if arguments.name else list(CATALOGUE.values())
    if arguments.html:
        from emaviz.views.effects import write_effects_reference

        print(f"{arguments.html}: {len(write_effects_reference(arguments.html))} pages; begin with index.html")
    elif arguments.name:
        print(explain(chosen[0]))
    else:
        width = max(len(effect.name) for effect in chosen)
        for effect in chosen:
            print(f"{effect.name:{width}}  {effect.family:9}  {effect.equation}")
        for name in KEYS:
            print(f"{name:{width}}  {'yours':9}  {TITLES[name]}")
    users = [] if arguments.name else [_users_facts(name) for name in KEYS]
    write_json(arguments, {"effects": [*(_facts(effect) for effect in chosen), *users]})
    return 0


def explain_users(name: str) -> str:
    """What an effect of the user's own is made of, for a terminal."""
    from ema_model.effects.user.torque import KEYS, TITLES

    width = max(map(len, KEYS[name]))
    entries = [f"  {key:{width}}  {meaning}" for key, meaning in KEYS[name].items()]
    return "\n".join([TITLES[name], "", f"The table [effects.{name}] of an actuator file", *entries])


def _users_facts(name: str) -> EffectJson:
    from ema_model.effects.user.torque import KEYS, TITLES

    return {"name": name, "title": TITLES[name], "keys": dict(KEYS[name])}


def explain(effect: Effect) -> str:
    """Everything about an effect, for a terminal."""
    from ema_model.effects.effect import FAMILIES
    from ema_model.quantities import VARIABLES

    lines = [effect.title, f"  {effect.equation}", "", textwrap.fill(effect.explanation, 92), "", "Parameters"]
    width = max(len(p.name) for p in effect.parameters)
    lines += [
        f"  {p.name:{width}}  {p.meaning}; {p.low:g} … {p.high:g}, default {p.default:g}{_on_a_linear_axis(p)}"
        for p in effect.parameters
    ]
    severities = ", ".join(f"{value:g}" for value in effect.severities)
    lines += [
        "",
        f"Belongs to    {FAMILIES[effect.family]}",
        f"Shows         {effect.shows}",
        *([f"Follows       the {VARIABLES[effect.against].noun}"] if effect.against != "time" else []),
        f"Mistaken for  {effect.mistaken_for}",
        *([f"Duplicates    {effect.duplicates}, which a calibration moves"] if effect.duplicates else []),
        f"Severities    {effect.parameters[0].name} = {severities}",
        f"Source        {effect.source}",
    ]
    return "\n".join(lines)


def _on_a_linear_axis(parameter: Parameter) -> str:
    """What it is called where the side that it sits at is linear, and its range there."""
    from ema_model.quantities import Axes

    there = parameter.on(Axes("linear", "linear"))
    if there.unit == parameter.unit:
        return ""
    whose = parameter.per or parameter.side
    return f" (where the {whose}'s axis is linear: {there.shown}, {there.low:g} … {there.high:g} {there.unit})"


def _facts(effect: Effect) -> EffectJson:
    return {
        "name": effect.name,
        "title": effect.title,
        "equation": effect.equation,
        "source": effect.source,
        "explanation": effect.explanation,
        "parameters": [cast("EffectParameterFactsJson", asdict(p)) for p in effect.parameters],
        "severities": list(effect.severities),
        "shows": effect.shows,
        "against": effect.against,
        "mistaken_for": effect.mistaken_for,
        "family": effect.family,
        "duplicates": effect.duplicates,
    }
