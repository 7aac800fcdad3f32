"""Noise levels, model terms and a whole model, found from the data."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from pathlib import Path
from time import monotonic
from typing import NamedTuple

import auvid_cli.identification.sensors  # noqa: F401  compiled at import, not while the smoother runs
from auvid_cli.api import Destination
from auvid_cli.api.files import RecordedData, checked, read_dataset, results_folder
from auvid_cli.api.identification import stoppable_threads
from auvid_cli.config.enums import JUDGE
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.estimate_file import read_estimate, write_estimate
from auvid_cli.data.files import write_text
from auvid_cli.data.findings import TermFindings, Tuning
from auvid_cli.data.results import other_estimates, refuse_unless
from auvid_cli.errors import ConfigError
from auvid_cli.evaluation.judgement import Judgement, judge_one
from auvid_cli.fitting.additions import FAMILIES
from auvid_cli.fitting.results import Fit, with_model
from auvid_cli.fitting.search import FitLimits, fit_model
from auvid_cli.identification.delays import estimate_delays
from auvid_cli.identification.noise import OnProgress, TuningProgress, choose_disturbance, tune_noise
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.problem_setup import Motion
from auvid_cli.identification.run import identify
from auvid_cli.identification.terms import search_terms
from auvid_cli.report.page.pages import fit_page
from auvid_cli.report.page.render import write_page
from auvid_cli.report.text_tables import write_csv_tables

# Time after which the next pass of a tuning prints a line of progress, s.
_BETWEEN_MESSAGES = 30.0


@checked
def tune(
    dataset: Dataset, sensors: bool = False, on_pass: Callable[[], None] | None = None, disturbance: bool = False
) -> Tuning:
    """Estimate the process noise, and optionally the sensor noise, of a dataset by maximum likelihood.

    Parameters
    ----------
    dataset : Dataset
        Its truth is not used.
    sensors : bool, default False
        Whether the standard deviations of the sensors are estimated as well.
    on_pass : callable, optional
        Called before each forward or backward pass through the data (some dozens). An exception from it ends the
        search.
    disturbance : bool, default False
        Whether to tune without and with a disturbance. Its size and time constant are estimated, and it is kept if the
        data justify the additional parameters. Otherwise the settings decide.

    Returns
    -------
    Tuning
        ``noises`` with 95 % intervals, the ``gain`` in log-likelihood, the ``choice`` of a disturbance if tried,
        and the ``experiment`` with the tuned noise, for `Dataset.with_settings`; ``to_pandas()``
        makes a table.

    Raises
    ------
    ConfigError
        If a fixed coefficient has no value.
    DataError
        If no sensor is usable, or no trajectory follows the data with the noise of the settings.

    Examples
    --------
    >>> tuning = auvid.tune(dataset)
    >>> [noise.setting.rpartition(".")[2] for noise in tuning.noises]
    ['velocity', 'rate', 'attitude']
    """
    return _tune(dataset, sensors, disturbance, lambda progress: on_pass() if on_pass else None)[0]


def _tune(dataset: Dataset, sensors: bool, disturbance: bool, on_progress: OnProgress) -> tuple[Tuning, Motion]:
    find = choose_disturbance if disturbance else tune_noise
    return find(estimate_delays(prepare(dataset)), sensors, on_progress)


@checked
def find_terms(
    dataset: Dataset,
    any_symmetry: bool = False,
    most: int = 4,
    say: Callable[[str], None] | None = None,
) -> TermFindings:
    """Find terms of the equations of motion that are missing in the model of a dataset.

    Parameters
    ----------
    dataset : Dataset
        Its truth is not used. The last third is held out.
    any_symmetry : bool, default False
        Whether to try terms that break the symmetry of port and starboard as well.
    most : int, default 4
        Largest number of terms to add.
    say : callable, optional
        Called with a description of each step. An exception from it ends the search.

    Returns
    -------
    TermFindings
        ``found``: terms that raise the likelihood of the held-out data; ``experiment``: settings that estimate them;
        ``to_pandas()`` makes a table of all candidates.

    Raises
    ------
    ConfigError
        If a fixed coefficient has no value.
    DataError
        If no sensor is usable, or the smoother does not converge.

    Examples
    --------
    >>> findings = auvid.find_terms(dataset, most=1)
    >>> len(findings.found)
    0
    """
    return search_terms(prepare(dataset), any_symmetry, most, say or (lambda text: None))


class TunedResults(NamedTuple):
    """Tuned noise, smoother estimates before and after, written tables, and the settings file for `identify`."""

    tuning: Tuning
    fits: list[tuple[Estimate, Judgement]]  # empty if they were interrupted
    files: list[Path]
    settings: Path


class FoundTerms(NamedTuple):
    """Found terms, written tables, and the settings file for `identify` if a term was found."""

    findings: TermFindings
    files: list[Path]
    settings: Path | None


def tune_into(
    place: Destination, path: Path, overrides: Sequence[str], sensors: bool, disturbance: bool
) -> TunedResults:
    """Tune the noise of a dataset file, and write tuned.yaml and a table into its results folder."""
    dataset = read_dataset(path, *overrides, "identification.noise=stated")
    progress = place.progress
    with results_folder(place, RecordedData(path, dataset), new=["tuned.yaml"]) as folder:
        with progress.stage("tune") as label, stoppable_threads(2) as (threads, raise_if_stopping):
            latest: TuningProgress | None = None
            as_stated: Future[Estimate] | None = None
            begin = printed = monotonic()

            def fit(data: Dataset, start: Motion) -> Future[Estimate]:
                return threads.submit(identify, data, JUDGE, start, raise_if_stopping)

            def show(now: TuningProgress) -> None:
                nonlocal latest, as_stated, begin, printed
                before, latest, time = latest, now, monotonic()
                if before is not None and now.search.passes < before.search.passes:
                    begin = time
                label(text := f"tune: {now}{_time_left(now.search.share, time - begin)}")
                is_next = before is None or now.search.trajectories != before.search.trajectories
                if is_next or time - printed > _BETWEEN_MESSAGES:
                    printed = time
                    progress.message(text)
                if as_stated is None and now.so_far is not None and not now.begins_with_part:
                    # The fit with the noise of the settings needs a start, but not the end of the search.
                    as_stated = fit(dataset, now.so_far()[1])

            progress.message("tune: finding a motion that follows the data")
            try:
                tuning, motion = _tune(dataset, sensors, disturbance, show)
            except KeyboardInterrupt:
                if latest is None or latest.so_far is None:
                    raise
                tuning, motion = latest.so_far()
                progress.message("interrupted: the noise found so far is kept; Ctrl-C again leaves out the fits")
            files = write_csv_tables({"tuning": tuning.rows()}, folder / "tables")
            write_text(folder / "tuned.yaml", tuning.settings())
            label(text := "tune: fits with the noise of the settings, and with the tuned noise")
            progress.message(text)
            tuned = fit(dataset.with_settings(tuning.experiment), motion)
            # It has not begun if the data are long, or if an interrupt came before.
            as_stated = as_stated or fit(dataset, motion)
            estimates: list[Estimate] = []
            try:
                estimates = [as_stated.result(), tuned.result()]
            except KeyboardInterrupt:
                progress.message("interrupted: the noise is kept, but not compared with that of the settings")
        fits = [(estimate, judge_one(estimate, None)) for estimate in estimates]
        return TunedResults(tuning, fits, files, folder / "tuned.yaml")


def _time_left(share: float, elapsed: float) -> str:
    """Return about how long a search still takes, after a share of it; empty at the start."""
    return f", about {elapsed * (1.0 - share) / share:.0f} s left in this search" if share > 0.0 else ""


def find_terms_into(
    place: Destination, path: Path, overrides: Sequence[str], any_symmetry: bool, most: int
) -> FoundTerms:
    """Find terms missing in the model of a dataset file, and write terms.yaml and a table into its results folder."""
    dataset = read_dataset(path, *overrides)
    with results_folder(place, RecordedData(path, dataset), new=["terms.yaml"]) as folder:
        with place.progress.stage("fit of the present model") as label:
            findings = find_terms(dataset, any_symmetry, most, label)
        files = write_csv_tables({"terms": findings.rows()}, folder / "tables")
        if not findings.found:
            return FoundTerms(findings, files, None)
        write_text(folder / "terms.yaml", findings.settings())
        return FoundTerms(findings, files, folder / "terms.yaml")


_PAGE = "fit.html"


@checked
def fit(
    dataset: Dataset,
    only: Sequence[str] = (),
    excluded: Sequence[str] = (),
    max_time: float = float("inf"),
    ignore_inspection: bool = False,
    on_step: Callable[[str], None] | None = None,
) -> Fit:
    """Find a model that explains a dataset: errors, delays, noise, disturbance and terms, one addition after another.

    Parameters
    ----------
    dataset : Dataset
        Its settings are the first model. Its truth is not used.
    only, excluded : sequence of str, optional
        Kinds of additions that may be tried, or not: the names of `identification.estimate.biases`, ``"walk"``,
        ``"noise"``, ``"lag"``, ``"term"`` and ``"prior"``.
    max_time : float, optional
        Processor time after which the search ends with the best model so far, s.
    ignore_inspection : bool, optional
        Whether to search even if the inspection finds a wrong sign, unit, axis or clock.
    on_step : callable, optional
        Called with a description of each step. A KeyboardInterrupt ends the stage; the best model so far is kept.

    Returns
    -------
    Fit
        ``estimate`` of the smoother with its ``judgement``, the ``steps``, and the ``experiment`` with the settings of
        the model; ``to_pandas()`` makes a table of the steps.

    Raises
    ------
    ConfigError
        If a kind is unknown, or a fixed coefficient has no value.
    DataError
        If the inspection finds a wrong sign, unit, axis or clock, no sensor is usable, or no trajectory follows the
        data.

    Examples
    --------
    >>> found = auvid.fit(dataset)
    >>> str(found.judgement.grade), found.added
    ('sound', ())
    """
    for name in (*only, *excluded):
        if name not in FAMILIES:
            raise ConfigError(f"unknown kind of addition {name!r}; expected one of {', '.join(FAMILIES)}")
    return fit_model(
        dataset, FitLimits(tuple(only), tuple(excluded), max_time, ignore_inspection), on_step or (lambda text: None)
    )


class FitResult(NamedTuple):
    """A found model, the results folder, the written files, the settings file for `identify`, and the page."""

    fit: Fit
    folder: Path
    files: list[Path]
    settings: Path
    page: Path


def fit_into(
    place: Destination,
    source: RecordedData,
    only: Sequence[str] = (),
    excluded: Sequence[str] = (),
    max_time: float = float("inf"),
    ignore_inspection: bool = False,
) -> FitResult:
    """Find a model of a dataset, and write estimate, settings, steps and page into its results folder."""
    with results_folder(place, source, new=["fit.yaml"], page=_PAGE) as folder:
        path = folder / "estimates" / f"{JUDGE.value}.h5"
        if path.exists():
            settings = source.experiment
            if (folder / "fit.yaml").is_file():
                # The result of an earlier search, which is repeated.
                settings = with_model(settings, read_estimate(path).experiment)
            objection = other_estimates(folder, settings, source.dataset.sha256, [JUDGE]).get(path, "")
            refuse_unless(place.overwrite, objection)
        with place.progress.stage("fit") as label:

            def show(step: str) -> None:
                label(step)
                place.progress.message(step)

            found = fit(source.dataset, only, excluded, max_time, ignore_inspection, show)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_estimate(path, found.estimate)
        write_text(folder / "fit.yaml", found.settings())
        files = [path, folder / "fit.yaml", *write_csv_tables({"fit_steps": found.rows()}, folder / "tables")]
        page = write_page(fit_page(source.dataset, found), folder / _PAGE)
        return FitResult(found, folder, files, folder / "fit.yaml", page)
