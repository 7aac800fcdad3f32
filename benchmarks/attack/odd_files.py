"""What may stand where a file is expected."""

import os
import random
from pathlib import Path


def put(rng: random.Random, path: Path) -> str:
    """Put something odd in place of a file, and say what it is."""
    kind = rng.choice(("pipe", "endless", "folder", "loop", "dangling", "empty", "zeros", "nothing"))
    path.unlink(missing_ok=True)
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "endless":
        path.symlink_to("/dev/zero")
    elif kind == "folder":
        path.mkdir()
    elif kind == "loop":
        path.symlink_to(path)
    elif kind == "dangling":
        path.symlink_to("nowhere")
    elif kind == "empty":
        path.touch()
    elif kind == "zeros":
        path.write_bytes(bytes(100_000))
    return kind
