"""What a frequency response says: resonance, antiresonance and delay of both sides, and where these differ."""

from __future__ import annotations

from ema_model.analyses.frequency import Apart, Estimate, FrequencyResponse, Mode, Response
from ema_model.quantities import SIGNALS, amount, in_sentence, number, with_uncertainty
from ema_model.text import Document, Lines, Table

_MOST_BANDS = 3  # in which the magnitudes differ, that are told
_MOST_NAMES = 3  # of recordings
_NONE = "–"
_KINDS = ("resonance", "antiresonance")
SCATTER = "± is half of a 90 % interval, which follows from coherence and number of averages"


def document_of(result: FrequencyResponse) -> Document:
    """All that the terminal, the page and a notebook show in words."""
    measured = result.measured
    if measured is None:
        return Document([Lines([f"{headline(result)}: {result.reason}", _channel(result)])])
    said = [*_sentences(result, measured), *map(_apart, result.differs[:_MOST_BANDS])]
    table = _table(result, measured)
    return Document([Lines(said), *([table] if table else []), Lines([_basis(result), SCATTER])])


def headline(result: FrequencyResponse) -> str:
    """The short answer."""
    if result.measured is None:
        return "No frequency response is told"
    if result.model is None:
        return "The model's own input excites too few frequencies to stand beside what was measured"
    if apart := _told_apart(result.measured, result.model, result.sample_s):
        return apart[0]
    if result.differs:
        return "The model answers otherwise than was measured"
    return "The model answers as was measured, within the scatter"


def agrees(result: FrequencyResponse) -> bool | None:
    """Whether the model answers as was measured, within the scatter; None where that is not known."""
    if result.measured is None or result.model is None:
        return None
    return not (result.differs or _told_apart(result.measured, result.model, result.sample_s))


def channel_title(result: FrequencyResponse) -> str:
    """'command → user position'."""
    return " → ".join(in_sentence(SIGNALS[name].title) for name in (result.input, result.output))


def magnitude_unit(result: FrequencyResponse) -> str:
    """'rad per A', what a magnitude is measured in; '1' of signals in one unit."""
    above, below = SIGNALS[result.output].unit, SIGNALS[result.input].unit or "1"
    return "1" if above == below else f"{above} per {below}"


def _sentences(result: FrequencyResponse, measured: Response) -> list[str]:
    """The headline first, and what both sides show beyond it."""
    first, model = headline(result), result.model
    if model is None:
        modes = (("resonance", measured.resonance), ("antiresonance", measured.antiresonance))
        alone = [f"The measured {kind} lies at {_hertz(mode)}" for kind, mode in modes if mode is not None]
        return [first, *alone]
    alike = [line for kind in _KINDS if (line := _mode(kind, measured, model))]
    others = [*_told_apart(measured, model, result.sample_s), *alike, *_delay(measured, model, result.sample_s)]
    return [first, *(line for line in others if line != first)]


def _told_apart(measured: Response, model: Response, sample_s: float) -> list[str]:
    """A sentence for each resonance that one side has elsewhere or not at all, and for another delay."""
    modes = [line for kind in _KINDS if (line := _mode_apart(kind, measured, model))]
    ours, theirs = measured.delay_s, model.delay_s
    if ours is None or theirs is None or not ours.differs(theirs, least=sample_s):
        return modes
    return [*modes, f"The measured delay is {_seconds(ours)}, the model's {_seconds(theirs)}, by the phase's slope"]


def _mode_apart(kind: str, measured: Response, model: Response) -> str:
    """A sentence where one side has a resonance elsewhere, or has none; else ''."""
    ours, theirs = getattr(measured, kind), getattr(model, kind)
    if ours is None:
        return "" if theirs is None else f"The model has {_a(kind)} at {_hertz(theirs)}; none is measured in this band"
    if theirs is None:
        return f"The measured {kind} lies at {_hertz(ours)}; the model has none in this band"
    if not ours.frequency_Hz.differs(theirs.frequency_Hz):
        return ""
    return f"The measured {kind} lies at {_hertz(ours)}, the model's at {_hertz(theirs)}"


