"""The kinds of figures there are, by name: what a worker loads, and nobody else."""

from collections.abc import Callable

from matplotlib.figure import Figure

from auvid_cli.report.figures.campaign_errors import map_figure, spread_figure
from auvid_cli.report.figures.convergence import convergence_figure, estimate_figure
from auvid_cli.report.figures.free_runs import free_run_figure
from auvid_cli.report.figures.identifiability import bounds_figure, correlation_figure
from auvid_cli.report.figures.innovations import innovation_figure
from auvid_cli.report.figures.mission import mission_figure
from auvid_cli.report.figures.motion import motion_figure
from auvid_cli.report.figures.motion_errors import motion_error_figure
from auvid_cli.report.figures.path import path_figure
from auvid_cli.report.figures.timeline import timeline_figure
from auvid_cli.report.figures.validation import horizon_figure

KINDS: dict[str, Callable[..., Figure]] = {
    "path": path_figure,
    "estimates": estimate_figure,
    "convergence": convergence_figure,
    "motion_errors": motion_error_figure,
    "free_runs": free_run_figure,
    "motion": motion_figure,
    "innovations": innovation_figure,
    "bounds": bounds_figure,
    "correlation": correlation_figure,
    "timeline": timeline_figure,
    "horizons": horizon_figure,
    "spread": spread_figure,
    "map": map_figure,
    "mission": mission_figure,
}
