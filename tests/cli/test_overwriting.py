"""Which files of a results folder may be replaced."""

import hashlib
import shutil
from pathlib import Path

import pytest

import auvid_cli.data.results
from auvid_cli.config.enums import shipped_configs
from auvid_cli.data.files import dataset_in, products
from auvid_cli.errors import SimulationError

from .conftest import assert_one_clear_complaint, auvid

SHORT = ("--set", "manoeuvre.duration=6 s", "--set", "identification.judge=false")
HOME = Path("results/spiral")


def done(*arguments):
    result = auvid(*arguments)
    assert result.exit_code in (0, 1), result.output
    return result


def state(folder=Path()) -> dict[str, str]:
    """All files and what is in them."""
    return {str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in files(folder)}


def files(folder) -> list[Path]:
    """Files of a folder, without the lock."""
    return [path for path in sorted(folder.rglob("*")) if path.is_file() and path.name != ".lock"]


def assert_refused(*arguments, words=()):
    before = state()
    result = auvid(*arguments)
    assert result.exit_code == 2, result.output
    assert len(result.stderr.splitlines()) == 1
    for word in ("auvid: ", "--output", "--overwrite", *words):
        assert word in result.stderr
    assert state() == before


@pytest.fixture(scope="module")
def made(tmp_path_factory, leave_figures_out):
    """A folder in which everything has been made from one run; figures are drawn by other tests."""
    folder = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        leave_figures_out(patch)
        patch.chdir(folder)
        done("run", *SHORT, "-f", "ckf", "-f", "tukf")
        done("check", HOME)
        done("inspect", dataset_in(HOME))
        done("identifiability", dataset_in(HOME))
        done("simulate", *SHORT, "--seed", "2", "-o", "results/other")
        done("validate", HOME / "estimates/ckf.h5", "results/other/dataset.h5")
        for form in ("yaml", "json", "python", "matlab", "sdf"):
            done("export", HOME / "estimates/ckf.h5", "--to", form)
    return folder


@pytest.fixture
def here(made, tmp_path, monkeypatch, without_figures):
    """A copy of that as the current folder."""
    folder = tmp_path / "here"
    shutil.copytree(made, folder)
    monkeypatch.chdir(folder)
    return folder


@pytest.mark.slow
def test_every_written_file_is_listed_as_product(here):
    for folder in (HOME, Path("results/other")):
        assert {*files(folder)} == {dataset_in(folder), *products(folder)}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "words"),
    [
        (("run", *SHORT, "--seed", "3"), ("results/spiral/dataset.h5", "`seed`")),
        (("simulate", *SHORT, "--set", "sensors.dvl.rate=5 Hz"), ("`sensors`",)),
        (("run", *SHORT, "--set", "identification.prior.factor=2"), ("`identification`",)),
        (("identifiability", *SHORT, "--seed", "3"), ("`seed`",)),
        (("identify", "results/other/dataset.h5", "-o", HOME), ("holds other data than results/other/dataset.h5",)),
        (("inspect", "results/other/dataset.h5", "-o", HOME), ("holds other data",)),
        (("identifiability", "results/other/dataset.h5", "-o", HOME), ("holds other data",)),
        (
            ("identify", dataset_in(HOME), "-f", "ckf", "--set", "identification.prior.factor=2"),
            ("ckf.h5", "`identification`"),
        ),
        (("identify", dataset_in(HOME), "-f", "ukf", "--use", "1:5"), ("ckf.h5", "`identification`")),
        (("export", HOME / "estimates/ckf.h5", "--to", "json", "-o", "notes.json"), ("notes.json: exists",)),
    ],
)
def test_other_data_or_settings_are_refused_without_changes(here, command, words):
    Path("notes.json").write_text("{}")
    assert_refused(*command, words=words)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "page"),
    [
        (("run", *SHORT), HOME / "report.html"),
        (("report", HOME), HOME / "report.html"),
        (("inspect", dataset_in(HOME)), HOME / "inspection.html"),
        (("identifiability", dataset_in(HOME)), HOME / "identifiability.html"),
        (("identifiability", *SHORT), HOME / "identifiability.html"),
        (("validate", HOME / "estimates/ckf.h5", "results/other/dataset.h5"), Path("results/other/validation.html")),
    ],
)
def test_page_of_other_program_is_not_overwritten(here, command, page):
    page.write_text("<h1>Mine</h1>")
    before = state()
    assert_one_clear_complaint(auvid(*command), f"{page}: is not a page of auvid's")
    assert state() == before


