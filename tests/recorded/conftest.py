"""Commands run on logs of vehicles, which do not ship with auvid."""

import csv
import os
from functools import cache
from pathlib import Path

import pytest
from typer.testing import CliRunner

from auvid_cli.cli.app import app

MAPS = Path(__file__).parent / "maps"
SHARED = Path(os.environ.get("AUVID_SHARED", Path(__file__).parents[2] / "../shared")).resolve()


@pytest.fixture(scope="session")
def recorded():
    """The folder of recorded logs."""
    folder = SHARED / "recorded"
    if not folder.is_dir():
        pytest.skip("the recorded logs are not here")
    return folder


@pytest.fixture(scope="session")
def auvid(scan_files_here, leave_figures_out):
    """Function: run a command without figures in this process, expect an exit code, and return what it printed."""

    def run(*arguments, code=0):
        with pytest.MonkeyPatch.context() as patch:
            scan_files_here(patch)
            leave_figures_out(patch)
            result = CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)
        assert result.exit_code == code, result.output
        return result.stdout if code != 2 else result.stderr

    return run


@pytest.fixture(scope="session")
def imported(auvid, tmp_path_factory):
    """Function: the dataset file of a log by a map, each made once; `changes` to the map's text."""
    made = {}

    def dataset(log, name, *changes):
        if (log, name, changes) not in made:
            folder = tmp_path_factory.mktemp(name)
            text = (MAPS / f"{name}.yaml").read_text()
            for old, new in changes:
                assert old in text
                text = text.replace(old, new)
            (folder / "map.yaml").write_text(text.replace("vehicle: couguv", f"vehicle: {MAPS}/couguv"))
            auvid("import", log, "--map", folder / "map.yaml", "-o", folder / "dataset.h5")
            made[log, name, changes] = folder / "dataset.h5"
        return made[log, name, changes]

    return dataset


@pytest.fixture(scope="session")
def inspected(auvid, tmp_path_factory):
    """Function: what `auvid inspect` says of a dataset file, by subject and check; each made once."""

    @cache
    def inspection(dataset, code, *options):
        folder = tmp_path_factory.mktemp("inspection")
        auvid("inspect", dataset, "-o", folder, *options, code=code)
        return {(row["subject"], row["check"]): row for row in rows_of(folder / "tables/inspection.csv")}

    return inspection


def rows_of(path):
    """Rows of a CSV file as dictionaries."""
    with path.open() as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="session")
def rows():
    """Function: rows of a CSV file as dictionaries."""
    return rows_of
