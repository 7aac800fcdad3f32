"""Shared by all tests: experiments from the shipped settings, and one simulated run."""

import gc
import os
import shutil
import signal

# Before NumPy is loaded: its own threads wait for work by turning, beside the workers of the tests a third of the time.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import hypothesis
import numpy as np
import pytest

from auvid_cli.api import COMPILED_FILTERS, load_vehicles
from auvid_cli.numerics import compile_elsewhere, is_compiled

# Where nothing is compiled yet, in two processes, as commands do it: the workers of the tests do not run before.
if not is_compiled(COMPILED_FILTERS[0]):
    gc.set_threshold(50_000)
    with compile_elsewhere(*COMPILED_FILTERS, "auvid_cli.filters.marginal") as _partner:
        load_vehicles()
        import auvid_cli.design.posterior
        import auvid_cli.identification.sensors  # noqa: F401

        wait([_partner])

from auvid_cli.api import evaluation, results
from auvid_cli.config.enums import FilterName, shipped_configs
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.loading import dump_experiment, find_experiment, load_experiment, parse_experiment
from auvid_cli.data import hdf5
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.files import write_text
from auvid_cli.identification.run import identify
from auvid_cli.report.figures import draw, workers
from auvid_cli.simulation.simulate import simulate
from auvid_cli.validation.validate import STARTS
from auvid_cli.vehicle.coefficients import COEFFICIENTS, SYMBOLS
from auvid_cli.vehicle.parameters import MOTION

# The same examples every time, and nothing written beside the tests; AUVID_RANDOM=1 draws new ones.
hypothesis.settings.register_profile(
    "auvid", deadline=None, max_examples=40, derandomize=not os.environ.get("AUVID_RANDOM"), database=None
)
hypothesis.settings.load_profile("auvid")

# A shell lets what it starts in the background ignore Ctrl-C, and processes of tests would inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

ALL_FILTERS = tuple(FilterName)
KALMAN_FILTERS = tuple(name for name in FilterName if not name.in_one_batch)
VEHICLE_FILES = tuple(sorted(path.name for path in (shipped_configs() / "vehicles").glob("*.yaml")))


def pytest_generate_tests(metafunc):
    """`filter_name` stands for each filter, `kalman_filter` for those that go from measurement to measurement.

    `vehicle_file` stands for each shipped vehicle.
    """
    for argument, names in (("filter_name", ALL_FILTERS), ("kalman_filter", KALMAN_FILTERS)):
        if argument in metafunc.fixturenames:
            metafunc.parametrize(argument, names, ids=[name.value for name in names])
    if "vehicle_file" in metafunc.fixturenames:
        metafunc.parametrize("vehicle_file", VEHICLE_FILES, ids=[Path(name).stem for name in VEHICLE_FILES])


# Short runs of tests start gently and from a wide prior, so that each estimator converges within seconds of data.
GENTLE = "manoeuvre=manoeuvres/spiral_gentle.yaml", "identification.prior.factor=3"
# Each input is an integration step, so a quarter of the usual inputs takes a quarter of the time.
FEW_INPUTS = "manoeuvre.input_rate=25 Hz"
# The period of these inputs; twice the default.
LONG_STEP = "identification.integration_step=0.04 s"
# Each is a quarter of the default.
RATES = "sensors.gyroscope.rate=25 Hz", "sensors.attitude.rate=25 Hz"


@pytest.fixture(scope="session")
def experiment_with():
    """Function: the shipped spiral experiment, started gently, with overrides as on the command line.

    Inputs of any manoeuvre change at 25 Hz, gyroscope and attitude measure at 25 Hz, and estimators integrate in steps
    of 0.04 s, unless an override states another rate or step.
    """

    @cache
    def load(*overrides: str) -> Experiment:
        few = () if any("input_rate" in override for override in overrides) else (FEW_INPUTS,)
        return load_experiment(find_experiment(None), (*GENTLE, LONG_STEP, *RATES, *overrides, *few))

    return load


@pytest.fixture(scope="session")
def simulated_with(experiment_with):
    """Function: a simulated run of the shipped spiral experiment with overrides."""

    def run(*overrides: str) -> Dataset:
        return simulate(experiment_with(*overrides))

    return run


@pytest.fixture(scope="session")
def multisine_with(simulated_with):
    """Function: 24 s of a multisine with few measurements, and overrides."""
    quick = (
        "manoeuvre=manoeuvres/multisine.yaml",
        "manoeuvre.duration=24 s",
        "manoeuvre.initial_speed=3.9 m/s",
        "manoeuvre.input_rate=10 Hz",
        "sensors.attitude={source: direct, rate: 5 Hz}",
        "sensors.gyroscope.rate=10 Hz",
        "sensors.dvl.rate=5 Hz",
        "identification.integration_step=0.05 s",
    )
    return lambda *overrides: simulated_with(*quick, *overrides)


