"""auvid: hydrodynamic coefficients of an underwater vehicle from its own manoeuvre data.

The names in `__all__` are the Python interface. Each is loaded when it is first used, so that importing this package
is fast.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from auvid_cli._version import __version__ as __version__

if TYPE_CHECKING:
    from auvid_cli.api.analysis import find_terms, fit, tune
    from auvid_cli.api.data import import_logs, inspect
    from auvid_cli.api.evaluation import check, evaluate, identifiability, validate
    from auvid_cli.api.export import export_model, export_run
    from auvid_cli.api.files import load_experiment, read_dataset, read_estimate, write_dataset
    from auvid_cli.api.identification import identify
    from auvid_cli.api.results import run
    from auvid_cli.api.simulation import simulate, vehicle_from_geometry
    from auvid_cli.data.dataset import Dataset
    from auvid_cli.data.estimate import Estimate

__all__ = [
    "Dataset",
    "Estimate",
    "check",
    "evaluate",
    "export_model",
    "export_run",
    "find_terms",
    "fit",
    "identifiability",
    "identify",
    "import_logs",
    "inspect",
    "load_experiment",
    "read_dataset",
    "read_estimate",
    "run",
    "simulate",
    "tune",
    "validate",
    "vehicle_from_geometry",
    "write_dataset",
]
_MODULES = {
    "Dataset": "auvid_cli.data.dataset",
    "Estimate": "auvid_cli.data.estimate",
    "check": "auvid_cli.api.evaluation",
    "evaluate": "auvid_cli.api.evaluation",
    "export_model": "auvid_cli.api.export",
    "export_run": "auvid_cli.api.export",
    "find_terms": "auvid_cli.api.analysis",
    "fit": "auvid_cli.api.analysis",
    "identifiability": "auvid_cli.api.evaluation",
    "identify": "auvid_cli.api.identification",
    "import_logs": "auvid_cli.api.data",
    "inspect": "auvid_cli.api.data",
    "load_experiment": "auvid_cli.api.files",
    "read_dataset": "auvid_cli.api.files",
    "read_estimate": "auvid_cli.api.files",
    "run": "auvid_cli.api.results",
    "simulate": "auvid_cli.api.simulation",
    "tune": "auvid_cli.api.analysis",
    "validate": "auvid_cli.api.evaluation",
    "vehicle_from_geometry": "auvid_cli.api.simulation",
    "write_dataset": "auvid_cli.api.files",
}


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return getattr(import_module(_MODULES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
