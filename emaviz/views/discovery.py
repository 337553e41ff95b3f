"""A discovery: the verdict, the ladder, what was added, what is left, and all that would tell more."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numpy.typing import ArrayLike

from ema_model.comparison.result import free_simulation
from ema_model.discovery import Discovery, words
from ema_model.discovery.result import Added, effect_title
from ema_model.discovery.words import FLOOR_NOTE, Track, fitted_of, primary, tracks
from ema_model.effects import Effect, find
from ema_model.effects.effect import FAMILIES
from ema_model.estimation.calibrate import calibration_table, convergence, warnings
from ema_model.quantities import in_sentence, number
from ema_model.recordings import SIGNALS
from ema_model.text import Table
from emaviz import __version__
from emaviz.figures import discovery
from emaviz.text.html import html, mathml
from emaviz.text.verdicts import of_discovery
from emaviz.views import Bullets, Columns, Group, Line, Markup, Piece, Row, Section, Verdict, View
from emaviz.views.comparison import of_free_simulation

# --- the verdict, and the error after each step, fitted and held out, and by signal -----------------------------------


def _verdict(found: Discovery) -> Iterator[Piece]:
    """The headline, what follows from it, and what to be warned of."""
    yield Verdict(words.verdict_name(found), of_discovery(found))
    yield Line(words.headline(found), "answer")
    yield from map(Line, words.sentences(found))
    yield Bullets(found.warnings, "warning")


def _ladder(found: Discovery) -> Iterator[Piece]:
    yield Row([discovery.error_ladder(found)], 360, ["error-ladder"])
    yield words.ladder(found)
    yield Line(FLOOR_NOTE, "small")
    yield from of_free_simulation(free_simulation(found.simulation, found.actuator.axes))
    yield from _folded("Each signal", words.ladder_by_signal(found))
    yield from _folded("Each recording", words.per_recording(found))


def _folded(title: str, told: Table | None) -> Iterator[Piece]:
    """A table that is seen after a click; nothing for none."""
    if told is not None:
        yield Group(f"{title} {told.unit}".rstrip(), [told], folded=True)


# --- each effect that was added: what it is, how large, how sure, and what else it could be ---------------------------


def _added(found: Discovery) -> Iterator[Piece]:
    """A card for each, in the order in which they were added: equation, cause, parameters, errors, rivals."""
    for i, one in enumerate(found.effects, 1):
        yield Group(f"{i}. {find(one.name).title}", [*_card(found, one)], f"effect-{i}", framed=True)


def _card(found: Discovery, one: Added) -> Iterator[Piece]:
    effect = find(one.name)
    yield Markup(html('<p class="equation">{}</p>', mathml(effect.equation, "inline")))
    yield Line(effect.explanation)
    yield _parameters(found, one)
    yield Line(_fall(one))
    if one.same_as:
        rivals = ", ".join(in_sentence(effect_title(name)) for name in one.same_as)
        yield Line(f"Could as well be: {rivals}.", "warning")
    yield Line(_known(effect), "small")


def _known(effect: Effect) -> str:
    facts = {
        "Belongs to": FAMILIES[effect.family],
        "Where it shows": effect.shows,
        "Mistaken for": effect.mistaken_for,
        "Source": effect.source,
    }
    return " ".join(f"{name}: {fact}." for name, fact in facts.items() if fact)


def _parameters(found: Discovery, one: Added) -> Columns:
    known = {parameter.name: parameter for parameter in find(one.name, found.actuator.axes).parameters}
    rows = []
    for name, setting in one.chosen.items():
        rows.append([known[name].meaning, known[name].shown, f"{setting:g} {known[name].unit}".strip() + " (chosen)"])
    for name in one.parameters:
        rows.append([known[name].meaning, known[name].shown, words.value(fitted_of(found, one, name))])
    return Columns(["Parameter", "name", "value ± 90 % interval"], rows)


def _fall(one: Added) -> str:
    text = f"The error falls from {number(one.rmse_before)} to {number(one.rmse_after)} times the floor"
    if one.holdout_before is None or one.holdout_after is None:
        return f"{text}; nothing was held out."
    return f"{text}{words.on_unseen(one.holdout_before, one.holdout_after)}."


# --- what no effect of the library explains, and parameters that are further from the file than its tolerance allows --

_MISSING_NOTE = (
    "Measured − model: where the curve is positive, more is needed than the model says. Found on a part of the data, "
    "it told the rest ahead. It says what is missing, not why: add it to the model as a torque of your own, or look "
    "for a cause with this shape."
)
_OUTSIDE_TOLERANCE_NOTE = (
    "Nothing new has to act for these: a value of the actuator's file is wrong, or the part is another than the file "
    "says. Check the part, or the file."
)


def _missing(found: Discovery) -> Iterator[Piece]:
    """The sentence and the curve; left out where nothing significant is left."""
    if found.unknown is not None:
        yield Line(found.unknown.sentence)
        yield Row([discovery.missing_curve(found)], 340, ["missing-curve"])
        yield Line(_MISSING_NOTE, "small")


def _outside(found: Discovery) -> Iterator[Piece]:
    """A table of them; left out where all are inside."""
    if not found.parameters_outside_tolerance:
        return
    told = calibration_table(found.calibration, found.actuator.axes, found.parameters_outside_tolerance)
    if told is not None:
        yield told
    yield Line(_OUTSIDE_TOLERANCE_NOTE, "small")


# --- all candidates: what each alone would take away from the error; and what to record next --------------------------

_CANDIDATES_NOTE = (
    "Effects of the library and faults of the actuator. Predicted: from what each would change, less what the "
    "calibrated parameters can do as well. The promising ones are fitted together with all parameters; that is the "
    "refitted fall. The ranking is of the first step."
)


def _candidates(found: Discovery) -> Iterator[Piece]:
    """Bars, and the numbers folded away; left out where none was scored."""
    if found.candidates:
        yield Row([discovery.candidates(found)], discovery.height(found), ["candidate-bars"])
        yield Line(_CANDIDATES_NOTE, "small")
        yield from _folded("The ranking in numbers", words.candidates(found))


def _next(found: Discovery) -> Iterator[Piece]:
    """The command and what it would settle; left out where nothing is left to tell apart."""
    yield from map(Line, words.next_experiment(found))


# --- what is left of each recording over time, before and after; the parameters of the last model ---------------------

_RESIDUALS_NOTE = "Grey: what a perfect model would leave 95 of 100 times. Held-out recordings: see the error ladder."


def _residuals(found: Discovery) -> Iterator[Piece]:
    """The signal that tells most of each recording; the others folded away."""
    first = primary(found)
    yield Line(_RESIDUALS_NOTE, "small")
    for i, track in enumerate(tracks(found), 1):
        names = sorted(track.measured, key=lambda name: name != first)
        if names:
            pieces: list[Piece] = [_left(track, names[0])]
            pieces += [Group(SIGNALS[name].title, [_left(track, name)], folded=True) for name in names[1:]]
            yield Group(f"{i}. {track.name or 'recording'}", pieces, f"recording-{i}")


def _left(track: Track, name: str) -> Row:
    return Row([discovery.residual_steps(track, name)], 300)


def _calibration(found: Discovery) -> Iterator[Piece]:
    """Convergence, table, and which parameters trade against each other, the effects' included."""
    fit, axes = found.calibration, found.actuator.axes
    yield Line(convergence(fit), "" if fit.converged else "bad")
    if (told := calibration_table(fit, axes)) is not None:
        yield told
    yield Bullets(warnings(fit, axes), "small")


