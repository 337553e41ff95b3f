"""What nobody honest sends costs one line on stderr, and a flood of it a few lines a minute."""

from __future__ import annotations

import logging
import sys
import threading
import time

from ema_model.files.opened import shown

_LINES = 10  # of one period; what comes beyond is counted
_PERIOD_S = 60.0
_LENGTH = 300  # characters


class Complaints(logging.Handler):
    """Says a line on stderr, as a function and as the handler of a library's log."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._counting = threading.Lock()
        self._began, self._said, self._unsaid = 0.0, 0, 0

    def __call__(self, text: object) -> None:
        """One line, whatever `text` holds; nothing when this period's lines are used up."""
        with self._counting:
            now = time.monotonic()
            if now - self._began > _PERIOD_S:
                self._began, self._said = now, 0
            if self._said == _LINES:
                self._unsaid += 1
                return
            self._said += 1
            more, self._unsaid = self._unsaid, 0
        tail = f" (and {more} more before it)" if more else ""
        print(f"emaviz: {shown(text, _LENGTH)}{tail}", file=sys.stderr, flush=True)

    def emit(self, record: logging.LogRecord) -> None:
        """A record without its traceback."""
        error = record.exc_info[1] if record.exc_info else None
        if isinstance(error, RuntimeError) and "after shutdown" in str(error):
            return  # a browser that was still there when the app ended
        self(record.getMessage() + (f": {error or type(error).__name__}" if error is not None else ""))

    def log(self) -> logging.Logger:
        """A log of its own, all of whose warnings and errors come here."""
        logger = logging.Logger("emaviz.server", logging.WARNING)
        logger.addHandler(self)
        return logger
