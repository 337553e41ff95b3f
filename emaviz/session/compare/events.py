"""What the screen listens to of Compare."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from ema_model.comparison.result import Comparison
from emaviz.session.opened import Opened
from emaviz.session.signal import Signal

OPEN, MAP, LAY_OUT, SAVE = "open", "map", "lay out", "save"  # what is done with files


@dataclass
class CompareEvents:
    """What the screen listens to, besides the job; called on the threads that work, so listeners only hand over."""

    opened: Signal[[Opened]] = field(default_factory=Signal)  # also when mapped or laid out anew
    refused: Signal[[]] = field(default_factory=Signal)  # a layout that does not fit: all is as it was
    failed: Signal[[str, str, str]] = field(default_factory=Signal)  # which of those above, name, why; "": done
    removed: Signal[[]] = field(default_factory=Signal)
    missing: Signal[[str, bool]] = field(default_factory=Signal)  # for a comparison, "": it began; asked for by hand
    compared: Signal[[Comparison]] = field(default_factory=Signal)
    kept: Signal[[Path]] = field(default_factory=Signal)  # a report or a recording is written
