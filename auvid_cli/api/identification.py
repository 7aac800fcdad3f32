"""Identification."""

from pathlib import Path

from auvid_cli.api.argument_types import typed
from auvid_cli.api.preparation import refuse_to_replace
from auvid_cli.config.filter_name import FilterName
from auvid_cli.config.named import named
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.estimate_file import record_estimate
from auvid_cli.identification import identify as filters
from auvid_cli.identification.identify import with_noise_settled
from auvid_cli.identification.prepared_data import prepare

__all__ = ["identify", "with_noise_settled"]


@typed
def identify(dataset: Dataset, filter_name: str, file: str | Path | None = None) -> Estimate:
    """Estimate coefficients and motion from a dataset, by its settings; its truth is not looked at.

    Parameters
    ----------
    dataset : Dataset
    filter_name : str
        ``"ekf"``, ``"ckf"``, ``"tukf"``, ``"ukf"``, ``"smoother"`` or ``"output_error"``.
    file : str or pathlib.Path, optional
        To write the estimate to as it comes, which hours of data need; one that stands there is replaced. It is then as
        `read_estimate` reads it.

    Returns
    -------
    Estimate
        Mean and standard deviation of the augmented state, shape (events, states), SI. One that diverged ends early,
        and its ``status`` says why.

    Raises
    ------
    ConfigError
        If there is no such filter, or the settings cannot be used with it.
    DataError
        If no sensor can be used, or the inputs end too early.
    FileError
        If the file cannot be written, or is the dataset itself.

    Examples
    --------
    >>> estimate = auvid.identify(dataset, "tukf")
    >>> estimate.status, round(estimate.final_coefficients()["X_u|u|"])
    ('completed', -5)
    """
    name = named(FilterName, filter_name, "filter")
    if file is None:
        return filters.identify(dataset, name)
    refuse_to_replace(dataset, Path(file))
    (run,) = filters.set_up_filters(with_noise_settled(prepare(dataset)), [name])
    return record_estimate(Path(file), run.header, run.run)
