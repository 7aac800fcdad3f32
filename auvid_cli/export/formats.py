"""The forms in which a model can be exported, as one table."""

import re
from collections.abc import Callable
from typing import NamedTuple

from auvid_cli.config.format_name import FormatName
from auvid_cli.errors import ConfigError
from auvid_cli.export.as_json import json_losses, json_text
from auvid_cli.export.gazebo import gazebo_losses, gazebo_text
from auvid_cli.export.holoocean import holoocean_losses, holoocean_text
from auvid_cli.export.losses import Losses, losses_of
from auvid_cli.export.matlab_function import matlab_text
from auvid_cli.export.model import IdentifiedModel
from auvid_cli.export.mss import mss_losses, mss_text
from auvid_cli.export.python_function import python_text
from auvid_cli.export.vehicle_simulator import simulator_losses, simulator_text
from auvid_cli.export.vehicle_yaml import yaml_losses, yaml_text
from auvid_cli.printable import printable


class Format(NamedTuple):
    """A form, and how to write it.

    Attributes
    ----------
    suffix : str
        Of its files, apart from those of the others.
    losses : callable
        What it cannot hold of a model.
    text : callable
        The file's text from the model, those losses, and the file's name without suffix, printable.
    """

    suffix: str
    losses: Callable[[IdentifiedModel], Losses]
    text: Callable[[IdentifiedModel, Losses, str], str]

    def file_text(self, model: IdentifiedModel, losses: Losses, stem: str) -> str:
        """Return the text of a file that may be called what is no text."""
        return self.text(model, losses, printable(stem))


FORMATS = {
    FormatName.YAML: Format(".yaml", yaml_losses, yaml_text),
    FormatName.JSON: Format(".json", json_losses, json_text),
    FormatName.PYTHON: Format(".py", losses_of, python_text),
    FormatName.MATLAB: Format(".m", losses_of, matlab_text),
    FormatName.SDF: Format(".sdf", gazebo_losses, gazebo_text),
    FormatName.HOLOOCEAN: Format("_holoocean.py", holoocean_losses, holoocean_text),
    FormatName.SIMULATOR: Format("_simulator.py", simulator_losses, simulator_text),
    FormatName.MSS: Format("_mss.m", mss_losses, mss_text),
}

# Letters of a vehicle's name in that of a file: with the filter's, fewer than a function of MATLAB may have.
_LONGEST = 32
# Python imports and MATLAB calls such files by their names.
_CALLED_BY_NAME = {FormatName.PYTHON, FormatName.MATLAB, FormatName.HOLOOCEAN, FormatName.SIMULATOR, FormatName.MSS}


def file_stem(vehicle: str, filter_name: str) -> str:
    """Return a file name without suffix, from vehicle and filter; also a name for Python and MATLAB."""
    words = re.sub(r"[^a-z0-9]+", "_", vehicle.lower())[:_LONGEST].strip("_")
    return f"{words if words[:1].isalpha() else f'vehicle_{words}'}_{filter_name}"


def check_stem(target: FormatName, stem: str) -> None:
    """Raise ConfigError if a file of that name could not be used."""
    if target in _CALLED_BY_NAME and not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,62}", stem):
        raise ConfigError(
            f"{stem!r} is no name for a {target} file, which is used by it: "
            "letters, digits and _ only, a letter first, 63 at most"
        )
