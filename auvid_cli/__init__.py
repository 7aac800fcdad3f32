"""auvid: hydrodynamic coefficients of an underwater vehicle from its own manoeuvre data.

The names in `__all__` are the Python interface; each is loaded when it is first asked for, so that importing this
package takes no time.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from auvid_cli.api.checks import check
    from auvid_cli.api.evaluation import evaluate
    from auvid_cli.api.files import load_experiment, read_dataset, read_estimate, write_dataset
    from auvid_cli.api.geometry import vehicle_from_geometry
    from auvid_cli.api.identifiability import identifiability
    from auvid_cli.api.identification import identify
    from auvid_cli.api.inspection import inspect
    from auvid_cli.api.logs import import_logs
    from auvid_cli.api.models import export_model
    from auvid_cli.api.recordings import export_run
    from auvid_cli.api.simulation import simulate
    from auvid_cli.api.terms import find_terms
    from auvid_cli.api.tuning import tune
    from auvid_cli.api.validation import validate
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
    "simulate",
    "tune",
    "validate",
    "vehicle_from_geometry",
    "write_dataset",
]
_MODULES = {
    "auvid_cli.api.checks": ("check",),
    "auvid_cli.api.evaluation": ("evaluate",),
    "auvid_cli.api.files": ("load_experiment", "read_dataset", "read_estimate", "write_dataset"),
    "auvid_cli.api.geometry": ("vehicle_from_geometry",),
    "auvid_cli.api.identifiability": ("identifiability",),
    "auvid_cli.api.identification": ("identify",),
    "auvid_cli.api.inspection": ("inspect",),
    "auvid_cli.api.logs": ("import_logs",),
    "auvid_cli.api.models": ("export_model",),
    "auvid_cli.api.recordings": ("export_run",),
    "auvid_cli.api.simulation": ("simulate",),
    "auvid_cli.api.terms": ("find_terms",),
    "auvid_cli.api.tuning": ("tune",),
    "auvid_cli.api.validation": ("validate",),
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
