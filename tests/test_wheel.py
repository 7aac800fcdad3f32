import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.slow
def test_the_wheel_contains_code_configs_and_published_figures(tmp_path):
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    names = set(zipfile.ZipFile(wheel).namelist())
    configs = {path.relative_to(ROOT).as_posix() for path in (ROOT / "configs").rglob("*.yaml")}
    assert {f"auvid_cli/{name}" for name in configs} <= names
    code = {path.relative_to(ROOT).as_posix() for path in (ROOT / "auvid_cli").rglob("*.py")}
    assert code | {"auvid_cli/py.typed"} <= names
    assert "auvid_cli/report/published/table_iv.csv" in names
    page = ROOT / "auvid_cli/report/page"
    brought = [path for folder in ("static", "templates") for path in (page / folder).iterdir()]
    assert len(brought) > 5
    assert {path.relative_to(ROOT).as_posix() for path in brought} <= names
