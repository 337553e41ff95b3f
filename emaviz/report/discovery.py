"""The report of a discovery: its sections in reading order, and the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numba
import numpy as np

from ema_model.comparison.result import FREE_NOTE, free_simulation
from ema_model.discovery import Discovery, words
from ema_model.discovery.result import Added
from ema_model.discovery.words import (
    FLOOR_NOTE,
    Track,
    effect_title,
    fitted_of,
    headline,
    ladder,
    ladder_by_signal,
    next_experiment,
    per_recording,
    primary,
    sentences,
    tracks,
    value,
    verdict_name,
)
from ema_model.effects import Effect, find
from ema_model.effects.effect import FAMILIES
from ema_model.estimation.calibrate import calibration_table, convergence, warnings
from ema_model.quantities.numbers import number
from ema_model.quantities.titles import in_sentence
from ema_model.recordings import SIGNALS
from emaviz import __version__
from emaviz.figures import discovery
from emaviz.report.html_document import (
    Figures,
    Section,
    blocks,
    bullets,
    document_table,
    escape,
    folded,
    page,
    paragraph,
    table,
    with_remarks,
    write,
)
from emaviz.text.html import mathml
from emaviz.text.results import of_discovery


@dataclass(frozen=True, eq=False)
class Told:
    """A discovery with its recordings as lines over time, and how it was asked for."""

    found: Discovery
    tracks: Sequence[Track]
    configuration: Mapping[str, Any]

    @classmethod
    def of(cls, found: Discovery, configuration: Mapping[str, Any]) -> Told:
        """Puts the lines together once for all sections."""
        return cls(found, tracks(found), configuration)


# --- the verdict in plain words, first of all -------------------------------------------------------------------------


class Verdict(Section[Told]):
    """The headline, what follows from it, and what to be warned of."""

    title = "The verdict"
    anchor = "verdict"

    def body(self, subject: Told, figures: Figures) -> str:
        """Always there."""
        found = subject.found
        return (
            f'<p><span class="verdict {of_discovery(found)}">{escape(verdict_name(found))}</span></p>'
            + paragraph(headline(found), "answer")
            + "".join(paragraph(sentence) for sentence in sentences(found))
            + bullets(found.warnings, "warning")
        )


# --- the error after each step, fitted and held out, and by signal ----------------------------------------------------


class Ladder(Section[Told]):
    """Figure and table."""

    title = "The ladder"
    anchor = "ladder"

    def body(self, subject: Told, figures: Figures) -> str:
        """Always there."""
        found = subject.found
        return (
            figures.place(discovery.error_ladder(found), 360, "error-ladder")
            + with_remarks(ladder(found))
            + paragraph(FLOOR_NOTE, "small")
            + blocks(free_simulation(found.simulation, found.actuator.axes), FREE_NOTE)
            + document_table(ladder_by_signal(found), "Each signal")
            + document_table(per_recording(found), "Each recording")
        )


# --- each effect that was added: what it is, how large, how sure, and what else it could be ---------------------------


class AddedEffects(Section[Told]):
    """A card for each, in the order in which they were added; left out where none was."""

    title = "What was added"
    anchor = "added"

    def body(self, subject: Told, figures: Figures) -> str:
        """Equation, cause, parameters, errors before and after, rivals."""
        return "".join(_card(subject, i, one) for i, one in enumerate(subject.found.effects, 1))


def _card(told: Told, index: int, one: Added) -> str:
    effect = find(one.name)
    rivals = ", ".join(in_sentence(effect_title(name)) for name in one.same_as)
    return (
        f'<div class="region" id="effect-{index}"><h3>{index}. {escape(effect.title)}</h3>'
        + f'<p class="equation">{mathml(effect.equation, "inline")}</p>'
        + paragraph(effect.explanation)
        + _parameters(told, one)
        + paragraph(_fall(one))
        + (paragraph(f"Could as well be: {rivals}.", "warning") if rivals else "")
        + paragraph(_known(effect), "small")
        + "</div>"
    )


def _known(effect: Effect) -> str:
    facts = {
        "Belongs to": FAMILIES[effect.family],
        "Where it shows": effect.shows,
        "Mistaken for": effect.mistaken_for,
        "Source": effect.source,
    }
    return " ".join(f"{name}: {fact}." for name, fact in facts.items() if fact)


def _parameters(told: Told, one: Added) -> str:
    known = {parameter.name: parameter for parameter in find(one.name, told.found.actuator.axes).parameters}
    rows = []
    for name, setting in one.chosen.items():
        rows.append([known[name].meaning, known[name].shown, f"{setting:g} {known[name].unit}".strip() + " (chosen)"])
    for name in one.parameters:
        fitted = fitted_of(told.found, one, name)
        rows.append([known[name].meaning, known[name].shown, value(fitted)])
    return table(["Parameter", "name", "value ± 90 % interval"], rows, text_columns=2)


def _fall(one: Added) -> str:
    text = f"The error falls from {number(one.rmse_before)} to {number(one.rmse_after)} times the floor"
    if one.holdout_before is None or one.holdout_after is None:
        return f"{text}; nothing was held out."
    return f"{text}{words.on_unseen(one.holdout_before, one.holdout_after)}."


# --- what is missing and no effect of the library explains, as a curve ------------------------------------------------

_MISSING_NOTE = (
    "Measured − model: where the curve is positive, more is needed than the model says. Found on a part of the data, "
    "it told the rest ahead. It says what is missing, not why: add it to the model as a torque of your own, or look "
    "for a cause with this shape."
)


class Missing(Section[Told]):
    """Left out where nothing significant is left."""

    title = "What is missing and has no name"
    anchor = "missing"

    def body(self, subject: Told, figures: Figures) -> str:
        """The sentence and the curve."""
        unknown = subject.found.unknown
        if unknown is None:
            return ""
        figure = figures.place(discovery.missing_curve(subject.found), 340, "missing-curve")
        return paragraph(unknown.sentence) + figure + paragraph(_MISSING_NOTE, "small")


# --- parameters that are further from the actuator's file than its tolerance allows: not missing physics --------------

_OUTSIDE_TOLERANCE_NOTE = (
    "Nothing new has to act for these: a value of the actuator's file is wrong, or the part is another than the file "
    "says. Check the part, or the file."
)


class OutsideTolerance(Section[Told]):
    """Left out where all are inside."""

    title = "Parameters outside their tolerance"
    anchor = "outside"

    def body(self, subject: Told, figures: Figures) -> str:
        """A table of them."""
        found = subject.found
        if not found.parameters_outside_tolerance:
            return ""
        told = calibration_table(found.calibration, found.actuator.axes, found.parameters_outside_tolerance)
        return (with_remarks(told) if told is not None else "") + paragraph(_OUTSIDE_TOLERANCE_NOTE, "small")


# --- all candidates: what each alone would take away from the error, and what could not be seen at all ----------------

_CANDIDATES_NOTE = (
    "Effects of the library and faults of the actuator. Predicted: from what each would change, less what the "
    "calibrated parameters can do as well. The promising ones are fitted together with all parameters; that is the "
    "refitted fall. The ranking is of the first step."
)


class Candidates(Section[Told]):
    """Bars, and the numbers folded away."""

    title = "Candidates"
    anchor = "candidates"

    def body(self, subject: Told, figures: Figures) -> str:
        """Left out where none was scored."""
        found = subject.found
        if not found.candidates:
            return ""
        return (
            figures.place(discovery.candidates(found), discovery.height(found), "candidate-bars")
            + paragraph(_CANDIDATES_NOTE, "small")
            + document_table(words.candidates(found), "The ranking in numbers")
        )


# --- what to record next, where effects are left that these recordings cannot tell apart ------------------------------


class NextExperiment(Section[Told]):
    """Left out where nothing is left to tell apart."""

    title = "Next experiment"
    anchor = "next"

    def body(self, subject: Told, figures: Figures) -> str:
        """The command and what it would settle."""
        return "".join(paragraph(sentence) for sentence in next_experiment(subject.found))


# --- what is left of each recording over time, before and after -------------------------------------------------------

_RESIDUALS_NOTE = "Grey: what a perfect model would leave 95 of 100 times. Held-out recordings: see the error ladder."


class Residuals(Section[Told]):
    """The signal that tells most of each recording; the others folded away."""

    title = "Residuals before and after"
    anchor = "residuals"

    def body(self, subject: Told, figures: Figures) -> str:
        """Always there."""
        first = primary(subject.found)
        return paragraph(_RESIDUALS_NOTE, "small") + "".join(
            _one(track, i, first, figures) for i, track in enumerate(subject.tracks, 1)
        )


def _one(track: Track, index: int, first: str, figures: Figures) -> str:
    names = sorted(track.measured, key=lambda name: name != first)
    if not names:
        return ""
    parts = [f'<h3 id="recording-{index}">{index}. {escape(track.name or "recording")}</h3>']
    parts.append(figures.place(discovery.residual_steps(track, names[0]), 300))
    parts += [folded(SIGNALS[n].title, figures.place(discovery.residual_steps(track, n), 300)) for n in names[1:]]
    return "".join(parts)


# --- the parameters of the last model, its effects' included ----------------------------------------------------------


class Calibrated(Section[Told]):
    """Convergence, table, and which parameters trade against each other."""

    title = "Calibration of the last model"
    anchor = "calibration"

    def body(self, subject: Told, figures: Figures) -> str:
        """Always there."""
        fit, axes = subject.found.calibration, subject.found.actuator.axes
        told = calibration_table(fit, axes)
        return (
            paragraph(convergence(fit), "" if fit.converged else "bad")
            + (with_remarks(told) if told is not None else "")
            + bullets(warnings(fit, axes), "small")
        )


# --- with what the report was made, so that it can be made again ------------------------------------------------------

_METHOD = (
    "The model is calibrated within its tolerances. Every effect of the library is given a fingerprint: what it would "
    "change in the signals. The promising ones are fitted together with all parameters, and the best is added when "
    "the data pay for its parameters (BIC), on most stretches of time, by 1 % of the error or more, and on the "
    "recordings that were held out. That repeats until nothing more pays."
)


class HowMade(Section[Told]):
    """The method in short, versions and options."""

    title = "How it was made"
    anchor = "made"

    def body(self, subject: Told, figures: Figures) -> str:
        """Always there."""
        given = {name: value for name, value in subject.configuration.items() if value not in (None, [], "")}
        told = {
            "actuator": subject.found.actuator.name,
            **{name: ", ".join(map(str, v)) if isinstance(v, list) else v for name, v in given.items()},
            "emaviz": __version__,
            "numpy": np.__version__,
            "numba": numba.__version__,
        }
        rows = [[name.replace("_", " "), value] for name, value in told.items()]
        return paragraph(_METHOD) + table(["Setting", "value"], rows, text_columns=2)


# --- the report of a discovery, section by section --------------------------------------------------------------------

SECTIONS: tuple[Section[Told], ...] = (
    Verdict(),
    Ladder(),
    AddedEffects(),
    Missing(),
    OutsideTolerance(),
    Candidates(),
    NextExperiment(),
    Residuals(),
    Calibrated(),
    HowMade(),
)


def write_discovery_report(found: Discovery, path: str | Path, configuration: Mapping[str, Any] | None = None) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written.

    configuration: the options that it was made with.
    """
    told = Told.of(found, configuration or {})
    names = ", ".join(track.name or "recording" for track in told.tracks)
    title = "The model is adequate" if found.verdict == "adequate" else "What the model lacks"
    if found.verdict == "adequate" and not found.is_within_band:
        title = "The model leaves a little more than noise"
    write(path, page(title, f"{found.actuator.name} against {names}", SECTIONS, told))
