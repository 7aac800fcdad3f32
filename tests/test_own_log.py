"""The tutorial of a log from the field, command by command in one empty folder, with less of the data."""

import re
import shlex
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from auvid_cli.api.data import import_logs
from auvid_cli.cli.app import app
from auvid_cli.data.dataset_file import read_dataset
from docs.make_field import TUTORIAL, settings

# What the page promises of each command's exit code, and how much less of the data is used here.
JUDGED = {"fit": 1, "identify": 1, "validate": 1}
SECONDS = {"fit": 20, "tune": 5}
SHORTER = {
    "simulate field": "simulate field --set 'manoeuvre.duration=90 s'",
    "321:": "51:",
    # A disturbance, which it would find, takes seconds.
    "auvid fit": "auvid fit --only fin_trim",
}


def fill_in(text: str) -> str:
    """Fill in what only the user knows of the tutorial's suggested map."""
    text = re.sub(r"(?m)^name: .*", "name: survey", text)
    for deviation in ("1 cm/s", "0.2 deg", "1 cm"):
        text = re.sub(r"standard_deviation: (?:null|estimate).*", f"standard_deviation: {deviation}", text, count=1)
    return re.sub(r"# check: no column looks like thrust.*", "surge_force: {constant: 10 N}", text)


@pytest.mark.slow
def test_the_commands_of_the_tutorial_lead_from_logs_to_a_prediction(
    tmp_path, monkeypatch, without_figures, fewer_starts, walked_here
):
    monkeypatch.chdir(tmp_path)
    commands = re.findall(r"(?m)^    (auvid .*)", TUTORIAL.read_text(encoding="utf-8"))
    assert [command.split()[1] for command in commands[:3]] == ["simulate", "import", "fit"]
    lateral, tuned = settings()
    Path("lateral.yaml").write_text(lateral, encoding="utf-8")
    for command in commands:
        name = command.split()[1]
        shorter = command.replace("0:320", f"0:{SECONDS.get(name, 50)}")
        for long, short in SHORTER.items():
            shorter = shorter.replace(long, short)
        result = CliRunner().invoke(app, shlex.split(shorter)[1:])
        assert result.exit_code in (0, JUDGED.get(name, 0)), f"{shorter}:\n{result.output}"
        if "--suggest" in command:
            found = Path("field/suggested.yaml").read_text(encoding="utf-8")
            assert "frame: FLU" in found
            assert "{column: Yaw_ENU, sign: -1, offset: 90 deg}" in found
            Path("field/suggested.yaml").write_text(fill_in(found), encoding="utf-8")
            same = read_dataset(Path("results/survey/dataset.h5")), import_logs("field/suggested.yaml")
            for name_of_sensor, record in same[0].sensors.items():
                other = same[1].sensors[name_of_sensor].values
                np.testing.assert_allclose(record.values, other, atol=1e-9, equal_nan=True)
        if name == "tune":
            Path("results/by_hand/tuned.yaml").write_text(tuned, encoding="utf-8")
    rows = pd.read_csv("results/by_hand/tables/validation.csv").query("kind == 'free_run' and signal in ('v', 'r')")
    assert (rows["rmse"] < rows["vehicle_file_rmse"]).all()
    assert [*Path("results/by_hand/export").iterdir()]
