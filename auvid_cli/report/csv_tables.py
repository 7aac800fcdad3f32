"""The tables as CSV: one file for each kind of row, with the row's own fields as columns."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from auvid_cli.data.csv_text import csv_text
from auvid_cli.data.files import write_text
from auvid_cli.evaluation.accuracy import CoefficientResult
from auvid_cli.evaluation.assessment import CoefficientBound, Collinear, Identifiability
from auvid_cli.evaluation.check import Check
from auvid_cli.evaluation.consistency import SensorConsistency
from auvid_cli.evaluation.evaluate import Evaluation, FilterSummary
from auvid_cli.evaluation.free_run import VelocityError
from auvid_cli.evaluation.sensor_errors import SensorErrorResult
from auvid_cli.validation.results import ManoeuvreNumber, Prediction, Validation


def write_csv_tables(evaluation: Evaluation, folder: Path) -> list[Path]:
    """Write the CSV tables.

    Parameters
    ----------
    evaluation : Evaluation
    folder : pathlib.Path
        Made if it is missing.

    Returns
    -------
    list of pathlib.Path

    Raises
    ------
    FileError
        If a file cannot be written.
    """
    tables: dict[str, tuple[type[NamedTuple], Iterable[NamedTuple]]] = {
        "coefficients": (CoefficientResult, evaluation.coefficients),
        "summary": (FilterSummary, evaluation.summary),
        "velocity_error": (VelocityError, evaluation.velocity_errors),
        "consistency": (SensorConsistency, evaluation.consistency),
        "sensor_errors": (SensorErrorResult, evaluation.sensor_errors),
    }
    paths = []
    for name, (row_type, rows) in tables.items():
        path = folder / f"{name}.csv"
        write_text(path, csv_text(row_type._fields, rows))
        paths.append(path)
    return paths


def write_checks(checks: Sequence[Check], folder: Path) -> Path:
    """Write ``checks.csv``; a verdict that is only worth knowing has an empty cell under `passed`."""
    path = folder / "checks.csv"
    write_text(path, csv_text(Check._fields, checks))
    return path


def write_inspection(checks: Sequence[Check], folder: Path) -> Path:
    """Write ``inspection.csv``: verdicts on data, as ``checks.csv`` but of no filter."""
    path = folder / "inspection.csv"
    # A check begins with the filter that it is of.
    write_text(path, csv_text(Check._fields[1:], (check[1:] for check in checks)))
    return path


def write_identifiability(found: Identifiability, folder: Path) -> list[Path]:
    """Write ``identifiability.csv``, a row for each coefficient, and ``collinear.csv``, one for each group."""
    tables = {
        "identifiability": csv_text(CoefficientBound._fields, found.bounds),
        "collinear": csv_text(
            Collinear._fields, [group._replace(members=" ".join(group.members)) for group in found.groups]
        ),
    }
    paths = [folder / f"{name}.csv" for name in tables]
    for path, text in zip(paths, tables.values(), strict=True):
        write_text(path, text)
    return paths


def write_validation(found: Validation, folder: Path) -> list[Path]:
    """Write ``validation.csv``, ``manoeuvres.csv``, and the verdicts as ``validation_checks.csv``."""
    tables = {
        "validation": csv_text(Prediction._fields, found.predictions),
        "manoeuvres": csv_text(ManoeuvreNumber._fields, found.manoeuvres),
        "validation_checks": csv_text(Check._fields, found.checks),
    }
    paths = [folder / f"{name}.csv" for name in tables]
    for path, text in zip(paths, tables.values(), strict=True):
        write_text(path, text)
    return paths
