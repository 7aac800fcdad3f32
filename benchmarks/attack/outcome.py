"""What was wrong with the way in which a command ended."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

from benchmarks.attack.running import Ended

COLUMNS = {
    "traceback": "tracebacks",
    "hang": "hangs",
    "exit": "wrong exit codes",
    "raw": "raw warnings",
    "file": "files lost or incomplete",
    "number": "invalid numbers",
    "process": "processes left",
}
_MESSAGES = "auvid: ", "Usage: "
_TRACEBACK = "Traceback (most recent call last)"
_RAW = re.compile(r"\b\w*Warning: |HDF5-DIAG|Exception ignored|Fatal Python error|^\s*warnings\.warn", re.MULTILINE)
_ERROR = re.compile(r"^([A-Za-z_][\w.]*(?:Error|Exception|Interrupt|Exit|Warning)\b[^\n]*)", re.MULTILINE)
_FRAME = re.compile(r'File "([^"]+)", line (\d+), in (\S+)')


@dataclass
class Outcome:
    """A case and what was wrong with it: by column of the table, where and what."""

    kind: str
    index: int
    what: str
    commands: list[list[str]]
    seconds: float = 0.0
    faults: dict[str, str] = field(default_factory=dict)


def faults_of(ended: Ended, refused: bool, must_end: bool) -> dict[str, str]:
    """Say what was wrong, by column; `must_end` where Ctrl-C may not be needed."""
    if ended.killed or (ended.interrupted and must_end):
        how = "deaf to Ctrl-C" if ended.killed else "no end"
        return {"hang": f"{how} after {ended.seconds:.0f} s"}
    said = ended.out + "\n" + ended.err
    found: dict[str, str] = {}
    if _TRACEBACK in said:
        found["traceback"] = _place(said)
    elif (wrong := _wrong_code(ended, refused)) is not None:
        found["exit"] = wrong
    if (raw := _RAW.search(said)) is not None and "traceback" not in found:
        line = said[said.rfind("\n", 0, raw.start()) + 1 :].splitlines()[0]
        found["raw"] = re.sub(r"^.*/(?=[^/]+/[^/]+\.py)", "", line)
    elif ended.code == 2 and not found and not ended.err.lstrip().startswith(_MESSAGES):
        found["raw"] = f"before the message: {_first(ended.err)}"
    return found


def _wrong_code(ended: Ended, refused: bool) -> str | None:
    if ended.interrupted and ended.code in (0, 1, 2, 130):
        return None
    if ended.code not in (0, 1, 2):
        return f"exit code {ended.code}: {_first(ended.err)}"
    if ended.code == 2:
        sound = any(line.startswith(_MESSAGES) for line in ended.err.splitlines())
        return None if sound else f"exit code 2 without a message of auvid's: {_first(ended.err)}"
    if "Aborted" in ended.err:
        return f"exit code {ended.code}: Aborted."
    if ended.code == 1 and not ended.out.strip() and not ended.err.strip():
        return "exit code 1 without a word"
    if refused:
        return f"exit code {ended.code} for what must be refused"
    return None


def _first(text: str) -> str:
    return (text.strip().splitlines() or ["(no message)"])[0][:160]


def _place(said: str) -> str:
    """Return the error and the innermost line of auvid's own code in a traceback."""
    last = said[said.rfind(_TRACEBACK) :]
    errors = _ERROR.findall(last)
    frames = [f for f in _FRAME.findall(last) if "/auvid_cli/" in f[0]]
    place = (
        "{}:{} {}".format("auvid_cli/" + frames[-1][0].rpartition("/auvid_cli/")[2], *frames[-1][1:]) if frames else ""
    )
    return f"{errors[0][:120] if errors else last.strip().splitlines()[-1][:120]} at {place}"


def unsound_files(paths: Iterable[Path]) -> str | None:
    """Find the first file that is half written, or a temporary that was left."""
    for path in paths:
        if path.name == ".lock":
            continue
        if path.name.startswith("."):
            return f"left behind: {re.sub(r'-[a-z0-9_]{8}', '-xxxx', path.name)}"
        if not opens(path):
            return f"half written: {path.name}"
    return None


def opens(path: Path) -> bool:
    """Say whether a file that auvid has written is whole."""
    if path.suffix == ".h5":
        return h5py.is_hdf5(path)
    content = path.read_bytes()
    ends = {".png": b"IEND\xaeB`\x82", ".svg": b"</svg>\n", ".parquet": b"PAR1", ".csv": b"\n", ".md": b"\n"}
    return bool(content) and content.endswith(ends.get(path.suffix, b""))


def unsound_numbers(paths: Iterable[Path]) -> str | None:
    """Find an estimate that is stated as completed and holds invalid numbers."""
    for path in paths:
        if path.parent.name != "estimates" or path.suffix != ".h5":
            continue
        with h5py.File(path) as file:
            if str(file.attrs["status"]) != "completed":
                continue
            for name in ("mean", "standard_deviation", "covariance"):
                if not np.isfinite(file[name][...]).all():
                    return f"completed, and not all of `{name}` is finite"
    return None