# --- with what it was made, so that it can be made again --------------------------------------------------------------

_METHOD = (
    "The model is calibrated within its tolerances. Every effect of the library is given a fingerprint: what it would "
    "change in the signals. The promising ones are fitted together with all parameters, and the best is added when "
    "the data pay for its parameters (BIC), on most stretches of time, by 1 % of the error or more, and on the "
    "recordings that were held out. That repeats until nothing more pays."
)


def _made(found: Discovery, configuration: Mapping[str, Any]) -> Iterator[Piece]:
    """The method in short, versions and options."""
    given = {name: value for name, value in configuration.items() if value not in (None, [], "")}
    told = {
        "actuator": found.actuator.name,
        **{name: ", ".join(map(str, v)) if isinstance(v, list) else v for name, v in given.items()},
        "emaviz": __version__,
        "numpy": np.__version__,
        "numba": numba.__version__,
    }
    yield Line(_METHOD)
    yield Columns(["Setting", "value"], [[name.replace("_", " "), value] for name, value in told.items()])


# --- the whole, in reading order --------------------------------------------------------------------------------------


def _record(found: Discovery, path: Path, configuration: Mapping[str, Any]) -> None:
    """The signals, the ladder, the candidates, and what each step leaves."""
    from emaviz.recording.discovery import write_discovery  # rerun takes a second to import

    write_discovery(found, path, configuration)


def _title(found: Discovery) -> str:
    if found.verdict != "adequate":
        return "What the model lacks"
    return "The model is adequate" if found.is_within_band else "The model leaves a little more than noise"


def _lead(found: Discovery) -> str:
    return f"{found.actuator.name} against {', '.join(track.name or 'recording' for track in tracks(found))}"


def _table(found: Discovery) -> Mapping[str, ArrayLike]:
    """A row for each step of the ladder; errors in floors."""
    steps = found.steps
    held = [np.nan if one.holdout_rmse is None else one.holdout_rmse for one in steps]
    fitted = [np.nan if one.rmse is None else one.rmse for one in steps]
    return {"step": np.array([one.label for one in steps]), "rmse": fitted, "holdout_rmse": held}


VIEW = View(
    of=Discovery,
    name="discovery",
    title=_title,
    lead=_lead,
    sections=(
        Section("The verdict", "verdict", of=_verdict),
        Section("The ladder", "ladder", of=_ladder),
        Section("What was added", "added", of=_added),
        Section("What is missing and has no name", "missing", of=_missing),
        Section("Parameters outside their tolerance", "outside", of=_outside),
        Section("Candidates", "candidates", of=_candidates),
        Section("Next experiment", "next", of=_next),
        Section("Residuals before and after", "residuals", of=_residuals),
        Section("Calibration of the last model", "calibration", of=_calibration),
    ),
    meaning=of_discovery,
    columns=_table,
    record=_record,
    made=_made,
)
