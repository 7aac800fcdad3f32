"""A process that has auvid loaded, prepares one case after the other, runs it, and judges it.

Started by `benchmarks.attack.pool` with HOME MATERIAL LIMIT SEED; makes the material if it is not there, and says so;
then reads `KIND INDEX` from its input, and answers each with a line of JSON.
"""

import contextlib
import gc
import hashlib
import importlib
import io
import json
import os
import pkgutil
import shutil
import sys
import warnings
from dataclasses import asdict
from pathlib import Path

from benchmarks.attack.cases import numbers
from benchmarks.attack.kinds import KINDS
from benchmarks.attack.material import Material, make
from benchmarks.attack.outcome import Outcome, faults_of, unsound_files, unsound_numbers
from benchmarks.attack.running import perform


def serve() -> None:
    """Answer until there is nothing more to do."""
    home, material, limit, seed = Path(sys.argv[1]), Material(Path(sys.argv[2])), float(sys.argv[3]), int(sys.argv[4])
    # What auvid prints is no answer.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    # Forking is why this process is there; the libraries' threads are idle.
    warnings.simplefilter("ignore", DeprecationWarning)
    _load()
    if not material.folder.exists():
        make(material.folder)
    print(json.dumps("ready"), file=answers, flush=True)
    for line in sys.stdin:
        kind, index = line.split()
        perform_all = KINDS[kind].perform
        if perform_all is not None:
            outcome = perform_all(home, material, seed, int(index))
        else:
            outcome = _attack(home, material, kind, int(index), seed, limit)
        print(json.dumps(asdict(outcome)), file=answers, flush=True)


def _load() -> None:
    """Load everything that a command might, and make what is made once, so that each case finds it."""
    import auvid_cli

    for module in pkgutil.walk_packages(auvid_cli.__path__, "auvid_cli."):
        # Programs do what they are for as soon as they are loaded.
        if not module.name.endswith(("__main__", "figures.server")):
            importlib.import_module(module.name)
    from auvid_cli.__main__ import main

    warnings.resetwarnings()
    warnings.simplefilter("ignore", DeprecationWarning)
    sys.argv = ["auvid", "run", "--dry-run"]
    with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
        main()
    gc.collect()
    gc.freeze()


def _attack(home: Path, material: Material, kind: str, index: int, seed: int, limit: float) -> Outcome:
    shutil.rmtree(home, ignore_errors=True)
    # Deep enough that `../../../x` stays where it is seen.
    folder = home / "a" / "b" / "case"
    folder.mkdir(parents=True)
    (home / "sentinel").write_text("stays as it is")
    maker = KINDS[kind].make
    assert maker is not None
    case = maker(numbers(seed, kind, index), material, folder)
    outcome = Outcome(kind, index, case.what, [list(command) for command in case.commands])
    given = _digests(folder)
    for number, command in enumerate(case.commands):
        ended = perform(command, folder, limit)
        outcome.seconds += ended.seconds
        found = faults_of(ended, case.refused and number == 0, case.must_end or "--dry-run" in command)
        if case.readable and number > 0 and "damaged" in ended.err and not found:
            found["exit"] = f"calls damaged what was written: {ended.err.strip()[:160]}"
        if not ended.killed and not ended.interrupted:
            found |= _changed(home, folder, given, case.rewritten, ended.code)
        for column, text in found.items():
            outcome.faults.setdefault(column, f"{command[0]}: {text}")
        if ended.code not in (0, 1) or found:
            break
    return outcome


def _digests(folder: Path) -> dict[Path, str]:
    return {path: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.rglob("*") if path.is_file()}


def _changed(home: Path, folder: Path, given: dict[Path, str], rewritten: bool, code: int) -> dict[str, str]:
    """Say what a command did to files that it must not do."""
    allowed = {home / "sentinel", *(folder.with_name(name) for name in ("out.txt", "err.txt"))}
    outside = [
        path for path in home.rglob("*") if path.is_file() and folder not in path.parents and path not in allowed
    ]
    now = _digests(folder)
    written = [path for path in now if path not in given]
    found = {}
    if outside:
        found["file"] = f"written outside its folders: {outside[0].relative_to(home)}"
    elif not rewritten and (lost := [path for path, digest in given.items() if now.get(path) != digest]):
        found["file"] = f"was read, and is {'changed' if lost[0] in now else 'gone'}: {lost[0].name}"
    elif unsound := unsound_files(written):
        found["file"] = unsound
    elif code in (0, 1) and (number := unsound_numbers(written)):
        found["number"] = number
    return found
