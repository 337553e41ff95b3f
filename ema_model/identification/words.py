"""An identification in words and in JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, NotRequired, TypedDict

import numpy as np
from msgspec import Meta

from ema_model import faults
from ema_model.actuator import Actuator
from ema_model.actuator.actuator import between, readings, sentences
from ema_model.actuator.parameters import on_axes
from ema_model.estimation.calibrate import KnownTogether, combination_in_words, combinations
from ema_model.identification.run import Identification, Progress, algorithm_title
from ema_model.identification.search import Landscape, Way
from ema_model.quantities.numbers import IntervalJson, amount
from ema_model.quantities.titles import in_sentence
from ema_model.result import json_form, json_type
from ema_model.simulation.run import run_in_words
from ema_model.text import Document, Lines, Remark, Remarks, Table

# --- an identification in words: the faults, whether they are, how sure that is, and the cost around the answer -------

CORRECTED = (
    "Corrected error: rms of measured less model current, with what the simplified model is known to lack added."
)


def verdict(answer: Identification) -> str:
    """The short one: healthy, which k are not, or that nothing can be told."""
    sure = answer.uncertainty
    if sure.uninformative:
        return "uninformative: the recordings tell nothing of the faults"
    if not sure.adequate:
        return "the model does not fit: no fault can be told"
    return "healthy" if sure.healthy else f"not healthy: {', '.join(sure.alarms) or 'no single k stands out'}"


def in_one_line(answer: Identification) -> str:
    """The verdict with its values: 'Not healthy: backlash 703 ± 1.1 µrad.'"""
    phrases = between(answer.k, answer.uncertainty.interval90, answer.actuator)
    seen = [phrase for name, phrase in zip(faults.NAMES, phrases) if name in answer.uncertainty.alarms]
    said = f"not healthy: {', '.join(seen)}" if seen and answer.uncertainty.adequate else verdict(answer)
    return f"{said[:1].upper()}{said[1:]}."


def document_of(answer: Identification) -> Document:
    """All that the terminal and a notebook show."""
    ran = f"{'; '.join(facts(answer))} ({answer.algorithm}, compiled in {answer.compile_s:.1f} s)"
    return Document([_faults(answer), Remarks(remarks(answer)), Lines([ran])])


def _faults(answer: Identification) -> Table:
    sure, known = answer.uncertainty, answer.truth is not None
    rows, remarks = [], []
    for i, (name, phrase) in enumerate(zip(faults.NAMES, sentences(answer.k, answer.actuator))):
        low, high = sure.interval90[i]
        row = [name, f"{answer.k[i]:.4f}", f"{low:.4f} … {high:.4f}"]
        rows.append([*row, f"{answer.truth[i]:.3f}"] if answer.truth is not None else row)
        remarks.append(f"{phrase}{'  ← not healthy' if name in sure.alarms else ''}")
    return Table(("value", "90 % interval", *(["truth"] if known else [])), rows, remarks=remarks, unit="meaning")


def remarks(answer: Identification) -> list[Remark]:
    """Health first, then what these recordings leave open, and what would tell it."""
    sure = answer.uncertainty
    told = [_health(answer)]
    told += [Remark("caution", warning, "warning") for warning in sure.warnings]
    for group in sure.ambiguous:
        names = " and ".join(_named(name) for name in group)
        told.append(Remark("cannot be told apart", f"{names} do the same to this recording", "warning"))
    if sure.identifiable:
        products = "; ".join(combination_in_words(one, answer.actuator.axes) for one in sure.identifiable)
        told.append(Remark("known only together", f"{products}, if the model is right", "warning"))
    if sure.hardly_known:
        names = ", ".join(_named(name) for name in sure.hardly_known)
        line = f"this recording says hardly anything of {names}, and the other intervals rest on them"
        told.append(Remark("hardly known", line, "warning"))
    if run := sure.separated_by:
        asked = run_in_words(run.command, run.settings, run.duration_s)
        told.append(Remark("what would tell more", f"{asked} ({run.options})", "warning"))
    if not answer.polished:
        line = "those of a fit from here; the answer of the search alone may lie at their edge"
        told.append(Remark("the intervals", line))
    return told


def _health(answer: Identification) -> Remark:
    sure = answer.uncertainty
    if sure.uninformative:
        return Remark("uninformative", "the recordings tell nothing of the faults", "bad")
    if not sure.adequate:
        return Remark("the model does not fit", "no fault can be told", "bad")
    if sure.healthy:
        return Remark("healthy", "no k is surely off (joint test at 1 %)", "good")
    named = ", ".join(faults.BY_NAME[name].label for name in sure.alarms)
    return Remark("not healthy", named or "all k together, though no single one stands out", "bad")


def facts(answer: Identification) -> list[str]:
    """What it came to and took: error, simulations, time."""
    return [
        *(["stopped"] if answer.stopped else []),
        *([] if answer.error_percent is None else [f"Err {answer.error_percent:.2f} %"]),
        f"corrected error {amount(answer.corrected_rmse, 'A')}",
        f"{answer.evaluations} simulations in {answer.elapsed_s:.2f} s",
    ]


def why_best(best: Identification, others: Sequence[Identification]) -> str:
    """Why one answer of several to the same recording is the one to believe."""
    fitted = best.polished and not all(answer.polished for answer in others)
    how = "; its answer was fitted, the others are where their searches ended" if fitted else ""
    return f"it has the least corrected error{how}. {CORRECTED}"


def _named(name: str) -> str:
    return f"{name} ({in_sentence(faults.BY_NAME[name].title)})"


def landscape_words(found: Landscape) -> str:
    """How far a landscape was drawn, what was held, and from where to where the error goes."""
    stopped = "" if found.share == 1.0 else f"Stopped at {100.0 * found.share:.0f} %. "
    others = [i for i in range(len(faults.NAMES)) if i not in (found.x, found.y)]
    held = ", ".join(f"{faults.NAMES[i]} {found.through[i]:.3f}" for i in others)
    known = found.error_A[np.isfinite(found.error_A)]
    reach = f" Corrected error from {amount(known.min(), 'A')} to {amount(known.max(), 'A')}." if len(known) else ""
    return f"{stopped}Held: {held}.{reach}"


def way_sentences(found: Mapping[str, Way], fitted: str = "") -> Sequence[str]:
    """What became of each search, in words; fitted: the one from whose end a fit went on to the answer."""
    said = []
    for name, way in found.items():
        title = algorithm_title(name)
        end, answer, highest = (amount(error, "A") for error in (way.error_A, way.answer_A, way.highest_A))
        if name == fitted:
            said.append(f"{title} has the answer: a fit went on to it ({answer}) from where its search ended ({end}).")
        elif way.is_trap:
            said.append(
                f"{title} ended in a local minimum: its error is {end} there, and on the straight line to the answer "
                f"({answer}) it rises to {highest} first."
            )
        elif way.is_worse:
            said.append(
                f"{title} had not converged: from its end ({end}) the error falls steadily to the answer ({answer})."
            )
        else:
            said.append(f"{title} ended at the answer: {end}.")
    return said


# --- the JSON form of an identification: what each field means, and where it is from ----------------------------------


if TYPE_CHECKING:
    CombinationJson = dict[str, Any]
else:
    CombinationJson = json_type(KnownTogether)


class HistoryJson(TypedDict):
    """The search, iteration by iteration; the first is the first random population."""

    rmse: Annotated[list[float], Meta(description="A, of the best so far")]
    k: Annotated[list[list[float]], Meta(description="(8,) each, the best so far")]


class IdentificationJson(TypedDict):
    """The faults k1 … k8 of an actuator, each 0 … 1."""

    k: Annotated[list[float], Meta(description="k1 … k8")]
    k_interval90: Annotated[list[IntervalJson], Meta(description="the ends of the 90 % interval of each k")]
    healthy: Annotated[bool, Meta(description="joint test of all k at 1 %")]
    alarms: Annotated[list[str], Meta(description="names of the k that are surely not healthy")]
    ambiguous: Annotated[list[list[str]], Meta(description="groups of k that the recordings cannot separate")]
    hardly_known: Annotated[list[str], Meta(description="k that could be nearly anything")]
    identifiable: Annotated[
        list[CombinationJson],
        Meta(description="what the recordings tell only together; of a k what it multiplies, as 1 + 2 k1 or 1 − k3"),
    ]
    separated_by: Annotated[str, Meta(description="the run that would tell them, as options of `emaviz simulate`")]
    uninformative: Annotated[bool, Meta(description="whether the recordings tell nothing, whatever the model")]
    adequate: Annotated[bool, Meta(description="whether the model with this k leaves no more than the floor")]
    warnings: Annotated[list[str], Meta(description="what the answer must be read with")]
    physical: Annotated[dict[str, float], Meta(description="what k means in this actuator, units in the names")]
    rmse: Annotated[float, Meta(description="A, of the current, at k and the file's other parameters")]
    corrected_rmse: Annotated[float | None, Meta(description="A, the same where a fit freed the model of its bias")]
    evaluations: Annotated[int, Meta(description="how many times the recordings were simulated")]
    elapsed_s: Annotated[float, Meta(description="s, without compilation")]
    compile_s: Annotated[float, Meta(description="s, of compilation")]
    algorithm: Annotated[str, Meta(description="robust, ssa, hba or do")]
    polished: Annotated[bool, Meta(description="whether a least-squares fit followed the search")]
    searched_k: Annotated[list[float] | None, Meta(description="k1 … k8, where the search alone ended")]
    parameters: Annotated[dict[str, float], Meta(description="section.name, where the fit moved them beside k")]
    holdout_rmse: Annotated[float | None, Meta(description="A, of what was not fitted; null: nothing, or it diverges")]
    history: Annotated[HistoryJson, Meta(description="of the search")]
    truth: NotRequired[Annotated[list[float], Meta(description="k1 … k8, where they are known")]]
    error_percent: NotRequired[Annotated[float | None, Meta(description="Err % (T 5.2), where the truth is known")]]


class IdentifiedSoFarJson(TypedDict):
    """The best of a search that was interrupted, which no fit has refined."""

    interrupted: Annotated[bool, Meta(description="true")]
    iteration: Annotated[int, Meta(description="the last one of the search")]
    iterations: Annotated[int, Meta(description="how many there would have been")]
    k: Annotated[list[float], Meta(description="k1 … k8, 0 … 1, the best so far")]
    k_interval90: Annotated[None, Meta(description="null: none is known yet")]
    physical: Annotated[dict[str, float], Meta(description="what k means in this actuator, units in the names")]
    rmse: Annotated[float, Meta(description="A, of the current, at k and the file's other parameters")]
    evaluations: Annotated[int, Meta(description="how many times the recordings were simulated")]
    elapsed_s: Annotated[float, Meta(description="s, without compilation")]
    algorithm: Annotated[str, Meta(description="robust, ssa, hba or do")]
    history: Annotated[HistoryJson, Meta(description="of the search")]


def as_dict(answer: Identification, actuator: Actuator, holdout_rmse: float | None = None) -> IdentificationJson:
    """Plain values only; holdout_rmse: A, of the recordings that were not fitted."""
    sure = answer.uncertainty
    document: IdentificationJson = {
        "k": answer.k.tolist(),
        "k_interval90": sure.interval90.tolist(),
        "healthy": bool(sure.healthy),
        "alarms": list(sure.alarms),
        "ambiguous": [list(group) for group in sure.ambiguous],
        "hardly_known": list(sure.hardly_known),
        "identifiable": json_form(
            combinations(sure.identifiable, actuator.axes), lambda name: on_axes(name, actuator.axes).path
        ),
        "separated_by": sure.separated_by.options if sure.separated_by else "",
        "uninformative": bool(sure.uninformative),
        "adequate": bool(sure.adequate),
        "warnings": list(sure.warnings),
        "physical": readings(answer.k, actuator),
        "rmse": answer.rmse,
        "corrected_rmse": answer.corrected_rmse if math.isfinite(answer.corrected_rmse) else None,
        "evaluations": answer.evaluations,
        "elapsed_s": answer.elapsed_s,
        "compile_s": answer.compile_s,
        "algorithm": answer.algorithm,
        "polished": answer.polished,
        "searched_k": None if answer.searched_k is None else answer.searched_k.tolist(),
        "parameters": {on_axes(path, actuator.axes).path: value for path, value in answer.parameters.items()},
        "holdout_rmse": holdout_rmse,
        "history": {"rmse": answer.rmse_history.tolist(), "k": answer.k_history.tolist()},
    }
    if answer.truth is not None:
        document["truth"] = np.asarray(answer.truth).tolist()
        document["error_percent"] = answer.error_percent
    return document


def so_far_as_dict(history: Sequence[Progress], actuator: Actuator) -> IdentifiedSoFarJson:
    """Plain values only; history: of a search that was interrupted, an entry or more."""
    last = history[-1]
    return {
        "interrupted": True,
        "iteration": last.iteration,
        "iterations": last.iterations,
        "k": last.k.tolist(),
        "k_interval90": None,
        "physical": readings(last.k, actuator),
        "rmse": last.rmse,
        "evaluations": last.evaluations,
        "elapsed_s": last.elapsed_s,
        "algorithm": last.algorithm,
        "history": {"rmse": [at.rmse for at in history], "k": [at.k.tolist() for at in history]},
    }
