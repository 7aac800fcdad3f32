"""auvid: hydrodynamic coefficients of an underwater vehicle from its own manoeuvre data.

The names in `__all__` are the Python interface; each is loaded when it is first asked for, so that importing this
package takes no time.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from auvid_cli.api.files import load_experiment, read_dataset, read_estimate, write_dataset
    from auvid_cli.api.identification import identify, simulate
    from auvid_cli.api.judgement import check, evaluate, identifiability, inspect, validate
    from auvid_cli.api.logs import import_logs
    from auvid_cli.api.models import export_model
    from auvid_cli.data.dataset import Dataset
    from auvid_cli.data.estimate import Estimate

__all__ = [
    "Dataset",
    "Estimate",
    "check",
    "evaluate",
    "export_model",
    "identifiability",
    "identify",
    "import_logs",
    "inspect",
    "load_experiment",
    "read_dataset",
    "read_estimate",
    "simulate",
    "validate",
    "write_dataset",
]
_MODULES = {
    "auvid_cli.api.files": ("load_experiment", "read_dataset", "read_estimate", "write_dataset"),
    "auvid_cli.api.identification": ("identify", "simulate"),
    "auvid_cli.api.judgement": ("check", "evaluate", "identifiability", "inspect", "validate"),
    "auvid_cli.api.logs": ("import_logs",),
    "auvid_cli.api.models": ("export_model",),
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
