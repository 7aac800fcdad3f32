"""auvid: hydrodynamic coefficients of an underwater vehicle from its own manoeuvre data.

The names in `__all__` are the Python interface; each is loaded when it is first asked for, so that importing this
package takes no time.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from auvid_cli.api.data import import_logs, inspect
    from auvid_cli.api.evaluation import check, evaluate, identifiability, validate
    from auvid_cli.api.export import export_model, export_run
    from auvid_cli.api.files import load_experiment, read_dataset, read_estimate, write_dataset
    from auvid_cli.api.identification import identify
    from auvid_cli.api.results import run
    from auvid_cli.api.simulation import simulate, vehicle_from_geometry
    from auvid_cli.api.tuning import find_terms, tune
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
    "auvid_cli.api.data": ("import_logs", "inspect"),
    "auvid_cli.api.evaluation": ("check", "evaluate", "identifiability", "validate"),
    "auvid_cli.api.export": ("export_model", "export_run"),
    "auvid_cli.api.files": ("load_experiment", "read_dataset", "read_estimate", "write_dataset"),
    "auvid_cli.api.identification": ("identify",),
    "auvid_cli.api.results": ("run",),
    "auvid_cli.api.simulation": ("simulate", "vehicle_from_geometry"),
    "auvid_cli.api.tuning": ("find_terms", "tune"),
    "auvid_cli.data.dataset": ("Dataset",),
    "auvid_cli.data.estimate": ("Estimate",),
}


def __getattr__(name: str) -> Any:
    for module, names in _MODULES.items():
        if name in names:
            return getattr(import_module(module), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
