"""An identification in words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ema_model import faults
from ema_model.actuator.actuator import between, sentences
from ema_model.estimation.calibrate import combination_in_words
from ema_model.identification.run import Identification, IdentifiedSoFar, algorithm_title
from ema_model.identification.search import Landscape, Way
from ema_model.quantities import amount, in_sentence
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


def document_of(answer: Identification | IdentifiedSoFar) -> Document:
    """All that the terminal and a notebook show."""
    if isinstance(answer, IdentifiedSoFar):
        return Document([Lines([*_so_far(answer)])])
    ran = f"{'; '.join(facts(answer))} ({answer.algorithm}, compiled in {answer.compile_s:.1f} s)"
    return Document([_faults(answer), Remarks(remarks(answer)), Lines([ran, *_of_unseen(answer)])])


def _of_unseen(answer: Identification) -> Iterator[str]:
    """How far the model is from what was not fitted."""
    if answer.held_out and not math.isfinite(answer.holdout_rmse):
        yield "the model diverges on what was not fitted"
    elif answer.held_out:
        beside = f"{amount(answer.rmse, 'A')} on what was"
        error = amount(answer.holdout_rmse, "A")
        yield f"uncorrected error {error} on what was not fitted, {beside}: {', '.join(answer.held_out)}"


def _so_far(answer: IdentifiedSoFar) -> Iterator[str]:
    last = answer.last
    where = f"at iteration {last.iteration} of {last.iterations} of {algorithm_title(last.algorithm)}"
    yield f"Interrupted {where}: the best k so far, which no fit has refined, without intervals."
    for name, value, phrase in zip(faults.NAMES, last.k, sentences(last.k, answer.actuator)):
        yield f"  {name}  {value:.4f}  {phrase}"
    yield f"uncorrected error {amount(last.rmse, 'A')}, {last.evaluations} simulations in {last.elapsed_s:.1f} s"


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
