"""Which figures a run gets."""

from collections.abc import Iterator
from pathlib import Path

from matplotlib.figure import Figure

from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.report.figures.canvas import save
from auvid_cli.report.figures.coefficients import coefficient_figure
from auvid_cli.report.figures.innovations import innovation_figure
from auvid_cli.report.figures.motion import motion_figure
from auvid_cli.report.figures.path import path_figure
from auvid_cli.vehicle.coefficients import COEFFICIENTS
from auvid_cli.vehicle.parameters import MOTION


def draw_figures(dataset: Dataset, estimates: list[Estimate], evaluation: Evaluation, folder: Path) -> list[Path]:
    """Draw all figures, each as PNG (150 dpi) and SVG.

    Parameters
    ----------
    dataset : Dataset
    estimates : list of Estimate
    evaluation : Evaluation
        Of these estimates; its free runs are drawn against the measurements.
    folder : pathlib.Path
        Made if it is missing.

    Returns
    -------
    list of pathlib.Path

    Raises
    ------
    FileError
        If a file cannot be written; it is then not there, or as it was before.
    """
    return [path for name, figure in _figures(dataset, estimates, evaluation) for path in save(figure, folder, name)]


def _figures(dataset: Dataset, estimates: list[Estimate], evaluation: Evaluation) -> Iterator[tuple[str, Figure]]:
    """One at a time, so that only one is held in memory."""
    if dataset.truth is not None or estimates:
        yield "path", path_figure(dataset.truth, estimates)
    state = {symbol for estimate in estimates for symbol in estimate.state}
    for group in dict.fromkeys(c.group for c in COEFFICIENTS):
        members = [c for c in COEFFICIENTS if c.group == group and c.symbol in state]
        if members:
            true = dataset.truth.coefficients if dataset.truth is not None else {}
            yield f"coefficients_{group}", coefficient_figure(members, estimates, true)
    if evaluation.free_runs or dataset.sensors:
        yield "velocities", motion_figure(MOTION[:6], dataset.sensors, evaluation.free_runs)
        yield "attitude", motion_figure(MOTION[6:], dataset.sensors, evaluation.free_runs)
    for estimate in estimates:
        if estimate.innovations:
            yield f"innovations_{estimate.filter}", innovation_figure(estimate)
