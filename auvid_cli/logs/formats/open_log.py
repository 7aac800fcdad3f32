"""Open a log of any kind, which is recognised by its content."""

import re
import zipfile
import zlib
from collections.abc import Sequence
from enum import Enum
from importlib import import_module
from pathlib import Path

from auvid_cli.config.log_map import LogFile
from auvid_cli.data.files import damage_as_file_error
from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import Log
from auvid_cli.logs.formats.text_layout import UTF_16
from auvid_cli.regular_files import check_regular_file

_HEAD_BYTES = 4096
_READABLE = (
    "CSV text, JSON lines, .npz, .mat, ROS bags (.bag, .mcap, .db3, folder), ArduPilot logs (.BIN, .log, .tlog), "
    "PX4 (.ulg), IMC (.lsf) and MOOS logs (.alog)"
)
_NEVER_IN_TEXT = re.compile(rb"[\x00-\x08]")
_SLOCUM = re.compile(rb"dbd_label:\s*DBD\(")
_JSON_LINE = re.compile(rb'(\xef\xbb\xbf)?\s*\{\s*"')
_MAVLINK_MARKERS = b"\xfe\xfd"


class LogKind(Enum):
    """Kind of a log: words, suffix that its library requires, module and class that read it, extra, and first bytes."""

    BAG1 = "a ROS 1 bag", ".bag", "ros.BagLog", "ros", b"#ROSBAG V2.0"
    MCAP = "an MCAP bag", ".mcap", "ros.BagLog", "ros", b"\x89MCAP0\r\n"
    SQLITE = "a SQLite file such as a ROS 2 bag", ".db3", "ros.BagLog", "ros", b"SQLite format 3\0"
    MAT = "a MATLAB file", ".mat", "arrays.MatlabLog", "", b"MATLAB 5.0 MAT-file"
    MAT_HDF5 = "a MATLAB 7.3 file", ".mat", "arrays.MatlabHdf5Log", "", b"MATLAB 7.3 MAT-file"
    NPZ = "a NumPy archive", ".npz", "arrays.NumpyLog", "", b""
    DATAFLASH = "an ArduPilot DataFlash log", ".bin", "ardupilot.DataFlashLog", "ardupilot", b"\xa3\x95\x80"
    TELEMETRY = "a MAVLink telemetry log", ".tlog", "ardupilot.TelemetryLog", "ardupilot", b""
    ULOG = "a PX4 log", ".ulg", "message_logs.ULogLog", "px4", b"ULog\x01\x12\x35"
    LSF = "an IMC log", ".lsf", "imc.LsfLog", "imc", b"\x54\xfe"
    ALOG = "a MOOS log", ".alog", "message_logs.AlogLog", "", b""
    DATAFLASH_TEXT = "a DataFlash log as text", "", "message_logs.DataFlashTextLog", "", b"FMT, 128,"
    JSON = "a log of JSON objects", "", "message_logs.JsonLinesLog", "", b""

    def __init__(self, description: str, suffix: str, reader: str, extra: str, magic: bytes) -> None:
        self.description, self.suffix, self.reader = description, suffix, reader
        self.extra, self.magic = extra, magic


_LOGS_OF_EXTRA = {"ros": "ROS bags", "ardupilot": "ArduPilot logs", "px4": "PX4 logs", "imc": "IMC logs"}
# Advice for files that users often confuse with logs, by their first bytes.
_ADVICE_BY_MAGIC = {
    b"\x89HDF\r\n\x1a\n": "looks like an HDF5 file of another kind than MATLAB 7.3",
    b"\x93NUMPY": "looks like a single NumPy array: save its columns by name with numpy.savez",
    b"\xd0\xcf\x11\xe0": "looks like an old Excel workbook: save it as CSV",
    b"version https://git-lfs.github.com/": "is a Git LFS pointer, not the log: run git lfs pull where it came from",
    b"#ROSBAG V1": "looks like a ROS bag of version 1: run rosbag fix or rosbag migrate",
}


