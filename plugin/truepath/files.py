"""Writing files so that nobody ever sees half of one."""

from __future__ import annotations

import contextlib
import os
import tempfile
from pathlib import Path

from truepath.errors import InputError


def write_atomically(path: str | Path, content: str | bytes) -> None:
    """Writes beside the target, then renames: the target holds the old content or the new one, never a part.

    Raises:
        InputError: the folder does not exist or cannot be written to.
    """
    path = Path(path)
    if path.exists() and not path.is_file():
        raise InputError("the output is no file", file=path, expected="a new file or one to replace")
    path = path.resolve()  # a link stays a link; what it points to is replaced
    data = content.encode("utf-8") if isinstance(content, str) else content
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        expected = "a file in a folder that is there and can be written to"
        raise InputError("cannot write here", file=path, expected=expected, found=error.strerror) from None
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, path.stat().st_mode & 0o777 if path.exists() else 0o666 & ~_umask())
        os.replace(temporary, path)
    except OSError as error:
        raise InputError("cannot write this file", file=path, found=error.strerror) from None
    finally:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(temporary)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
