"""Identified models for other programs."""

from pathlib import Path

from auvid_cli.api.argument_types import typed
from auvid_cli.api.preparation import estimate_and_file, refuse_estimates_of_others, refuse_to_replace
from auvid_cli.config.format_name import FormatName
from auvid_cli.config.named import named
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.estimate_file import read_reference
from auvid_cli.data.files import keep_apart, write_text
from auvid_cli.data.netcdf import digest
from auvid_cli.errors import ConfigError
from auvid_cli.export.formats import FORMATS, check_stem, file_stem
from auvid_cli.export.heading import reservations
from auvid_cli.export.losses import loss_lines
from auvid_cli.export.model import model_found_by


class Export:
    """An identified model, to be written in one form.

    Parameters
    ----------
    dataset : Dataset
        From which the estimate was made.
    estimate : Estimate
    target : FormatName
    source : pathlib.Path or None
        File of the estimate, if it is from one: the model names it, and the smoother's beside it judges.

    Attributes
    ----------
    file_name : str
        By vehicle and filter, with the suffix of the form.
    remarks : list of str
        What speaks against the model, and what the form cannot hold of it.

    Raises
    ------
    ConfigError
        If the form is not one of a model.
    DataError
        If the filter did not end well.
    """

    def __init__(self, dataset: Dataset, estimate: Estimate, target: FormatName, source: Path | None) -> None:
        sha256, reference = ("", None) if source is None else (digest(source), read_reference(source, estimate))
        if target.is_of_a_run:
            raise ConfigError(f"{target}: holds a run, not a model; export_run writes it")
        self._target, self._form = target, FORMATS[target]
        self._model = model_found_by(estimate, dataset, sha256, reference)
        self._losses = self._form.losses(self._model)
        self.file_name = f"{file_stem(self._model.experiment.vehicle.name, self._model.filter)}{self._form.suffix}"
        self.remarks = [*reservations(self._model), *loss_lines(self._losses)]

    def write(self, file: Path) -> None:
        """Write the file; one that stands there is replaced.

        Raises
        ------
        ConfigError
            If its name cannot be used for this form.
        FileError
            If it cannot be written.
        """
        write_text(file, self.text(file))

    def text(self, file: Path) -> str:
        """Return the text of a file of that name.

        Raises
        ------
        ConfigError
            If the name cannot be used for this form.
        """
        check_stem(self._target, file.stem)
        return self._form.file_text(self._model, self._losses, file.stem)


@typed
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
        ``"yaml"`` (a vehicle file), ``"json"``, ``"python"`` (needs only NumPy), ``"matlab"``, ``"sdf"`` (Gazebo),
        ``"holoocean"``, ``"simulator"`` (Python Vehicle Simulator) or ``"mss"`` (Marine Systems Simulator).
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
        If a file cannot be read or written, or the model's is that of the dataset.

    Examples
    --------
    >>> text = auvid.export_model(dataset, estimate, "python", "vehicle.py")
    >>> "def " in text
    True
    """
    form = named(FormatName, target, "form of a model")
    found, source = estimate_and_file(estimate)
    refuse_estimates_of_others(dataset, [found])
    export = Export(dataset, found, form, source)
    text = export.text(Path(export.file_name if file is None else file))
    if file is not None:
        keep_apart([Path(file)], [] if source is None else [source])
        refuse_to_replace(dataset, Path(file))
        write_text(Path(file), text)
    return text