def _mode(kind: str, measured: Response, model: Response) -> str:
    """Of a resonance that both have: where it lies where that is alike, and how the damping is."""
    ours, theirs = getattr(measured, kind), getattr(model, kind)
    if ours is None or theirs is None:
        return ""
    where = "" if ours.frequency_Hz.differs(theirs.frequency_Hz) else f" at {_hertz(ours)}, as the model's"
    damping = f"its damping is {_plain(ours.damping)}, the model's {_plain(theirs.damping)}"
    apart = ": they differ beyond the scatter" if ours.damping.differs(theirs.damping) else ", alike within the scatter"
    return f"The measured {kind}{where and f' lies{where}'}{';' if where else ':'} {damping}{apart}"


def _delay(measured: Response, model: Response, sample_s: float) -> list[str]:
    """Where both delays are alike; nothing where a response is not that of a resonance and a delay."""
    ours, theirs = measured.delay_s, model.delay_s
    if ours is None or theirs is None or ours.differs(theirs, least=sample_s):
        return []
    less = f"apart by less than a sample of {amount(sample_s, 's')}"
    alike = less if ours.differs(theirs) else "alike within the scatter"
    return [f"The measured delay is {_seconds(ours)}, the model's {_seconds(theirs)}: {alike}"]


def _apart(one: Apart) -> str:
    side = "above" if one.most_dB > 0.0 else "below"
    size = number(abs(one.most_dB), 2)
    band = f"From {number(one.from_Hz)} to {number(one.to_Hz)} Hz"
    return f"{band} the measured magnitude lies {side} the model's, by {size} dB at {number(one.at_Hz)} Hz"


def _table(result: FrequencyResponse, measured: Response) -> Table | None:
    sides = (measured, result.model)
    rows = []
    for kind in _KINDS:
        modes = [None if side is None else getattr(side, kind) for side in sides]
        rows.append([f"{kind} [Hz]", *(_NONE if one is None else _plain(one.frequency_Hz) for one in modes)])
        rows.append([f"{kind}'s damping", *(_NONE if one is None else _plain(one.damping) for one in modes)])
    delays = [None if side is None else side.delay_s for side in sides]
    rows.append(["delay [ms]", *(_NONE if one is None else _plain(_scaled(one, 1e3)) for one in delays)])
    known = [row for row in rows if set(row[1:]) != {_NONE}]
    return Table(("measured", "model"), known, channel_title(result)) if known else None


def _basis(result: FrequencyResponse) -> str:
    band = result.frequency_Hz[result.band]
    more = len(result.recordings) - _MOST_NAMES
    names = ", ".join(result.recordings[:_MOST_NAMES]) + (f" and {more} more" if more > 0 else "")
    return (
        f"{_channel(result)}, of {names}: {band.size} frequencies from {number(band[0])} to {number(band[-1])} Hz, in "
        f"pieces of {number(result.piece_s)} s, {number(result.averages, 2)} averages"
    )


def _channel(result: FrequencyResponse) -> str:
    put_in, answer = (in_sentence(SIGNALS[name].title) for name in (result.input, result.output))
    return f"From the {put_in} to the {answer}"


def _a(kind: str) -> str:
    return f"{'an' if kind[0] == 'a' else 'a'} {kind}"


def _hertz(mode: Mode) -> str:
    return with_uncertainty(mode.frequency_Hz.value, mode.frequency_Hz.half, "Hz")


def _seconds(one: Estimate) -> str:
    return with_uncertainty(one.value, one.half, "s")


def _plain(one: Estimate) -> str:
    return with_uncertainty(one.value, one.half, "")


def _scaled(one: Estimate, factor: float) -> Estimate:
    low, high = one.interval90
    return Estimate(factor * one.value, (factor * low, factor * high))
