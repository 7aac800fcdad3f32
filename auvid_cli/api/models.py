"""Identified models for other programs."""

from pathlib import Path

from auvid_cli.api.same_data import refuse_estimates_of_others
from auvid_cli.config.named import named
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.estimate_file import read_estimate, read_reference
from auvid_cli.data.files import keep_apart, write_text
from auvid_cli.data.netcdf import digest
from auvid_cli.export.format_name import FormatName
from auvid_cli.export.formats import FORMATS, check_stem, default_stem
from auvid_cli.export.model import model_found_by


def export_model(dataset: Dataset, estimate: Estimate | str | Path, target: str, file: str | Path | None = None) -> str:
    """Turn an estimate into a model that other programs read; its heading says what they cannot hold of it.

    Parameters
    ----------
    dataset : Dataset
        From which the estimate was made.
    estimate : Estimate, str or pathlib.Path
        One in memory, or a file, whose SHA-256 the model then names. A coefficient counts as identified if the estimate
        is sound; one of a filter is judged by the smoother's, in the file ``smoother.h5`` beside it.
    target : str
        ``"yaml"`` (a vehicle file), ``"json"``, ``"python"`` (needs only NumPy), ``"matlab"`` or ``"sdf"`` (Gazebo).
    file : str or pathlib.Path, optional
        To write the model to; one that stands there is replaced. Default: nothing is written.

    Returns
    -------
    str
        The text of the model.

    Raises
    ------
    ConfigError
        If there is no such form, or the name of the file cannot be used for it.
    DataError
        If the filter did not end well, or the estimate was made from another dataset.
    FileError
        If a file cannot be read or written.

    Examples
    --------
    >>> text = auvid.export_model(dataset, estimate, "python", "vehicle.py")
    >>> "def " in text
    True
    """
    kind, sha256, inputs, reference = named(FormatName, target, "form of a model"), "", [], None
    if not isinstance(estimate, Estimate):
        inputs = [Path(estimate)]
        estimate, sha256 = read_estimate(inputs[0]), digest(inputs[0])
        reference = read_reference(inputs[0], estimate)
    refuse_estimates_of_others(dataset, [estimate])
    model, form = model_found_by(estimate, dataset, sha256, reference), FORMATS[kind]
    path = Path(default_stem(model) if file is None else file)
    check_stem(kind, path.stem)
    text = form.file_text(model, form.losses(model), path.stem)
    if file is not None:
        keep_apart([path], inputs)
        write_text(path, text)
    return text
