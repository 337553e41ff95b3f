"""Formats of recordings that rerun reads, which the science must not know: a file each.

They join the family of `ema_model.recordings.formats` when this is imported, as the command line and the session do,
and do their work in the process that reads logs, so that rerun is loaded there alone.
"""

from __future__ import annotations

from ema_model.members import members
from ema_model.recordings.formats import add_format

for _format in members(__name__, "FORMAT").values():
    add_format(_format)
