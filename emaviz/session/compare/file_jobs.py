"""What is done with files on a thread of its own: a large one takes seconds, in which the other tabs shall answer."""

from __future__ import annotations

from collections.abc import Callable

from ema_model.errors import InputError
from emaviz.session.compare.events import LAY_OUT, MAP, OPEN, SAVE
from emaviz.session.data_folder import DataFolder
from emaviz.session.signal import Signal
from emaviz.session.worker import Worker, report

_CANNOT = {
    OPEN: "The file cannot be read",
    MAP: "These columns cannot be used",
    LAY_OUT: "The text cannot be read like this",
    SAVE: "It cannot be saved",
}


class FileJobs:
    """One after another; what is wrong is told where it was asked for, and to all."""

    def __init__(self, folder: DataFolder, failed: Signal[[str, str, str]], told: Signal[[str, str]]) -> None:
        """failed(what, name, why): "" once it is done; told(title, line): to all."""
        self._folder, self._failed, self._told = folder, failed, told
        self._worker = Worker("emaviz-files", self.on_error)

    def close(self) -> None:
        """Ends the thread."""
        self._worker.close()

    def post(self, what: str, name: str, job: Callable[[], object], ended: Callable[[], object] = lambda: None) -> None:
        """Does one of `_CANNOT` with a file soon; the same of the same file that still waits is dropped."""

        def done() -> None:
            try:
                self._try(what, name, job)
            finally:
                ended()

        self._worker.post(f"{what} {name}", done)

    def on_error(self, error: BaseException) -> None:
        """Of a thread that goes on."""
        report(error, self._told, _CANNOT[SAVE])

    def _try(self, what: str, name: str, job: Callable[[], object]) -> None:
        try:
            job()
        except InputError as error:
            line = str(error).replace(f"{self._folder.folder}/", "")  # the page knows its files by their names there
            self._failed(what, name, line)
            self._told(_CANNOT[what], line)
            return
        self._failed(what, name, "")
