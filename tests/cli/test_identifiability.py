"""`auvid identifiability` on a part of a dataset."""

import csv

import pytest
import typer
from typer.testing import CliRunner

from auvid_cli.cli.identifiability import identifiability
from auvid_cli.data.dataset_file import write_dataset


@pytest.fixture
def bounds(short_run, tmp_path):
    """Function: the bounds by coefficient that the command finds with some options."""
    write_dataset(tmp_path / "dataset.h5", short_run)
    app = typer.Typer()
    app.command()(identifiability)

    def run(*options):
        result = CliRunner().invoke(app, [str(tmp_path / "dataset.h5"), "-o", str(tmp_path / "out"), *options])
        assert result.exit_code == 0, result.output
        with (tmp_path / "out/tables/identifiability.csv").open(encoding="utf-8", newline="") as file:
            return {row["coefficient"]: float(row["cramer_rao_bound"]) for row in csv.DictReader(file)}

    return run


def test_a_part_of_the_data_says_less_of_every_coefficient(bounds):
    whole, part = bounds(), bounds("--use", "10:40")
    assert part.keys() == whole.keys()
    assert all(part[symbol] > whole[symbol] for symbol in whole)
    assert part == bounds("--set", "identification.use.spans=[[10, 40]]")
