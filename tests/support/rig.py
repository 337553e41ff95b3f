"""An app without a screen, for tests of what Discover does and keeps."""

from __future__ import annotations

from ema_model.actuator import load_actuator
from emaviz.session import session_file
from emaviz.session.compare import Comparing
from emaviz.session.data_folder import DataFolder
from emaviz.session.discover import Discovering
from emaviz.session.explore import Session
from emaviz.session.session_file import Part
from support.on_page import wait_until


class Rig:
    """An app without a screen."""

    def __init__(self, folder):
        self.folder = DataFolder(folder)
        self.session = Session(load_actuator(), self.folder.recordings)
        self.comparing = Comparing(self.session, self.folder)
        self.discovering = Discovering(self.session, self.comparing)
        self.part = Part(self.discovering.saved, self.discovering.restore, self.discovering.files)
        self.told, self.ended = [], []
        self.session.events.told.connect(lambda *line: self.told.append(line))
        self.discovering.job.ended.connect(self.ended.append)

    def close(self):
        self.discovering.close()
        self.comparing.close()
        self.session.close()

    def done(self, seconds=240.0):
        wait_until(lambda: self.ended, seconds)
        self.ended.clear()
        wait_until(lambda: not self.discovering.running)

    def save(self):
        path = session_file.free_path(self.folder, "kept")
        session_file.write_session(path, {"discovery": self.part}, self.folder, self.part.files())
        return path

    def load(self, path):
        session_file.read_session(path, {"discovery": self.part}, self.folder)
