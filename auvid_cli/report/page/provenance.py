"""Where the numbers come from: settings, hashes, versions."""

import platform
from hashlib import sha256
from importlib.metadata import version

from auvid_cli import __version__
from auvid_cli.config.campaign import Campaign, dump_campaign
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.load import dump_experiment
from auvid_cli.data.dataset import Dataset
from auvid_cli.report.page.parts import Listing, Section, TablePart
from auvid_cli.report.table import Column, Table

_LIBRARIES = ("numpy", "scipy", "numba", "h5py")


def what_ran(dataset: Dataset) -> str:
    """Say how long data are, and of which manoeuvre where they are simulated."""
    duration = f"{dataset.inputs.time[-1] - dataset.inputs.time[0]:.6g} s"
    if dataset.truth is None or not isinstance(dataset.experiment, Experiment):
        return duration
    return f"{dataset.experiment.manoeuvre.type.replace('_', ' ')} of {duration}"


def provenance_section(dataset: Dataset) -> Section:
    """Return what is needed to make the same numbers again.

    Parameters
    ----------
    dataset : Dataset
        With the settings that count.
    """
    return _section(dump_experiment(dataset.experiment), "auvid run", dataset.sha256)


def campaign_provenance(campaign: Campaign) -> Section:
    """Return what is needed to make the runs of a campaign again."""
    return _section(dump_campaign(campaign), "auvid campaign", "")


def _section(settings: str, command: str, of_dataset: str) -> Section:
    python = f"{platform.python_implementation()} {platform.python_version()}"
    rows = [
        *(["auvid", __version__], ["Python", f"{python} on {platform.system()} {platform.machine()}"]),
        *([name, version(name)] for name in _LIBRARIES),
        *([["SHA-256 of the dataset", of_dataset]] if of_dataset else []),
        ["SHA-256 of the settings", sha256(settings.encode()).hexdigest()],
    ]
    columns = Column("what", numeric=False), Column("value", numeric=False)
    table = Table("versions", "Versions and hashes", columns, [[*row] for row in rows])
    listing = Listing(f"Settings as YAML: save it, and give its path to {command}", settings)
    return Section("settings", "Settings, hashes, versions", [TablePart(table), listing])
