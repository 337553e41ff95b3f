"""An identification in words: the faults, whether they are, how sure that is, and the cost around the answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ema_model import faults
from ema_model.actuator.readings import sentences
from ema_model.identification.landscape import Landscape, Way
from ema_model.identification.run import ALGORITHMS, Identification
from ema_model.quantities.numbers import amount
from ema_model.text import Document, Lines, Table


def verdict(answer: Identification) -> str:
    """The short one: healthy, which k are not, or that nothing can be told."""
    sure = answer.uncertainty
    if not sure.adequate:
        return "the model does not fit: no fault can be told"
    return "healthy" if sure.healthy else f"not healthy: {', '.join(sure.alarms) or 'no single k stands out'}"


def document_of(answer: Identification) -> Document:
    """All that the terminal and a notebook show."""
    return Document([_faults(answer), Lines(_told(answer))])


def _faults(answer: Identification) -> Table:
    sure, known = answer.uncertainty, answer.truth is not None
    rows, remarks = [], []
    for i, (name, phrase) in enumerate(zip(faults.NAMES, sentences(answer.k, answer.actuator))):
        low, high = sure.interval90[i]
        row = [name, f"{answer.k[i]:.4f}", f"{low:.4f} … {high:.4f}"]
        rows.append([*row, f"{answer.truth[i]:.3f}"] if answer.truth is not None else row)
        remarks.append(f"{phrase}{'  ← not healthy' if name in sure.alarms else ''}")
    return Table(("value", "90 % interval", *(["truth"] if known else [])), rows, remarks=remarks, unit="meaning")


def _told(answer: Identification) -> list[str]:
    sure = answer.uncertainty
    lines = [verdict(answer)]
    if sure.ambiguous:
        lines.append("cannot be told apart here: " + "; ".join(" / ".join(group) for group in sure.ambiguous))
    if sure.hardly_known:
        lines.append(f"hardly known: {', '.join(sure.hardly_known)}; the other intervals rest on them")
    if sure.separated_by:
        lines.append(f"would tell more: {sure.separated_by.options}")
    lines += sure.warnings
    error = "" if answer.truth is None else f", Err {answer.error_percent:.2f} %"
    lines.append(
        f"rmse {amount(answer.rmse, 'A')}{error}; {answer.evaluations} simulations in {answer.elapsed_s:.2f} s "
        f"({answer.algorithm}), compiled in {answer.compile_s:.1f} s"
    )
    return lines


def landscape_words(found: Landscape) -> str:
    """How far a landscape was drawn, what was held, and from where to where the error goes."""
    stopped = "" if found.share == 1.0 else f"Stopped at {100.0 * found.share:.0f} %. "
    others = [i for i in range(len(faults.NAMES)) if i not in (found.x, found.y)]
    held = ", ".join(f"{faults.NAMES[i]} {found.through[i]:.3f}" for i in others)
    known = found.rmse_A[np.isfinite(found.rmse_A)]
    reach = f" From {amount(known.min(), 'A')} to {amount(known.max(), 'A')}." if len(known) else ""
    return f"{stopped}Held: {held}.{reach}"


def way_sentences(found: Mapping[str, Way]) -> Sequence[str]:
    """What became of each search that is not the answer, in words."""
    said = []
    for name, way in found.items():
        title = ALGORITHMS.get(name, name)
        end, answer, highest = (amount(rmse, "A") for rmse in (way.rmse_A, way.answer_A, way.highest_A))
        if way.is_trap:
            said.append(
                f"{title} ended in a trap: its rmse is {end} there, and on the straight way to the answer ({answer}) "
                f"it rises to {highest} first."
            )
        elif way.is_worse:
            said.append(
                f"{title} had not settled: from its end ({end}) the error falls all the way to the answer ({answer})."
            )
        else:
            said.append(f"{title} ended at the answer: {end}.")
    return said
