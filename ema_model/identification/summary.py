"""The JSON form of an identification: what each field means, and where it is from."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, NotRequired, TypedDict

import numpy as np
from msgspec import Meta

from ema_model.actuator import Actuator
from ema_model.actuator.naming import on_axes
from ema_model.actuator.readings import readings
from ema_model.identification.run import Identification, Progress
from ema_model.quantities.numbers import IntervalJson


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
