"""What is hidden in a challenge.  Nothing that looks for effects may read this."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field
from pathlib import Path

from ema_model.effects import find
from ema_model.errors import InputError

_KEYS = {"schema", "seed", "answer", "torque", "torque_parameters", "effects"}


@dataclass(frozen=True)
class Truth:
    """The plant behind a challenge's recordings."""

    name: str
    seed: int  # of the plant's parameters, and of the sensors' noise
    answer: str  # in words, for when the student is done
    effects: dict[str, dict[str, float]] = field(default_factory=dict)  # of the catalogue, with their settings
    torque: str = ""  # outside the catalogue: an expression of `ema_model.user_effects`, N·m at the motor
    torque_parameters: dict[str, float] = field(default_factory=dict)


def truths(where: Path) -> list[Truth]:
    """The truths of a folder of challenges, by name; InputError tells a mistake."""
    return [read_truth(path) for path in sorted((where / "truth").glob("*.toml"))]


def read_truth(path: Path) -> Truth:
    """One truth; InputError tells a mistake."""
    try:
        told = tomllib.loads(path.read_text(encoding="utf-8"))
        if unknown := told.keys() - _KEYS:
            raise InputError(f"{path}: {min(unknown)} is not known; known are {', '.join(sorted(_KEYS))}")
        effects = {name: find(name).settings(dict(given)) for name, given in told.get("effects", {}).items()}
        return Truth(
            path.stem,
            int(told["seed"]),
            str(told["answer"]).strip(),
            effects,
            str(told.get("torque", "")),
            {name: float(value) for name, value in told.get("torque_parameters", {}).items()},
        )
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, TypeError, ValueError) as error:
        raise InputError(f"{path}: not a challenge's truth: {error}") from None
    except KeyError as error:
        raise InputError(f"{path}: {error.args[0]} is missing; add it") from None
