"""A run for the viewers of ROS recordings."""

from pathlib import Path

from auvid_cli import __version__
from auvid_cli.api.argument_types import typed
from auvid_cli.api.preparation import estimate_and_file, refuse_estimates_of_others, refuse_to_replace
from auvid_cli.config.load import dump_experiment
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.estimate_file import read_reference
from auvid_cli.data.files import keep_apart
from auvid_cli.evaluation.judgement import judge_one
from auvid_cli.export.formats import file_stem
from auvid_cli.export.heading import doubts_of
from auvid_cli.export.recording import RECORDING_LOSSES, topics_of


class RunExport:
    """A run, to be written as an MCAP file.

    Parameters
    ----------
    dataset : Dataset
        From which the estimate was made.
    estimate : Estimate
    source : pathlib.Path or None
        File of the estimate, if it is from one: the smoother's beside it judges.

    Attributes
    ----------
    file_name : str
        By vehicle and filter.
    remarks : list of str
        What speaks against the estimate, and what the file does not hold.

    Raises
    ------
    DataError
        If ROS cannot state the times of the run.
    """

    def __init__(self, dataset: Dataset, estimate: Estimate, source: Path | None) -> None:
        experiment = estimate.experiment
        self._topics = topics_of(dataset, estimate)
        self._origin = {
            "made from": f"the dataset with SHA-256 {dataset.sha256}" if dataset.sha256 else "a dataset in memory",
            "auvid": __version__,
            "filter": estimate.filter,
            "status": estimate.status,
            "settings": dump_experiment(experiment),
        }
        self.file_name = f"{file_stem(experiment.vehicle.name, estimate.filter)}.mcap"
        reference = None if source is None else read_reference(source, estimate)
        self.remarks = [*doubts_of(judge_one(estimate, reference)), *RECORDING_LOSSES]

    def write(self, file: Path) -> None:
        """Write the file; one that stands there is replaced.

        Raises
        ------
        FileError
            If it cannot be written, or the packages for it are not installed.
        """
        from auvid_cli.export.mcap_file import write_mcap

        write_mcap(file, self._topics, self._origin)


@typed
def export_run(dataset: Dataset, estimate: Estimate | str | Path, file: str | Path) -> Path:
    """Write a run as an MCAP file, for Foxglove, Rerun and ROS 2.

    ``/pose``, ``/velocity``, ``/path`` and ``/tf`` are the estimated motion, dead reckoned from its first place, in the
    axes of ROS: east, north, up, and forward, port, up (REP 103). ``/states`` has the coefficients and all else that
    was estimated, ``/innovations/SENSOR`` what each measurement said beyond its prediction, both with standard
    deviations, SI; ``/truth`` the true motion, where the dataset knows it. It needs the extra ``ros``.

    Parameters
    ----------
    dataset : Dataset
        From which the estimate was made.
    estimate : Estimate, str or pathlib.Path
        One in memory, or a file. It may have diverged.
    file : str or pathlib.Path
        To write to; one that stands there is replaced.

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    DataError
        If the estimate was made from another dataset, or ROS cannot state the times of the run.
    FileError
        If a file cannot be read or written, that of the dataset would be replaced, or mcap or rosbags is not installed.

    Examples
    --------
    >>> auvid.export_run(dataset, estimate, "dive.mcap").name
    'dive.mcap'
    """
    found, source = estimate_and_file(estimate)
    refuse_estimates_of_others(dataset, [found])
    export = RunExport(dataset, found, source)
    keep_apart([Path(file)], [] if source is None else [source])
    refuse_to_replace(dataset, Path(file))
    export.write(Path(file))
    return Path(file)
