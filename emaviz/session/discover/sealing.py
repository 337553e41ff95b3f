"""Seals what Explore hides in its plant as a challenge for somebody else, on the compute thread."""

from __future__ import annotations

import secrets
from pathlib import Path

from ema_model.actuator import Actuator
from ema_model.actuator.readings import sentences
from ema_model.challenges.make import SENSORS
from ema_model.challenges.sealed_file import SUFFIX
from ema_model.challenges.sealing import seal
from ema_model.challenges.truth import Truth
from ema_model.effects import find
from ema_model.errors import InputError
from ema_model.faults import NAMES, named
from ema_model.quantities.titles import in_sentence
from ema_model.simulation.sensors import Sensors
from emaviz.session.data_folder import DataFolder, sanitised
from emaviz.session.job import Job, Tell
from emaviz.session.session import Session
from emaviz.session.settings import Settings
from emaviz.session.signal import Signal

_MOST_SEED = 1_000_000


class Sealing:
    """Takes the plant as the session's settings have it when it is asked."""

    def __init__(self, session: Session, folder: DataFolder) -> None:
        self.session, self.folder = session, folder
        self.job = Job(session.worker)
        self.sealed: Signal[[Path]] = Signal()  # a challenge is in the data folder

    def seal(self, title: str, story: str) -> bool:
        """Makes and writes the challenge soon; False, and nothing is begun, while another long run goes on.

        Raises InputError for a title or a story that is missing.
        """
        for what, text in (("title", title), ("story", story)):
            if not text.strip():
                raise InputError(f"the challenge has no {what} yet; write one")
        settings, actuator = self.session.settings, self.session.actuator
        truth = truth_of(settings, actuator, secrets.randbelow(_MOST_SEED))
        path = self.folder.place(sanitised(title.strip() + SUFFIX))
        sensors, load = sensors_of(settings), settings.load_torque_Nm

        def work(tell: Tell) -> None:
            tell("simulating; a combination of effects is compiled on its first use")
            seal(truth, path, title, story, actuator, sensors=sensors, load_torque_Nm=load, on_progress=tell)

        def done() -> str:
            self.sealed(path)
            return f"Kept in the data folder: {self.folder.name_of(path)}"

        return self.job.begin("Sealing", work, done)


def truth_of(settings: Settings, actuator: Actuator, seed: int) -> Truth:
    """What the settings hide in the plant: its effects, and the faults that are not healthy."""
    k, told = settings.k, []
    faults = named(k)
    for name, given in settings.effects.items():
        order = f" of order {given['order']:g}" if "order" in given else ""
        told.append(f"{in_sentence(find(name).title)}{order}")
    told += [sentences(k, actuator)[NAMES.index(name)] for name in faults]
    answer = (
        f"Hidden: {'; '.join(told)}." if told else "Nothing is hidden: the plant is the model's, within tolerances."
    )
    effects = {name: dict(given) for name, given in settings.effects.items()}
    return Truth("", seed, answer, effects, faults=faults)


def sensors_of(settings: Settings) -> Sensors:
    """Those that are set; where they are perfect, those of the shipped challenges, since no rig has such."""
    given = settings.sensors
    return Sensors(given.current_noise_A or SENSORS.current_noise_A, given.encoder_bits or SENSORS.encoder_bits)
