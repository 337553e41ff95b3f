"""An identification in words: the faults, whether they are, and how sure that is."""

from __future__ import annotations

from ema_model import faults
from ema_model.actuator.readings import sentences
from ema_model.identification.run import Identification
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