def open_log(
    path: Path, layout: LogFile | None = None, max_bytes: int | None = None, definitions: Sequence[Path] = ()
) -> Log:
    """Open a log, or a bag that is a folder.

    Parameters
    ----------
    path : pathlib.Path
    layout : LogFile, optional
        Layout of a text log; unknown parts of it are detected.
    max_bytes : int, optional
        Size of the beginning of a text log that is read. Default: all of it is read.
    definitions : sequence of pathlib.Path, optional
        Definitions of messages (.msg) that a ROS bag lacks.

    Raises
    ------
    FileError
        If the file is missing, empty, damaged, of an unknown kind, or named like another kind, or if a package that
        reads it is not installed.
    """
    if path.is_dir():
        if not (path / "metadata.yaml").is_file():
            raise FileError(f"{path}: folder without metadata.yaml; expected a ROS 2 bag or a file: give a file in it")
        for part in path.iterdir():
            _check_regular(part)
        return _open(path, LogKind.SQLITE, definitions)
    _check_regular(path)
    kind = _kind_of(path)
    if kind is None:
        from auvid_cli.logs.formats.delimited import DelimitedLog

        return DelimitedLog(path, layout or LogFile(), max_bytes)
    if kind.suffix and path.suffix.lower() != kind.suffix and not path.name.lower().endswith(f"{kind.suffix}.gz"):
        raise FileError(f"{path}: looks like {kind.description}, whose name must end in {kind.suffix}: rename it")
    return _open(path, kind, definitions)


def _open(path: Path, kind: LogKind, definitions: Sequence[Path]) -> Log:
    module, _, reader = kind.reader.partition(".")
    try:
        # Imported here, because the libraries are optional and slow to load.
        log: Log = getattr(import_module(f"auvid_cli.logs.formats.{module}"), reader)(path)
    except ModuleNotFoundError as error:
        if not kind.extra:
            raise
        logs, package = _LOGS_OF_EXTRA[kind.extra], str(error.name).partition(".")[0]
        raise FileError(
            f"reading {logs} needs the package {package}: run pip install '.[{kind.extra}]' in the clone of auvid"
        ) from error
    if kind.extra == "ros":
        log.definitions = definitions
    return log


def _check_regular(path: Path) -> None:
    try:
        check_regular_file(path)
    except ValueError as error:
        raise FileError(f"{path}: {error}") from None


def _kind_of(path: Path) -> LogKind | None:
    """Return the kind of a file; None for delimited text."""
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
        if not head:
            raise FileError(f"{path}: empty file")
        if head.startswith(b"\x1f\x8b"):
            # Not with gzip, which refuses a short file that is cut.
            head = zlib.decompressobj(zlib.MAX_WBITS | 16).decompress(head, _HEAD_BYTES)
            if _is_text(head):
                return None
            if head.startswith(LogKind.LSF.magic):
                return LogKind.LSF
            raise FileError(f"{path}: compressed file without text; expected text inside: unpack it with gunzip first")
    except (OSError, EOFError, zlib.error) as error:
        raise FileError(f"{path}: cannot be read: {error}") from error
    for kind in LogKind:
        if kind.magic and head.startswith(kind.magic):
            return kind
    for magic, advice in _ADVICE_BY_MAGIC.items():
        if head.startswith(magic):
            raise FileError(f"{path}: {advice}")
    if _SLOCUM.match(head):
        raise FileError(
            f"{path}: looks like a log of a Slocum glider: convert it with dbd2asc, and use the output of that"
        )
    if path.suffix.lower() == LogKind.ALOG.suffix and _is_text(head):
        return LogKind.ALOG
    if zipfile.is_zipfile(path):
        return _kind_of_zip(path)
    if head.startswith(b"PK\x03\x04"):
        raise FileError(f"{path}: looks like a NumPy archive or another zip file that is cut short: copy it again")
    if len(head) > 8 and head[8] in _MAVLINK_MARKERS and not _is_text(head):
        return LogKind.TELEMETRY
    if head.startswith(UTF_16):
        return None
    if not _is_text(head):
        raise FileError(f"{path}: unknown kind of file; expected {_READABLE}")
    return LogKind.JSON if _JSON_LINE.match(head) else None


def _kind_of_zip(path: Path) -> LogKind:
    with (
        damage_as_file_error(lambda reason: f"{path}: is a damaged archive: {reason}"),
        zipfile.ZipFile(path) as archive,
    ):
        names = archive.namelist()
    if any(name.endswith(".npy") for name in names):
        return LogKind.NPZ
    if any(name.startswith("xl/") for name in names):
        raise FileError(f"{path}: looks like an Excel workbook: save it as CSV")
    raise FileError(f"{path}: is a zip archive: unpack it first")


def _is_text(head: bytes) -> bool:
    # Zero bytes may follow the text after a power cut.
    written = head.rstrip(b"\0")
    return bool(written) and not _NEVER_IN_TEXT.search(written)