@pytest.mark.slow
@pytest.mark.parametrize("text", [b"not a dataset", b""])
def test_other_file_named_dataset_is_not_replaced(here, text):
    dataset_in(HOME).write_bytes(text)
    assert_refused("run", *SHORT, words=("dataset.h5",))
    assert_refused("simulate", *SHORT)


@pytest.mark.slow
def test_results_without_their_dataset_are_not_replaced(here):
    dataset_in(HOME).unlink()
    assert_refused("run", *SHORT, words=("estimates/ckf.h5", "missing now"))
    shutil.rmtree(HOME / "estimates")
    assert_refused("simulate", *SHORT, words=("tables/",))


@pytest.mark.slow
def test_a_repetition_keeps_the_dataset_and_estimates_of_other_filters(here):
    before = state(HOME)
    done("simulate", *SHORT)
    assert state(HOME) == before
    done("run", *SHORT, "-f", "tukf")
    after = state(HOME)
    for name in ("dataset.h5", "estimates/ckf.h5"):
        assert after[str(HOME / name)] == before[str(HOME / name)]
    assert done("report", HOME).exit_code in (0, 1)


def test_other_numbers_by_the_same_settings_are_not_replaced(here, monkeypatch):
    monkeypatch.setattr(auvid_cli.data.results, "holds_data", lambda path, dataset: False)
    assert_refused("run", *SHORT, words=("other data than auvid",))


@pytest.mark.slow
@pytest.mark.parametrize("command", ["run", "simulate"])
def test_overwrite_removes_stale_results_and_keeps_user_files(here, command):
    notes = [HOME / name for name in ("notes.txt", "tables/mine.csv", "figures/sketch.pdf", "export/mine.json")]
    for path in notes:
        path.write_text("{}")
    before = {path: path.stat().st_mtime_ns for path in products(HOME)}
    done(command, *SHORT, "--seed", "3", *(("-f", "ukf") if command == "run" else ()), "--overwrite")
    assert not [path for path in products(HOME) if path.stat().st_mtime_ns == before.get(path)]
    assert all(path.is_file() for path in notes)
    assert [path.name for path in (HOME / "estimates").glob("*")] == (["ukf.h5"] if command == "run" else [])
    assert not (HOME / "tables/identifiability.csv").exists()


def test_a_simulation_that_fails_loses_nothing(here, monkeypatch):
    def capsize(experiment):
        raise SimulationError("capsized")

    monkeypatch.setattr("auvid_cli.simulation.simulate.simulate", capsize)
    before = state()
    assert auvid("run", *SHORT, "--seed", "3", "--overwrite").exit_code == 2
    assert state() == before


@pytest.mark.slow
def test_identify_with_other_settings_removes_old_results(here):
    done("identify", dataset_in(HOME), "-f", "ukf", "--use", "1:5", "--overwrite")
    assert {*files(HOME)} == {dataset_in(HOME), HOME / "estimates/ukf.h5"}


@pytest.mark.slow
def test_settings_of_one_filter_may_differ(here):
    done("identify", dataset_in(HOME), "-f", "ukf", "--set", "identification.ukf.alpha=0.2")
    done("identify", dataset_in(HOME), "-f", "tukf")
    done("report", HOME)
    assert_refused("identify", dataset_in(HOME), "-f", "ukf", words=("ukf.h5", "`identification`"))


