"""Arguments of the Python interface, checked against the types in its signatures."""

from collections.abc import Callable
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import ParamSpec, TypeVar

from pydantic import ConfigDict, ValidationError, validate_call
from pydantic_core import ErrorDetails

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")
LOADERS = {"Experiment": "load_experiment", "Dataset": "read_dataset", "Estimate": "read_estimate"}


def checked(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Return a function that checks its arguments by their annotations before it does anything.

    Raises
    ------
    TypeError
        When it is called with an argument of another type: its name, the expected type, and the type that was given.
    """
    names = list(signature(function).parameters)
    validated = validate_call(config=ConfigDict(arbitrary_types_allowed=True, strict=True))(function)

    @wraps(function)
    def call(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        try:
            return validated(*args, **kwargs)
        except ValidationError as error:
            if error.title != function.__name__:
                raise
            raise TypeError(f"{function.__name__}: {_description(names, error.errors(include_url=False))}") from None

    return call


def _description(names: list[str], errors: list[ErrorDetails]) -> str:
    """Return what is wrong with the first argument that fails, in one line."""
    place, *_ = errors[0]["loc"]
    messages = dict.fromkeys(error["msg"] for error in errors if error["loc"][0] == place)
    expected = " or ".join(messages).replace("Input should be", "must be")
    # The arguments of `*estimates` all have its name.
    name = place if isinstance(place, str) else names[min(place, len(names) - 1)]
    value = errors[0]["input"]
    hint = next((loader for kind, loader in LOADERS.items() if kind in expected), "")
    is_name = hint and isinstance(value, str | Path)
    return f"{name}: {expected}; got {type(value).__name__}" + (f" {str(value)!r}, see {hint}" if is_name else "")
