"""Search for a model of a dataset that holds."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from auvid_cli.api import Destination
from auvid_cli.api.files import RecordedData, checked, results_folder
from auvid_cli.config.enums import JUDGE
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate_file import write_estimate
from auvid_cli.data.files import write_text
from auvid_cli.data.results import other_estimates, refuse_unless
from auvid_cli.errors import ConfigError
from auvid_cli.fitting.additions import FAMILIES
from auvid_cli.fitting.results import Fit
from auvid_cli.fitting.search import FitLimits, fit_model
from auvid_cli.report.page.pages import fit_page
from auvid_cli.report.page.render import write_page
from auvid_cli.report.text_tables import write_csv_tables

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
            objections = other_estimates(folder, source.experiment, source.dataset.sha256, [JUDGE])
            refuse_unless(place.overwrite, objections.get(path, ""))
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
