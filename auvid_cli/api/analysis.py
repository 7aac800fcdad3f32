"""Noise levels and model terms found from the data."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import auvid_cli.identification.sensors  # noqa: F401  compiled at import, not while the smoother runs
from auvid_cli.api.arguments import checked
from auvid_cli.api.files import read_dataset
from auvid_cli.api.output import Progress
from auvid_cli.config.enums import JUDGE
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.files import check_no_overlap, folder_of_dataset, locked, tables_and_figures, write_text
from auvid_cli.data.findings import TermFindings, Tuning
from auvid_cli.data.results import put_copy
from auvid_cli.evaluation.judgement import Judgement, judge_one
from auvid_cli.identification.delays import estimate_delays
from auvid_cli.identification.noise import choose_disturbance, tune_noise
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import identify
from auvid_cli.identification.terms import search_terms
from auvid_cli.report.text_tables import write_csv_tables


@checked
def tune(
    dataset: Dataset, sensors: bool = False, on_pass: Callable[[], None] | None = None, disturbance: bool = False
) -> Tuning:
    """Find the process noise, and that of the sensors if asked, that makes a dataset most likely.

    Parameters
    ----------
    dataset : Dataset
        Its truth is not looked at.
    sensors : bool, default False
        Whether the standard deviations of the sensors are found along; else they count as stated.
    on_pass : callable, optional
        Called before each pass through the data, there or back, of which there are some dozens; what it raises ends
        the search.
    disturbance : bool, default False
        Whether data are tuned without a disturbance and with one, of which it is found how large it is and how long it
        lasts, and which is kept if it is worth the numbers that it takes. Else there is one if settings ask for it, and
        it lasts as long as they say.

    Returns
    -------
    Tuning
        ``noises`` with 95 % intervals, the ``gain`` in log-likelihood, the ``choice`` of a disturbance if there was
        one, and the ``experiment`` with the tuned noise, to put into a dataset with `dataclasses.replace`;
        ``to_pandas()`` makes a table.

    Raises
    ------
    ConfigError
        If a coefficient that is to be held has no value.
    DataError
        If no sensor can be used, or no trajectory follows the data with the noise that is stated.

    Examples
    --------
    >>> tuning = auvid.tune(dataset)
    >>> [noise.setting.rpartition(".")[2] for noise in tuning.noises]
    ['velocity', 'rate', 'attitude']
    """
    find = choose_disturbance if disturbance else tune_noise
    return find(estimate_delays(prepare(dataset)), sensors, on_pass or (lambda: None))


@checked
def find_terms(
    dataset: Dataset,
    any_symmetry: bool = False,
    most: int = 4,
    say: Callable[[str], None] | None = None,
) -> TermFindings:
    """Find terms of the equations of motion that the model of a dataset lacks.

    Parameters
    ----------
    dataset : Dataset
        Its truth is not looked at. The last third is held out.
    any_symmetry : bool, default False
        Whether terms are looked for, too, that a vehicle has only if port and starboard differ.
    most : int, default 4
        How many terms are tried, each in a model of its own.
    say : callable, optional
        Called with what is being done; what it raises ends the search.

    Returns
    -------
    TermFindings
        ``found``, the terms that make held-out data likelier; ``experiment``, with these to be estimated;
        ``to_pandas()`` makes a table of all that were looked at.

    Raises
    ------
    ConfigError
        If a coefficient that is to be held has no value.
    DataError
        If no sensor can be used, or the smoother does not settle.

    Examples
    --------
    >>> findings = auvid.find_terms(dataset, most=1)
    >>> len(findings.found)
    0
    """
    return search_terms(prepare(dataset), any_symmetry, most, say or (lambda text: None))


class TunedResults(NamedTuple):
    """Results of `tune_into`.

    Attributes
    ----------
    tuning : Tuning
    fits : list of (Estimate, Judgement)
        The smoother with the stated noise, and with the tuned noise.
    files : list of pathlib.Path
        Tables that were written.
    settings : pathlib.Path
        File of settings for `identify`.
    """

    tuning: Tuning
    fits: list[tuple[Estimate, Judgement]]
    files: list[Path]
    settings: Path


class FoundTerms(NamedTuple):
    """Results of `find_terms_into`: findings, tables, and the file of settings for `identify` if a term was found."""

    findings: TermFindings
    files: list[Path]
    settings: Path | None


def tune_into(
    output: Path | None,
    path: Path,
    overrides: Sequence[str],
    overwrite: bool,
    progress: Progress,
    sensors: bool,
    disturbance: bool,
) -> TunedResults:
    """Tune the noise of a dataset file, and write tuned.yaml and a table into its results folder."""
    changes = (*overrides, "identification.noise=stated")
    dataset, folder = read_dataset(path, *changes), output or folder_of_dataset(path)
    with locked(folder):
        _prepare(folder, path, dataset, overwrite, "tuned.yaml")
        with progress.stage("fit with the stated noise") as label:
            before, passes = identify(dataset, JUDGE), 0

            def count() -> None:
                nonlocal passes
                passes += 1
                label(f"tune: pass {passes} through the data")

            tuning = tune(dataset, sensors, count, disturbance)
            label("fit with the tuned noise")
            after = identify(replace(dataset, experiment=tuning.experiment), JUDGE)
        files = write_csv_tables({"tuning": tuning.rows()}, folder / "tables")
        write_text(folder / "tuned.yaml", tuning.settings())
        fits = [(estimate, judge_one(estimate, None)) for estimate in (before, after)]
        return TunedResults(tuning, fits, files, folder / "tuned.yaml")


def find_terms_into(
    output: Path | None,
    path: Path,
    overrides: Sequence[str],
    overwrite: bool,
    progress: Progress,
    any_symmetry: bool,
    most: int,
) -> FoundTerms:
    """Find terms that the model of a dataset file lacks, and write terms.yaml and a table into its results folder."""
    dataset, folder = read_dataset(path, *overrides), output or folder_of_dataset(path)
    with locked(folder):
        _prepare(folder, path, dataset, overwrite, "terms.yaml")
        with progress.stage("fit of the model as it is") as label:
            findings = find_terms(dataset, any_symmetry, most, label)
        files = write_csv_tables({"terms": findings.rows()}, folder / "tables")
        if not findings.found:
            return FoundTerms(findings, files, None)
        write_text(folder / "terms.yaml", findings.settings())
        return FoundTerms(findings, files, folder / "terms.yaml")


def _prepare(folder: Path, path: Path, dataset: Dataset, overwrite: bool, name: str) -> None:
    """Copy a dataset into its results folder; refuse a result of that name that would replace an input."""
    files = [path, *dataset.experiment.data_files()]
    put_copy(path, dataset, folder, files, overwrite)
    check_no_overlap([folder / name, *tables_and_figures(folder)], files)
