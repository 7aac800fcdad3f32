"""The steps of importing logs."""

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

from auvid_cli.api.logs import MappedLogs, suggest_map
from auvid_cli.cli.pipeline import say_doubts
from auvid_cli.cli.terminal import Terminal
from auvid_cli.data.files import keep_apart, write_text
from auvid_cli.data.replacement import other_run, put_dataset
from auvid_cli.data.results_folder import dataset_in, folder_of_run, locked
from auvid_cli.errors import FileError
from auvid_cli.report.import_report import print_import_report


def import_logs(map_file: Path, given: Sequence[str], output: Path | None, overwrite: bool, terminal: Terminal) -> None:
    """Convert logs by a map into a dataset file, and say what was done.

    Raises
    ------
    ConfigError
        If the map has mistakes, or does not fit the logs.
    FileError
        If a log cannot be read, or the dataset cannot be written, or another stands there and may not be replaced.
    """
    logs = MappedLogs(map_file, given)
    path, inputs = output or dataset_in(folder_of_run(logs.settings.name)), logs.inputs()
    keep_apart([path], inputs)
    say_doubts(logs.settings.vehicle, terminal)
    with terminal.stage("read the logs"):
        dataset, report = logs.convert()
    with terminal.stage("write the dataset"), _locked_around(path):
        put_dataset(path, dataset, inputs, overwrite, other_run(path, dataset.experiment))
    print_import_report(terminal.out, report.summaries, report.remarks)
    terminal.tell(f"{path}: t = 0 is {report.origin:.6f} s by the log's clock")
    terminal.say(f"next: auvid inspect {path}")


def _locked_around(path: Path) -> AbstractContextManager[None]:
    return locked(path.parent) if path == dataset_in(path.parent) else nullcontext()


def suggest_to(files: Sequence[Path], output: Path | None, terminal: Terminal) -> None:
    """Suggest a map of logs, into a new file or onto the standard output.

    Raises
    ------
    FileError
        If that file exists: somebody may have edited it.
    """
    if output is not None and output.exists():
        raise FileError(f"{output}: exists already; name another file for the suggested map, or remove it")
    with terminal.stage("look at the logs"):
        text = suggest_map(files, output.parent if output is not None else Path())
    if output is None:
        print(text, end="")
        return
    write_text(output, text)
    terminal.tell(f"{output}: look at every line with `check:` and fill in what is required, then")
    terminal.say(f"auvid import --map {output}")
