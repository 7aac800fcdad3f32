"""Which figures a run gets."""

from collections.abc import Callable
from functools import partial
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


def draw_figures(
    dataset: Dataset,
    estimates: list[Estimate],
    evaluation: Evaluation,
    folder: Path,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Path]:
    """Draw all figures, each as PNG (150 dpi) and SVG.

    Parameters
    ----------
    dataset : Dataset
    estimates : list of Estimate
    evaluation : Evaluation
        Of these estimates; its free runs are drawn against the measurements.
    folder : pathlib.Path
        Made if it is missing.
    progress : callable
        Told how many figures are done, and of how many.

    Returns
    -------
    list of pathlib.Path

    Raises
    ------
    FileError
        If a file cannot be written; it is then not there, or as it was before.
    """
    paths = []
    figures = _figures(dataset, estimates, evaluation)
    for done, (name, draw) in enumerate(figures.items(), 1):
        paths += save(draw(), folder, name)
        progress(done, len(figures))
    return paths


def _figures(dataset: Dataset, estimates: list[Estimate], evaluation: Evaluation) -> dict[str, Callable[[], Figure]]:
    """What there is to draw, each drawn when called, so that only one is held in memory."""
    figures: dict[str, Callable[[], Figure]] = {}
    if dataset.truth is not None or estimates:
        figures["path"] = partial(path_figure, dataset.truth, estimates)
    state = {symbol for estimate in estimates for symbol in estimate.state}
    for group in dict.fromkeys(c.group for c in COEFFICIENTS):
        members = [c for c in COEFFICIENTS if c.group == group and c.symbol in state]
        if members:
            true = dataset.truth.coefficients if dataset.truth is not None else {}
            figures[f"coefficients_{group}"] = partial(coefficient_figure, members, estimates, true)
    if evaluation.free_runs or dataset.sensors:
        figures["velocities"] = partial(motion_figure, MOTION[:6], dataset.sensors, evaluation.free_runs)
        figures["attitude"] = partial(motion_figure, MOTION[6:], dataset.sensors, evaluation.free_runs)
    for estimate in estimates:
        if estimate.innovations:
            figures[f"innovations_{estimate.filter}"] = partial(innovation_figure, estimate)
    return figures
