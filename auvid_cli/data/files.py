"""Writing files so that nothing half-written ever stands under a final name."""

import os
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from auvid_cli.errors import FileError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path beside `path` that takes its name when the block ends well.

    Raises
    ------
    FileError
        If the folder or the file cannot be written; the temporary file is removed, and an earlier
        file of that name stays as it was.
    """
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix)
        os.close(handle)
        temporary = Path(name)
        # mkstemp makes files for the owner's eyes only; a result has the rights of any new file.
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def keep_apart(output: Path, inputs: Iterable[Path]) -> None:
    """Refuse to write over what is read.

    Raises
    ------
    FileError
        If the output is one of the inputs.
    """
    for path in inputs:
        if output.resolve() == path.resolve():
            raise FileError(f"{output}: is read from here, and would be written over; name another file")


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
