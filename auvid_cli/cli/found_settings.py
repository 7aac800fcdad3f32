"""What commands share that find settings in a dataset and write them into a file for `auvid identify`."""

import shlex
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from auvid_cli.cli.options import refuse_log
from auvid_cli.cli.terminal import Terminal
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.dataset_file import read_dataset
from auvid_cli.data.files import keep_apart
from auvid_cli.data.replacement import put_copy
from auvid_cli.data.results_folder import folder_of_dataset, locked, tables_and_figures


class Search(NamedTuple):
    """A dataset with the settings asked for, where results go, and the file for what is found."""

    dataset: Dataset
    folder: Path
    file: Path


def begin_search(
    command: ExitStack, path: Path, changes: tuple[str, ...], output: Path | None, overwrite: bool, name: str
) -> Search:
    """Read a dataset and put it beside what will be found; refuse what would be written over files that are read.

    Parameters
    ----------
    command : contextlib.ExitStack
        At whose end others may write into the results folder again.
    path : pathlib.Path
    changes : tuple of str
        Of its settings.
    output : pathlib.Path, optional
        Results folder.
    overwrite : bool
        Whether another dataset there may be replaced.
    name : str
        Of the file for what is found.

    Raises
    ------
    ConfigError, DataError, FileError
        As reading and replacing datasets do.
    """
    refuse_log(path)
    dataset, folder = read_dataset(path, changes), output or folder_of_dataset(path)
    files, file = [path, *dataset.experiment.data_files()], folder / name
    command.enter_context(locked(folder))
    put_copy(path, dataset, folder, files, overwrite)
    keep_apart([file, *tables_and_figures(folder)], files)
    return Search(dataset, folder, file)


def say_next(
    terminal: Terminal, path: Path, settings: Sequence[str] | None, use: Sequence[str] | None, file: Path
) -> None:
    """Say which command identifies with what was found, and with all else that was asked for."""
    given = [*(f"--set={setting}" for setting in settings or ()), *(f"--use={span}" for span in use or ())]
    terminal.say(f"next: {shlex.join(['auvid', 'identify', str(path), *given, '--set', str(file)])}")
