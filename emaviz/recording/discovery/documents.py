"""The documents of a discovery's recording, in Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator.naming import on_axes
from ema_model.discovery import Discovery, words
from ema_model.discovery.tracks import Track
from ema_model.effects import find
from ema_model.quantities.numbers import number
from ema_model.quantities.titles import in_sentence
from emaviz.recording.markdown import escaped

Array = NDArray[np.float64]


def verdict(found: Discovery) -> str:
    """The verdict, each added effect with its parameters, the ladder in numbers, and what to be warned of."""
    lines = [f"# {escaped(words.headline(found))}", ""]
    lines += [f"{escaped(sentence)}\n" for sentence in words.sentences(found)]
    lines += [f"- ⚠ {escaped(warning)}" for warning in found.warnings]
    for one in found.effects:
        effect = find(one.name)
        lines += ["", f"## {escaped(effect.title)}", "", f"{escaped(effect.equation)}", ""]
        lines += ["| parameter | value ± half of the 90 % interval |", "|---|---|"]
        for name, told in words.settings(found, one).items():
            shown = on_axes(f"effects.{one.key}.{name}", found.actuator.axes).name
            lines.append(f"| {escaped(shown)} | {escaped(told)} |")
        if one.same_as:
            same = ", ".join(in_sentence(words.effect_title(name)) for name in one.same_as)
            lines += ["", f"Not to be told from {escaped(same)} by these recordings."]
    if experiment := words.next_experiment(found):
        lines += ["", "## Next experiment", "", *(escaped(sentence) for sentence in experiment)]
    lines += ["", "## Error over floor", "", "| step | | fitted | held out |", "|---|---|---|---|"]
    for i, rung in enumerate(found.ladder):
        held = "" if rung.holdout_rmse is None else number(rung.holdout_rmse)
        title = words.rung_title(rung.change, found.actuator.axes)
        lines.append(f"| {i} | {escaped(title)} | {number(rung.rmse)} | {held} |")
    return "\n".join([*lines, "", escaped(words.FLOOR_NOTE)])


def candidates(found: Discovery) -> str:
    """The ranking, best first; below it what these recordings cannot show."""
    lines = ["# Candidates", ""]
    if not found.candidates:
        return "\n".join([*lines, "None was scored."])
    lines += ["Each effect alone, in the calibrated model.", ""]
    lines += ["| rank | effect | predicted fall of χ² | refitted |", "|---|---|---|---|"]
    hidden = [one for one in found.candidates if one.untestable_reason]
    for rank, one in enumerate((one for one in found.ranked if not one.untestable_reason), 1):
        refitted = "" if one.refitted_drop is None else f"{one.refitted_drop:.0f}"
        lines.append(f"| {rank} | {escaped(words.effect_title(one.name))} | {one.predicted_drop:.0f} | {refitted} |")
    if hidden:
        lines += ["", "## Not to be seen in these recordings", ""]
        lines += [f"- {escaped(words.effect_title(one.name))}: {escaped(one.untestable_reason)}" for one in hidden]
    return "\n".join(lines)


def configuration(
    found: Discovery,
    runs: Sequence[Track],
    times: Sequence[Array],
    shifts: Sequence[float],
    settings: Mapping[str, Any],
) -> str:
    """What was fitted with which options, where each recording stands on sim_time, and the last calibration."""
    told = {"actuator": found.actuator.name, **settings}
    lines = ["# Discovery", "", "| setting | value |", "|---|---|"]
    lines += [f"| {escaped(k)} | {escaped(v)} |" for k, v in told.items() if v not in (None, [], "")]
    for i, (one, time, shift) in enumerate(zip(runs, times, shifts)):
        moved = f", moved by {shift:.4g} s" if shift else ""
        lines.append(f"| recording {i + 1} | {escaped(one.name)}: {time[0]:.4g} … {time[-1]:.4g} s{moved} |")
    fit = found.calibration
    state = "converged" if fit.converged else "not converged"
    lines += ["", f"# Calibration of the last model: {state}", ""]
    lines += ["| parameter | value | 90 % interval | unit | z [σ] |", "|---|---|---|---|---|"]
    for path, one in fit.parameters.items():
        low, high = one.interval90
        name = escaped(on_axes(path, found.actuator.axes).path)
        lines.append(f"| {name} | {one.value:.5g} | {low:.5g} … {high:.5g} | {one.unit} | {one.z:.2f} |")
    return "\n".join(lines) + "\n"
