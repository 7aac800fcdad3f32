"""The steps of importing logs."""

from collections.abc import Sequence
from pathlib import Path

from auvid_cli.cli.pipeline import say_doubts
from auvid_cli.cli.terminal import Terminal
from auvid_cli.config.experiment import ImportedRun, RecordedFile, Recording
from auvid_cli.config.log_map import LogMap, load_map
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.files import keep_apart, write_text
from auvid_cli.data.netcdf import digest
from auvid_cli.data.replacement import put_dataset
from auvid_cli.errors import FileError
from auvid_cli.logs.convert import Conversion, convert
from auvid_cli.logs.formats.joined import JoinedLog
from auvid_cli.logs.formats.log import Log
from auvid_cli.logs.formats.open_log import open_log
from auvid_cli.logs.formats.text_layout import TextLayout
from auvid_cli.logs.suggest.suggest import suggest
from auvid_cli.report.import_report import print_accounts


def import_logs(map_file: Path, given: Sequence[str], output: Path | None, overwrite: bool, terminal: Terminal) -> None:
    """Convert logs by a map into a dataset file, and say what was done.

    Raises
    ------
    ConfigError
        If the map has mistakes, or does not fit the logs.
    FileError
        If a log cannot be read, or the dataset cannot be written, or another stands there and may not be replaced.
    """
    settings, tree = load_map(map_file)
    files = settings.files(map_file.parent, given)
    path = output if output is not None else Path("results") / settings.name / "dataset.h5"
    recorded = [part for paths in files.values() for file in paths for part in _parts(file)]
    inputs = [*tree.files(), *recorded]
    keep_apart([path], inputs)
    say_doubts(settings.vehicle, terminal)
    with terminal.stage("read the logs"):
        logs = {name: _opened(paths, _layout(settings, name)) for name, paths in files.items()}
        found = convert(settings, tree, logs)
    with terminal.stage("write the dataset"):
        run = _run(settings, tree.at.source.text, recorded, found)
        put_dataset(path, Dataset(found.inputs, found.sensors, run), inputs, overwrite)
    print_accounts(terminal.out, found.accounts, found.remarks)
    terminal.say(f"{path}: t = 0 is {found.origin:.6f} s by the log's clock")
    terminal.say(f"next: auvid inspect {path}")


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
        text = suggest([open_log(path) for path in files], output.parent if output is not None else Path())
    if output is None:
        print(text, end="")
        return
    write_text(output, text)
    terminal.say(f"{output}: look at every line with `check:` and fill in what is required, then")
    terminal.say(f"auvid import --map {output}")


def _opened(paths: Sequence[Path], layout: TextLayout) -> Log:
    logs = [open_log(path, layout) for path in paths]
    return logs[0] if len(logs) == 1 else JoinedLog(logs)


def _layout(settings: LogMap, name: str) -> TextLayout:
    log = settings.logs[name]
    return TextLayout(log.delimiter, log.header_row, log.decimal, log.missing)


def _parts(log: Path) -> list[Path]:
    """List the files of a log; a bag may be a folder of them."""
    return [part for part in sorted(log.rglob("*")) if part.is_file()] if log.is_dir() else [log]


def _run(settings: LogMap, text: str, files: Sequence[Path], found: Conversion) -> ImportedRun:
    """Return the settings of the dataset, with where it comes from."""
    recorded = tuple(RecordedFile(name=file.name, sha256=digest(file)) for file in files)
    return ImportedRun(
        name=settings.name,
        vehicle=settings.vehicle,
        identification=settings.identification,
        recording=Recording(
            files=recorded,
            map=text,
            origin=found.origin,
            remarks={account.name: account.remarks for account in found.accounts if account.remarks},
        ),
    )
