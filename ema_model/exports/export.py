"""An actuator's model written for other tools, and each of them replayed on recordings."""

from __future__ import annotations

import importlib.metadata
import os
import secrets
import shutil
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ema_model.actuator import Actuator
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.exports import c, fmu, mjcf, python
from ema_model.exports.exported import Exported, exported
from ema_model.exports.replay import Export, Proof, TargetProof, proof_of, replayed, shortened
from ema_model.recordings import Measurement

Progress = Callable[[str], None]

NAMES = ("c", "fmu", "mjcf", "python")  # of targets
_MOST_PYTHON_STEPS = 20_000  # of a proof: each takes a fifth of a millisecond
_MOST_STEPS = 500_000  # the same of an FMU and of MuJoCo: each takes ten microseconds


@dataclass(frozen=True)
class Order:
    """What a target is written of, and where."""

    one: Exported
    folder: Path
    proof: Proof
    fmi: str  # the version of FMUs
    progress: Progress


@dataclass(frozen=True)
class Target:
    """What an export can be."""

    title: str
    check: Callable[[], object]  # raises InputError where what it needs is not there
    write: Callable[[Order], TargetProof]


def _write_c(order: Order) -> TargetProof:
    one = order.one
    names = f"{one.name}.h", f"{one.name}.c"
    for name, text in zip(names, (c.header(one), c.source(one))):
        (order.folder / name).write_text(text, encoding="utf-8")
    order.progress("compiling the C")
    with tempfile.TemporaryDirectory(prefix="emaviz-export-") as scratch:
        for name in names:
            shutil.copy(order.folder / name, scratch)
        losses = replayed(order.proof, c.CompiledC(one, Path(scratch)), order.progress)
    compiled = f"compiled by {Path(c.compiler()).name} {' '.join(c.FLAGS)}"
    return TargetProof("c", "C", names, compiled, tuple(losses))


def _write_fmu(order: Order) -> TargetProof:
    path = order.folder / f"{order.one.name}.fmu"
    order.progress("compiling the FMU")
    fmu.write_fmu(order.one, path, order.fmi)
    if problems := fmu.problems_of(path):
        raise InputError(f"the FMU is not valid: {problems[0]}")
    with tempfile.TemporaryDirectory(prefix="emaviz-export-") as scratch:
        running = fmu.RunningFmu(order.one, path, Path(scratch))
        losses = replayed(shortened(order.proof, _MOST_STEPS), running, order.progress)
    checked = f"FMI {order.fmi} co-simulation, valid by fmpy and run in it"
    return TargetProof("fmu", "FMU", (path.name,), checked, tuple(losses))


def _write_mjcf(order: Order) -> TargetProof:
    one, proof, progress = order.one, order.proof, order.progress
    cannot = mjcf.losses(shortened(proof, _MOST_STEPS), progress)
    joint, factors = mjcf.fitted(proof, mjcf.joint_of(one.actuator, one.rows), progress)
    notes = mjcf.in_words(joint, factors)
    path = order.folder / f"{one.name}.xml"
    path.write_text(mjcf.document(one, joint, notes), encoding="utf-8")
    found = mjcf.replayed_in_mujoco(shortened(proof, _MOST_STEPS), factors, progress)
    checked = f"run in MuJoCo {importlib.metadata.version('mujoco')}"
    return TargetProof("mjcf", "MJCF", (path.name,), checked, tuple(found), tuple(cannot), tuple(notes))


def _write_python(order: Order) -> TargetProof:
    name = f"{order.one.name}.py"
    (order.folder / name).write_text(python.source(order.one), encoding="utf-8")
    run = python.ImportedPython(order.one, order.folder)
    losses = replayed(shortened(order.proof, _MOST_PYTHON_STEPS), run, order.progress)
    return TargetProof("python", "Python", (name,), "run with numpy", tuple(losses))


TARGETS = {
    "c": Target("C", c.compiler, _write_c),
    "fmu": Target("FMU", fmu.check, _write_fmu),
    "mjcf": Target("MJCF", mjcf.check, _write_mjcf),
    "python": Target("Python", lambda: None, _write_python),
}


def export(
    actuator: Actuator,
    targets: Sequence[str],
    recordings: Sequence[Measurement],
    out: str | os.PathLike[str],
    *,
    name: str = "",
    fmi: str = fmu.VERSIONS[0],
    on_progress: Progress | None = None,
) -> Export:
    """Writes the targets into a new folder, each replayed on the recordings; nothing is written where one fails.

    targets: of `TARGETS`; out: the folder; name: of the files, the actuator's own without one;
    fmi: the version of FMUs, of `fmu.VERSIONS`.
    Raises InputError for a target that does not exist or whose tools are not there, a folder that holds something,
    effects that have no form, and recordings that cannot be replayed.
    """
    progress = on_progress or (lambda text: None)
    wanted = list(dict.fromkeys(targets))
    for target in wanted:
        if target not in TARGETS:
            like = did_you_mean(target, TARGETS)
            raise InputError(f"no target {quoted(target)!r}; targets are {', '.join(TARGETS)}{like}")
    if not wanted:
        raise InputError(f"name a target to export to: {', '.join(TARGETS)}")
    if fmi not in fmu.VERSIONS:
        raise InputError(f"no version {quoted(fmi)!r} of FMI; there are {' and '.join(fmu.VERSIONS)}")
    folder = check_folder(out)
    for target in wanted:
        TARGETS[target].check()
    one = exported(actuator, name)
    proof = proof_of(one, recordings, progress)
    draft = folder.parent / f".{folder.name[:40]}-{secrets.token_hex(4)}"
    try:
        draft.mkdir()
        proofs = []
        for target in wanted:
            progress(f"writing {TARGETS[target].title}")
            proofs.append(TARGETS[target].write(Order(one, draft, proof, fmi, progress)))
        found = Export(one, str(out), tuple(proofs), proof.simulated, tuple(m.name for m in recordings))
        shutil.rmtree(draft / "__pycache__", ignore_errors=True)
        if folder.is_dir():  # it is empty, and some systems do not put a folder in its place
            folder.rmdir()
        os.replace(draft, folder)
    except OSError as error:
        raise InputError(f"{quoted(folder)}: cannot be written ({error.strerror}); check the disk") from None
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return found


def at_hand() -> tuple[list[str], list[str]]:
    """The targets whose tools are there, and a line for each of the others."""
    names, lines = [], []
    for name, target in TARGETS.items():
        try:
            target.check()
        except InputError as error:
            lines.append(f"{target.title} is left out: {error}")
        else:
            names.append(name)
    return names, lines


def check_folder(out: str | os.PathLike[str]) -> Path:
    """The folder to write, which is not there yet or is empty; InputError for any other."""
    folder = Path(os.path.realpath(out))
    if folder.is_dir() and not any(folder.iterdir()):
        pass
    elif folder.exists():
        raise InputError(f"{quoted(out)}: exists already; name a folder that is new or empty")
    if not folder.parent.is_dir():
        raise InputError(f"{quoted(out)}: the folder {quoted(folder.parent)} does not exist; make it first")
    if not os.access(folder.parent, os.W_OK):
        raise InputError(f"{quoted(out)}: no permission to write in {quoted(folder.parent)}")
    return folder
