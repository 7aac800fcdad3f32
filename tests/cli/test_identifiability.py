"""`auvid identifiability`, of all data and of a part."""

import csv

import pytest

from auvid_cli.data.dataset_file import write_dataset
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS

from .conftest import auvid


def rows(folder):
    with (folder / "tables/identifiability.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture
def bounds(short_run, tmp_path, without_figures):
    """Function: the bounds by coefficient that the command finds with some options."""
    write_dataset(tmp_path / "dataset.h5", short_run)

    def run(*options):
        result = auvid("identifiability", tmp_path / "dataset.h5", "-o", tmp_path / "out", *options)
        assert result.exit_code == 0, result.output
        return {row["coefficient"]: float(row["cramer_rao_bound"]) for row in rows(tmp_path / "out")}

    return run


@pytest.mark.slow
def test_part_of_data_has_larger_bounds(bounds):
    whole, part = bounds(), bounds("--use", "10:40")
    assert part.keys() == whole.keys()
    assert all(part[symbol] > whole[symbol] for symbol in whole)
    assert part == bounds("--set", "identification.use.spans=[[10, 40]]")


@pytest.mark.slow
def test_identifiability_prints_bounds_and_fixed_coefficients(tmp_path):
    result = auvid(
        *("identifiability", "--set", "manoeuvre=manoeuvres/spiral_gentle.yaml"),
        *("--set", "manoeuvre.duration=12 s"),
        cwd=tmp_path,
    )
    assert result.exit_code == 0, result.stderr
    assert "not identified" in result.stdout, "twelve seconds are not enough for all"
    assert "within 1 %" in result.stdout
    assert "  --set 'identification.coefficients=[X_u|u|, " in result.stdout
    home = tmp_path / "results/spiral"
    assert len(rows(home)) == N_COEFFICIENTS
    assert (home / "figures/identifiability_bounds.png").is_file()
    assert "These data do not determine" in (home / "identifiability.html").read_text(encoding="utf-8")
    assert (home / "figures/identifiability_correlation.png").is_file()
    assert not (home / "estimates").exists()
