"""One .rrd file while it is written: its stream, its lock, its failures and its end."""

from __future__ import annotations

import os
import threading
import uuid
from collections.abc import Callable
from pathlib import Path

import rerun as rr
import rerun_bindings
from rerun.error_utils import catch_and_log_exceptions

from emaviz.recording.entry import RecordingError, claim, free_bytes, part_of
from emaviz.recording.style import APPLICATION

# --- one .rrd file while it is written: its stream, its lock, its failures and its end --------------------------------

_FLUSH_TIMEOUT_S = 5.0


class RrdFile:
    """Grows as NAME.rrd.part, becomes NAME.rrd when closed; whatever had that name stays until then.

    `failed` is None, or one line that says why nothing more is written.
    """

    def __init__(self, path: Path, name: str, min_free_bytes: int) -> None:
        """Raises RecordingError if it cannot start."""
        self.path = path
        self.part = part_of(path)
        self.failed: str | None = None
        self.lock = threading.RLock()
        self._min_free_bytes = min_free_bytes
        self._closed = False
        self._sound = True  # whether what is in the part can be finished to a whole file
        self._owner = claim(path, min_free_bytes)
        try:
            self._stream = self._start(name)
        except Exception as error:
            self.part.unlink(missing_ok=True)
            self._owner.release()
            raise RecordingError(f"{path}: cannot be recorded: {_one_line(error)}") from error

    def _start(self, name: str) -> rr.RecordingStream:
        stream = rr.RecordingStream(APPLICATION, recording_id=str(uuid.uuid4()))
        # With its own two timelines off and no call to set_time, data has the times we give and no others.
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
        stream.save(self.part)
        if not self.part.exists():
            raise OSError("rerun is turned off; is RERUN=off set in the environment?")
        stream.send_recording_name(name)
        return stream

    @property
    def writing(self) -> bool:
        """Whether calls still have an effect."""
        return not self._closed and self.failed is None

    def do(self, action: Callable[[rr.RecordingStream], None]) -> None:
        """Runs what writes, one at a time; an error in it turns the file off instead of being raised."""
        with self.lock:
            if not self.writing:
                return
            try:
                with catch_and_log_exceptions(strict=True):  # without, rerun turns errors into warnings
                    action(self._stream)
            except Exception as error:
                self._sound = False
                self._fail(f"recording stopped: {_one_line(error)}")

    def flush(self) -> None:
        """To the disk, with all that was sent; stops in time, still whole, when the disk runs full."""
        self.do(self._flush)

    def _flush(self, stream: rr.RecordingStream) -> None:
        stream.flush(timeout_sec=_FLUSH_TIMEOUT_S)
        free = free_bytes(self.path.parent)
        if free < self._min_free_bytes // 10:
            self.failed = f"{self.path}: recording stopped: only {free / 1e6:.0f} MB free; free some space"

    def _fail(self, why: str) -> None:
        """The first failure is the one to tell."""
        self.failed = self.failed or f"{self.path}: {why}; what there is: {self.part.name}"

    def close(self, last: Callable[[], None], timeout_s: float) -> None:
        """Does `last`, then finishes the file.  Never raises, and returns within `timeout_s`, about.

        On a full disk rerun may wait for ever: then the part stays, locked until this process ends.
        """
        finisher = threading.Thread(target=self._finish, args=(last,), name="recording-close", daemon=True)
        finisher.start()
        finisher.join(timeout_s if self._sound else min(timeout_s, 2.0))
        if finisher.is_alive():
            self._fail(f"not finished within {timeout_s:g} s")
            rr.unregister_shutdown()  # it would wait as well, and the interpreter could not end

    def _finish(self, last: Callable[[], None]) -> None:
        with self.lock:
            if self._closed:
                return
            self.do(lambda _: last())
            self._closed = True
            try:
                self._stream.disconnect()
                if self._sound:
                    os.replace(self.part, self.path)
            except Exception as error:
                self._fail(f"not finished: {_one_line(error)}")
            del self._stream
            self._owner.release()
        # Each stream leaves two threads behind until this is called.
        rerun_bindings.flush_and_cleanup_orphaned_recordings()


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
