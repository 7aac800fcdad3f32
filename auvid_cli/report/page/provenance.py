"""Where the numbers come from: settings, hashes, versions."""

import platform
from collections.abc import Sequence
from hashlib import sha256
from importlib.metadata import version

from auvid_cli import __version__
from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.load import dump_experiment
from auvid_cli.report.page.parts import Listing, Part, TablePart
from auvid_cli.report.table import Column, Table

_LIBRARIES = ("numpy", "scipy", "numba", "h5py")


def provenance_parts(experiment: RunSettings, files: Sequence[tuple[str, str]]) -> list[Part]:
    """Return what is needed to make the same numbers again.

    Parameters
    ----------
    experiment : RunSettings
    files : sequence of (str, str)
        What each file is, and its SHA-256.
    """
    settings = dump_experiment(experiment)
    python = f"{platform.python_implementation()} {platform.python_version()}"
    rows = [
        *(["auvid", __version__], ["Python", f"{python} on {platform.system()} {platform.machine()}"]),
        *([name, version(name)] for name in _LIBRARIES),
        *([f"SHA-256 of the {what}", digest] for what, digest in files if digest),
        ["SHA-256 of the settings", sha256(settings.encode()).hexdigest()],
    ]
    columns = Column("what", numeric=False), Column("value", numeric=False)
    table = Table("versions", "Versions and hashes", columns, [[*row] for row in rows])
    return [TablePart(table), Listing("Settings as YAML: save it, and give its path to auvid run", settings)]
