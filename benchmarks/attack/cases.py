"""A case: damaged input in a folder, and the commands that read it."""

import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from benchmarks.attack.material import Material
from benchmarks.attack.outcome import Outcome


@dataclass(frozen=True)
class Case:
    """What is done with input that has been written into a folder.

    Attributes
    ----------
    what : str
        What was done to the input.
    commands : tuple of tuple of str
        Arguments of auvid; each follows only if those before it were accepted.
    refused : bool
        Whether the first command must refuse the input.
    rewritten : bool
        Whether the command may write what it has read, as a campaign adds to its results.
    readable : bool
        Whether later commands must accept what the first has written.
    must_end : bool
        Whether the commands must end without Ctrl-C.
    """

    what: str
    commands: tuple[tuple[str, ...], ...]
    refused: bool = False
    rewritten: bool = False
    readable: bool = False
    must_end: bool = False


# Writes the input of a case into a folder, by the numbers that are drawn.
Maker = Callable[[random.Random, Material, Path], Case]

# Does a whole case in a folder, by seed and number.
Performer = Callable[[Path, Material, int, int], Outcome]


def numbers(seed: int, kind: str, index: int) -> random.Random:
    """Make the random numbers of one case, the same whichever others are run."""
    return random.Random(f"{seed}/{kind}/{index}")