@pytest.mark.slow
def test_a_report_never_mixes_settings(here):
    done("identify", dataset_in(HOME), "-f", "ukf", "--use", "1:5", "-o", "part")
    shutil.copy("part/estimates/ukf.h5", HOME / "estimates/ukf.h5")
    result = auvid("report", HOME)
    assert result.exit_code == 2
    assert "ukf.h5: was made with other settings of `identification`" in result.stderr


@pytest.mark.slow
def test_estimate_under_name_of_other_filter_is_refused(here):
    shutil.copy(HOME / "estimates/ckf.h5", HOME / "estimates/ekf.h5")
    result = auvid("report", HOME)
    assert result.exit_code == 2
    assert "ekf.h5: is an estimate of ckf" in result.stderr


@pytest.mark.slow
def test_report_removes_results_of_missing_filter(here):
    (HOME / "estimates/ckf.h5").unlink()
    done("report", HOME)
    assert not [path for path in products(HOME) if path.name.startswith("innovations_ckf")]
    assert "ckf" not in (HOME / "tables/checks.csv").read_text(encoding="utf-8")
    assert (HOME / "figures/timeline.png").exists()


def test_a_dry_run_refuses_nothing(here):
    before = state()
    for command in ("run", "simulate", "identify"):
        assert auvid(command, *SHORT, "--set", "seed=3", "--dry-run").exit_code == 0
    assert state() == before


@pytest.mark.slow
def test_a_model_is_exported_again_from_the_same_data(here):
    done("export", HOME / "estimates/ckf.h5", "--to", "yaml")
    done("export", HOME / "estimates/tukf.h5", "--to", "yaml", "-o", "model.yaml")
    done("run", *SHORT, "--seed", "3", "-f", "tukf", "--overwrite")
    assert_refused("export", HOME / "estimates/tukf.h5", "--to", "yaml", "-o", "model.yaml", words=("model.yaml",))
    done("export", HOME / "estimates/tukf.h5", "--to", "yaml", "-o", "model.yaml", "--overwrite")


def test_a_campaign_does_not_mix_with_a_run(here):
    Path("small.yaml").write_text("name: small\n")
    before = state()
    result = auvid("campaign", "small.yaml", "-o", HOME)
    assert (result.exit_code, state()) == (2, before)
    assert "results of a run" in result.stderr


@pytest.mark.parametrize("link", [Path.hardlink_to, Path.symlink_to])
def test_settings_files_are_never_overwritten(here, link):
    vehicle = Path("mine.yaml").absolute()
    shutil.copy(shipped_configs() / "vehicles/vt690.yaml", vehicle)
    text = vehicle.read_bytes()
    (HOME / "tables/summary.csv").unlink()
    link(HOME / "tables/summary.csv", vehicle)
    for options in ((), ("--overwrite",)):
        result = auvid("run", *SHORT, "--set", f"vehicle={vehicle}", "-f", "ckf", *options)
        assert result.exit_code == 2
        assert "would be written over" in result.stderr
    assert vehicle.read_bytes() == text


def test_estimate_used_as_prior_is_not_overwritten(here):
    prior = f"identification.prior.from_estimate={Path(HOME / 'estimates/ckf.h5').absolute()}"
    before = state()
    for command in (("run", *SHORT, "--seed", "3"), ("identify", "results/other/dataset.h5")):
        result = auvid(*command, "--set", prior, "-f", "ckf", "-o", HOME, "--overwrite")
        assert result.exit_code == 2
        assert "would be written over" in result.stderr
        assert state() == before


@pytest.mark.slow
def test_the_validated_estimate_is_not_removed_with_its_folder(here):
    estimate = HOME / "estimates/ckf.h5"
    before = state()
    result = auvid("validate", estimate, "results/other/dataset.h5", "-o", HOME, "--overwrite")
    assert (result.exit_code, state()) == (2, before)
    assert "would be written over" in result.stderr
