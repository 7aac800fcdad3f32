"""The tutorial of a log from the field, command by command in one empty folder, with less of the data."""

import re
import shlex
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

from auvid_cli.cli.app import app
from docs.make_field import TUTORIAL, fill_in, settings

# What the page promises of each command's exit code, and how much less of the data is used here.
JUDGED = {"identify": 1, "validate": 1}
SHORTER = {"simulate field": "simulate field --set 'manoeuvre.duration=115 s'", "321:": "71:"}


@pytest.mark.slow
def test_the_commands_of_the_tutorial_lead_from_logs_to_a_prediction(
    tmp_path, monkeypatch, without_figures, fewer_starts, walked_here
):
    monkeypatch.chdir(tmp_path)
    commands = re.findall(r"(?m)^    (auvid .*)", TUTORIAL.read_text(encoding="utf-8"))
    assert len(commands) <= 1 + 8
    lateral, tuned = settings()
    Path("lateral.yaml").write_text(lateral, encoding="utf-8")
    for command in commands:
        name = command.split()[1]
        shorter = command.replace("0:320", "0:5" if name == "tune" else "0:70")
        for long, short in SHORTER.items():
            shorter = shorter.replace(long, short)
        result = CliRunner().invoke(app, shlex.split(shorter)[1:])
        assert result.exit_code in (0, JUDGED.get(name, 0)), f"{shorter}:\n{result.output}"
        if "--suggest" in command:
            found = Path("field/map.yaml").read_text(encoding="utf-8")
            assert "frame: FLU" in found
            assert "{column: Yaw_ENU, sign: -1, offset: 90 deg}" in found
            Path("field/map.yaml").write_text(fill_in(found), encoding="utf-8")
        if name == "tune":
            Path("results/survey/tuned.yaml").write_text(tuned, encoding="utf-8")
    rows = pd.read_csv("results/survey/tables/validation.csv").query("kind == 'free_run' and signal in ('v', 'r')")
    assert (rows["rmse"] < rows["vehicle_file_rmse"]).all()
    assert [*Path("results/survey/export").iterdir()]
