"""Challenges of one kind in the data folder: those that can be made there, and the one that a folder holds."""

from __future__ import annotations

from ema_model.challenges import Challenge
from ema_model.errors import InputError
from ema_model.practice import challenge_in, make, reveal, shipped
from ema_model.practice.kinds.kind import Revealed
from ema_model.text import InWords
from emaviz.session.data_folder import DataFolder
from emaviz.session.job import Job, Run
from emaviz.session.signal import Signal


class Practice:
    """made: called with the folder's name once a challenge's recordings are there, by the thread that works."""

    def __init__(self, job: Job, folder: DataFolder, kind: str) -> None:
        """job: of what the recordings are for."""
        self._job, self._folder = job, folder
        self.shipped = shipped(kind)
        self.made: Signal[[str]] = Signal()

    def open(self, one: Challenge) -> bool:
        """Makes its recordings soon, unless they are there; False while another long run goes on."""
        where = self._folder.folder / one.name
        if self.held(one.name) == one:
            self.made(one.name)
            return True

        def work(run: Run) -> None:
            make(one, where, run)

        def done() -> str:
            self.made(one.name)
            return f"{one.title}: its recordings are in the data folder, {one.name}."

        return self._job.begin("Making the recordings", work, done)

    def held(self, name: str) -> Challenge | None:
        """The challenge that a folder of the data folder holds, by its name."""
        try:
            return challenge_in(self._folder.inner(name))
        except InputError:
            return None

    def reveal(self, name: str, found: InWords | None) -> Revealed:
        """The answer of the challenge in a folder; InputError where there is none."""
        one = self.held(name)
        if one is None:
            raise InputError("this folder is of no challenge, so that nothing is sealed in it")
        return reveal(one, found)
