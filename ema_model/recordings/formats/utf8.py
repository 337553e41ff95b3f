"""A text as UTF-8, whatever it is stored in."""

from __future__ import annotations

import codecs
import io

from ema_model.recordings.formats.text_layout import Layout


class Utf8(io.RawIOBase):
    """To read from its first letter on."""

    def __init__(self, path: str, layout: Layout) -> None:
        super().__init__()
        encoding = layout.encoding
        self._file = open(path, "rb")
        mark = {"utf-8": 3, "utf-16-le": 2, "utf-16-be": 2}.get(encoding, 0) if layout.has_mark else 0
        self._file.seek(mark)
        self._decoder = codecs.getincrementaldecoder(encoding)("replace")
        self._is_utf8 = encoding == "utf-8"
        self._left = b""

    def readable(self) -> bool:
        """It is."""
        return True

    def read(self, size: int | None = -1) -> bytes:
        """So many bytes, fewer at the end."""
        if self._is_utf8:
            return self._file.read(-1 if size is None else size)
        if size is None or size < 0:
            return self._left + self._decoder.decode(self._file.read(), True).encode()
        while len(self._left) < size:
            piece = self._file.read(max(size, 1 << 16))
            self._left += self._decoder.decode(piece, not piece).encode()
            if not piece:
                break
        given, self._left = self._left[:size], self._left[size:]
        return given

    def close(self) -> None:
        """Closes the file."""
        self._file.close()
        super().close()
