"""Sections that several pages share: provenance, correlation and rows of settings."""

import platform
from collections.abc import Sequence
from hashlib import sha256
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from auvid_cli._version import __version__
from auvid_cli.config.campaign import Campaign, dump_campaign
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.loading import dump_experiment
from auvid_cli.data.checks import NamedRows
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.report.page.parts import Listing, Matrix, Part, Section, TablePart, Words
from auvid_cli.report.table import Cell, Column, Symbol, Table, UnitCell, filter_label
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS

_LIBRARIES = ("numpy", "scipy", "numba", "h5py")
Array = NDArray[np.float64]
_MAX_PAIRS = 8  # number of listed pairs
_STRONG = 0.7  # smallest correlation of a listed pair
_MIN_WEIGHT = 0.3  # smallest listed weight of a combination, relative to the largest
_SYMBOLS = {*SYMBOLS, *MOTION_SYMBOLS}


def what_ran(dataset: Dataset) -> str:
    """Return the duration of the data and, if simulated, the manoeuvre."""
    duration = f"{dataset.inputs.time[-1] - dataset.inputs.time[0]:.6g} s"
    if dataset.truth is None or not isinstance(dataset.experiment, Experiment):
        return duration
    return f"{dataset.experiment.manoeuvre.type.replace('_', ' ')} of {duration}"


def provenance_section(dataset: Dataset) -> Section:
    """Return settings, versions and hashes that reproduce the numbers.

    Parameters
    ----------
    dataset : Dataset
        With the settings that count.
    """
    return _section(dump_experiment(dataset.experiment), "auvid run", dataset.sha256)


def campaign_provenance(campaign: Campaign) -> Section:
    """Return settings, versions and hashes that reproduce the runs of a campaign."""
    return _section(dump_campaign(campaign), "auvid campaign", "")


def _section(settings: str, command: str, of_dataset: str) -> Section:
    python = f"{platform.python_implementation()} {platform.python_version()}"
    rows = [
        *(["auvid", __version__], ["Python", f"{python} on {platform.system()} {platform.machine()}"]),
        *([name, version(name)] for name in _LIBRARIES),
        *([["SHA-256 of the dataset", of_dataset]] if of_dataset else []),
        ["SHA-256 of the settings", sha256(settings.encode()).hexdigest()],
    ]
    columns = Column("what", numeric=False), Column("value", numeric=False)
    table = Table("versions", "Versions and hashes", columns, [[*row] for row in rows])
    listing = Listing(f"Settings as YAML: save it, and give its path to {command}", settings)
    return Section("settings", "Settings, hashes, versions", [TablePart(table), listing])


def correlation_of(estimate: Estimate) -> list[Part]:
    """Return the correlations of an estimate's coefficients at the last time, the strongest in words."""
    rows = estimate.coefficient_rows
    covariance = estimate.covariance[np.ix_(rows, rows)]
    deviation = np.sqrt(np.diag(covariance))
    if not rows or not (np.isfinite(covariance).all() and (deviation > 0.0).all()):
        return []
    values = covariance / np.outer(deviation, deviation)
    return correlation_parts(
        f"Correlations, {filter_label(estimate.filter)}", [estimate.state[i] for i in rows], values
    )


def correlation_parts(title: str, symbols: Sequence[str], values: Array) -> list[Part]:
    """Return a matrix of correlations, and its strongest combinations in words."""
    return [Words(_strongest(symbols, values), listed=True), Matrix(title, symbols, values)]


def _strongest(symbols: Sequence[str], values: Array) -> list[str]:
    upper = np.triu(np.abs(np.nan_to_num(values)), 1)
    order = np.argsort(-upper, axis=None)[:_MAX_PAIRS]
    pairs = [(int(i), int(j)) for i, j in zip(*np.unravel_index(order, upper.shape), strict=True)]
    named = [f"{symbols[i]} and {symbols[j]} {values[i, j]:+.2f}" for i, j in pairs if upper[i, j] >= _STRONG]
    sentences = [f"Strongest pairs: {', '.join(named)}." if named else f"No pair correlates by {_STRONG:g} or more."]
    if np.isfinite(values).all():
        variances, vectors = np.linalg.eigh(values)
        sentences.append(
            f"Least certain combination, each in its standard deviation: {_combination(symbols, vectors[:, -1])}; its "
            f"standard deviation is {np.sqrt(variances[-1]):.2g} times that of independent errors."
        )
        sentences.append(
            f"Most certain combination: {_combination(symbols, vectors[:, 0])}, "
            f"{np.sqrt(max(variances[0], 0.0)):.2g} times."
        )
    return sentences


def _combination(symbols: Sequence[str], weights: Array) -> str:
    """Write the largest weights of a combination."""
    order = np.argsort(-np.abs(weights))
    largest = weights[order[0]]
    kept = [k for k in order if abs(weights[k]) >= _MIN_WEIGHT * abs(largest)]
    signs = ["-" if weights[k] / largest < 0.0 else "+" for k in kept]
    sizes = ["" if k == order[0] else f"{abs(weights[k] / largest):.2g} " for k in kept]
    text = " ".join(f"{sign} {size}{symbols[k]}" for sign, size, k in zip(signs, sizes, kept, strict=True))
    return text.removeprefix("+ ")


def table_of_rows(key: str, title: str, rows: NamedRows) -> Table:
    """Lay out rows with the names of their columns in words; those without any value are left out."""
    kept = [k for k in range(len(rows.columns)) if any(row[k] not in (None, "") for row in rows.rows)]
    columns = tuple(
        Column(rows.columns[k].replace("_", " "), numeric=all(_is_number(row[k]) for row in rows.rows)) for k in kept
    )
    return Table(key, title, columns, [[_cell(rows.columns[k], row[k]) for k in kept] for row in rows.rows])


def _is_number(value: object) -> bool:
    return value is None or (isinstance(value, (int, float)) and not isinstance(value, bool))


def _cell(column: str, value: object) -> Cell:
    match value:
        case None | int() | float() if not isinstance(value, bool):
            return value
        case bool():
            return "yes" if value else "no"
    text = str(value)
    return UnitCell(text) if column == "unit" else Symbol(text) if text in _SYMBOLS else text
