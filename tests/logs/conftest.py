"""Conversion of a log in memory by a map."""

import pytest

from auvid_cli.config.log_map import load_map
from auvid_cli.logs.convert import convert
from tests.logs.memory_log import INPUT_MAP, VEHICLE


@pytest.fixture(scope="session")
def converted(tmp_path_factory):
    """Function: what a map makes of a log; sensors are lines of it, `inputs` and `more` too."""
    path = tmp_path_factory.mktemp("map") / "map.yaml"

    def run(log, *sensors, inputs=INPUT_MAP, more=""):
        lines = "".join(f"  {sensor}\n" for sensor in sensors)
        path.write_text(
            f"name: run\nvehicle: {VEHICLE}\nlogs: {{log: x}}\ntime: t\n{more}\nsensors:\n{lines}inputs: {inputs}\n"
        )
        return convert(*load_map(path), {"log": log})

    return run