@pytest.fixture(scope="module")
def browser():
    """Debian's Chromium, or one that CHROMIUM names."""
    sync_api = pytest.importorskip("playwright.sync_api")
    path = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
    if path is None:
        pytest.skip("no Chromium: apt-get install chromium, or name one by CHROMIUM")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def with_settings():
    """Function: the same dataset with other settings, as on the command line."""

    def change(dataset: Dataset, *overrides: str) -> Dataset:
        settings = dump_experiment(dataset.experiment)
        return replace(dataset, experiment=parse_experiment(settings, "test", overrides))

    return change


@pytest.fixture(scope="session")
def short_run(simulated_with) -> Dataset:
    """The first 60 s of the default spiral, with fewer samples; do not change its arrays."""
    return simulated_with("manoeuvre.duration=60 s", "sensors.gyroscope.rate=25 Hz", "sensors.attitude.rate=25 Hz")


@pytest.fixture(scope="session")
def short_estimates(short_run):
    """Estimates of every filter from `short_run`."""
    return {name: identify(short_run, name) for name in ALL_FILTERS}


@pytest.fixture
def hand_made(experiment_with):
    """Function: an estimate with a given course of each coefficient named; the others are held at 0."""

    def make(time, courses, status="completed", innovations=None):
        units = {c.symbol: c.unit for c in COEFFICIENTS}
        state = (*courses, *(q.symbol for q in MOTION))
        mean = np.zeros((len(time), len(state)))
        mean[:, : len(courses)] = np.transpose(list(courses.values()))
        return Estimate(
            filter="tukf",
            experiment=experiment_with(),
            state=state,
            unit=(*(units[symbol] for symbol in courses), *(q.unit for q in MOTION)),
            time=np.asarray(time, dtype=float),
            mean=mean,
            standard_deviation=np.full(mean.shape, 0.25),
            covariance=0.0625 * np.eye(len(state)),
            innovations=innovations or {},
            held={symbol: 0.0 for symbol in SYMBOLS if symbol not in courses},
            status=status,
            steps=len(time),
            cpu_time=1.0,
            wall_time=1.0,
            dataset_sha256="",
        )

    return make


@pytest.fixture(scope="session")
def leave_figures_out() -> Callable[[pytest.MonkeyPatch], None]:
    """Function that makes a monkeypatch write text files instead of figures, which take seconds to draw."""

    def save_name(request, folder, name, formats):
        paths = [folder / f"{name}.{suffix}" for suffix in formats]
        for path in paths:
            write_text(path, name)
        return paths

    @contextmanager
    def one_thread(duration: float) -> Iterator[workers.Submit]:
        with ThreadPoolExecutor(1) as executor:
            yield executor.submit

    def leave_out(patch: pytest.MonkeyPatch) -> None:
        patch.setattr(draw, "draw_and_save", save_name)
        patch.setattr(workers, "figure_workers", one_thread)
        patch.setattr(workers, "load_ahead", lambda duration=0.0: None)

    return leave_out


@pytest.fixture
def without_figures(monkeypatch, leave_figures_out) -> None:
    """Files of their names in place of figures."""
    leave_figures_out(monkeypatch)


@pytest.fixture(scope="session")
def scan_files_here() -> Callable[[pytest.MonkeyPatch], None]:
    """Function that makes a monkeypatch scan files in this process, which takes less time than a child."""

    def scan(patch: pytest.MonkeyPatch) -> None:
        patch.setattr(hdf5, "scan_in_child", lambda paths, foreign: [hdf5.flaw_of(path, foreign) for path in paths])

    return scan


@pytest.fixture
def walked_here(monkeypatch, scan_files_here) -> None:
    """Files are scanned in this process."""
    scan_files_here(monkeypatch)


@pytest.fixture
def fewer_starts(monkeypatch) -> None:
    """Validations predict ahead from a fifth of their starts, where it does not matter how well."""
    quick = partial(evaluation.predict, starts=STARTS // 5)
    for module in (evaluation, results):
        monkeypatch.setattr(module, "predict", quick)


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers, the same in every run."""
    return np.random.default_rng(20180417)


def pytest_runtest_setup(item):
    """Skip tests that need POSIX elsewhere."""
    if os.name != "posix" and item.get_closest_marker("posix"):
        pytest.skip("needs POSIX")


def pytest_configure():
    """Collect garbage seldom, as the commands do, because the imported modules are many objects that stay."""
    gc.set_threshold(50_000)


def pytest_collection_finish():
    """Leave modules and tests out of garbage collection, because they stay until the end."""
    gc.freeze()


def pytest_addoption(parser):
    parser.addoption(
        "--update-reference", action="store_true", help="write results/reference anew instead of comparing with it"
    )
