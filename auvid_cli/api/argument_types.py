"""Arguments of the Python interface, held to the types that it states."""

import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache, wraps
from inspect import Signature, signature
from numbers import Real
from pathlib import Path
from types import UnionType
from typing import Any, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")
# What makes an object of those that are no plain values.
_MADE_BY = {"Experiment": "load_experiment", "Dataset": "read_dataset", "Estimate": "read_estimate"}
_MODULE = re.compile(r"[\w.]*\.(?=\w)")


def typed(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Let a function refuse what is not of the types in its signature, before it does anything.

    Raises
    ------
    TypeError
        When it is called so: which argument, of which type it is to be, and what was given.
    """

    @wraps(function)
    def checked(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        stated, types = _signature(function)
        for name, value in stated.bind(*args, **kwargs).arguments.items():
            parameter = stated.parameters[name]
            several = parameter.kind is parameter.VAR_POSITIONAL
            for each in value if several else (value,):
                if not _is_of(each, types[name]):
                    raise TypeError(_complaint(function.__name__, name, types[name], each))
        return function(*args, **kwargs)

    return checked


@cache
def _signature(function: Callable[..., object]) -> tuple[Signature, dict[str, Any]]:
    return signature(function), get_type_hints(function)


def _is_of(value: Any, stated: Any) -> bool:
    """Say whether a value is of a type as annotations state it; any real number is a float."""
    kind, inner = get_origin(stated), get_args(stated)
    if kind in (Union, UnionType):
        return any(_is_of(value, each) for each in inner)
    if stated is Any:
        return True
    if stated is float:
        return isinstance(value, Real) and not isinstance(value, bool)
    if kind is tuple:
        return _is_sequence(value) and len(value) == len(inner) and all(map(_is_of, value, inner))
    if kind is Sequence:
        return _is_sequence(value) and all(_is_of(each, inner[0]) for each in value)
    if kind is Mapping:
        return isinstance(value, Mapping) and all(
            _is_of(key, inner[0]) and _is_of(each, inner[1]) for key, each in value.items()
        )
    if kind is Callable:
        return callable(value)
    return isinstance(value, stated)


def _is_sequence(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str)


def _complaint(function: str, name: str, stated: Any, value: object) -> str:
    wanted = stated.__name__ if isinstance(stated, type) else _MODULE.sub("", str(stated))
    maker = next((maker for kind, maker in _MADE_BY.items() if kind in wanted), None)
    is_named = maker is not None and isinstance(value, str | Path)
    return f"{function}: {name} must be {wanted}, not {type(value).__name__}" + (
        f" ({str(value)!r}; {maker} makes one of it)" if is_named else ""
    )
