"""Each effect that was added: what it is, how large, how sure, and what else it could be."""

from __future__ import annotations

from ema_model.discovery.result import Added
from ema_model.discovery.shown.labels import effect_title, fitted_of
from ema_model.effects import Effect, find
from ema_model.effects.effect import FAMILIES
from ema_model.quantities.numbers import number
from ema_model.quantities.titles import in_sentence
from emaviz.report.discovery.subject import Told
from emaviz.report.markup import escape, paragraph, table
from emaviz.report.section import Figures, Section
from emaviz.text.mathml import mathml


class AddedEffects(Section[Told]):
    """A card for each, in the order in which they were added; left out where none was."""

    title = "What was added"
    anchor = "added"
    place = 30

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
        rows.append([known[name].meaning, known[name].shown, f"{setting:g}", "chosen", known[name].unit or "–"])
    for name in one.parameters:
        fitted = fitted_of(told.found, one, name)
        low, high = (number(edge) for edge in fitted.interval90)
        value = number(fitted.value)
        rows.append([known[name].meaning, known[name].shown, value, f"{low} … {high}", fitted.unit or "–"])
    return table(["Parameter", "name", "value", "90 % interval", "unit"], rows, text_columns=2)


def _fall(one: Added) -> str:
    text = f"The error falls from {number(one.rmse_before)} to {number(one.rmse_after)} times the floor"
    if one.holdout_before is None or one.holdout_after is None:
        return f"{text}; nothing was held out."
    return f"{text}, and on what was not fitted from {number(one.holdout_before)} to {number(one.holdout_after)}."
