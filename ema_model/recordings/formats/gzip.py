"""A file of another format that gzip has packed: run.csv.gz, log.json.gz."""

from __future__ import annotations

import os
import tempfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

from ema_model.errors import InputError
from ema_model.files.opened import megabytes, refusal
from ema_model.recordings.formats.format import Columns, Format
from ema_model.recordings.formats.text_layout import Head, Hints

_PIECE = 1 << 20
_SUFFIX = ".gz"


def hinted(hints: Hints) -> Format:
    """The format for a file whose text somebody has said to be laid out so."""

    def header(path: str, max_bytes: int) -> list[str]:
        with _unpacked(path, max_bytes) as (inner, packed):
            return _inner(path, packed, hints).header(inner, max_bytes)

    def read(path: str, names: Sequence[str], max_bytes: int, strict: bool) -> Columns:
        with _unpacked(path, max_bytes) as (inner, packed):
            found = _inner(path, packed, hints).read(inner, names, max_bytes, strict)

        def place(row: int) -> str:
            with _unpacked(path, max_bytes) as (inner, packed):
                again = _inner(path, packed, hints).read(inner, list(found.arrays), max_bytes, False)
                return again.place(row)

        return replace(found, place=place)

    def head(path: str, max_bytes: int) -> Head | None:
        with _unpacked(path, max_bytes) as (inner, packed):
            inside = _inner(path, packed, hints)
            return inside.head(inner, max_bytes) if inside.head is not None else None

    return Format(_SUFFIX, "gzip", header, read, hinted=hinted, head=head)


def _inner(path: str, packed: str, hints: Hints) -> Format:
    from ema_model.recordings.formats import FORMATS  # which this file is one of

    suffix = os.path.splitext(packed)[1].lower()
    found = FORMATS.get(suffix)
    if found is None or suffix == _SUFFIX:
        raise refusal(path, "does not say what is packed in it; a name such as run.csv.gz is expected")
    return found.hinted(hints) if found.hinted is not None and hints != Hints() else found


@contextmanager
def _unpacked(path: str, max_bytes: int) -> Iterator[tuple[str, str]]:
    """The file inside, unpacked beside the system's other temporary files, and its name; errors name the packed one."""
    packed = os.path.basename(path)[: -len(_SUFFIX)]
    with tempfile.TemporaryDirectory() as folder:
        inner = os.path.join(folder, "unpacked" + os.path.splitext(packed)[1].lower())
        with open(path, "rb") as source, open(inner, "wb") as target:
            unpacker, size, is_inside = zlib.decompressobj(wbits=31), 0, False
            while piece := source.read(_PIECE):
                while piece:
                    if not is_inside and size:  # blocks of a fixed length, as tapes have them, are filled with zeros
                        piece = piece.lstrip(b"\0")
                        if not piece:
                            break
                    is_inside = True
                    try:
                        unpacked = unpacker.decompress(piece, _PIECE)
                    except zlib.error:
                        raise refusal(path, "is not a whole gzip file; pack it again") from None
                    size += len(unpacked)
                    if size > max_bytes:
                        raise refusal(path, f"unpacks to over {megabytes(max_bytes)}, which is the limit; split it")
                    target.write(unpacked)
                    piece = unpacker.unconsumed_tail
                    if unpacker.eof:  # another packed part may follow
                        piece, unpacker, is_inside = unpacker.unused_data, zlib.decompressobj(wbits=31), False
            if size == 0 or is_inside:
                raise refusal(path, "is not a whole gzip file; pack it again")
        try:
            yield inner, packed
        except InputError as error:
            raise InputError(str(error).replace(inner, path)) from None


FORMAT = hinted(Hints())
