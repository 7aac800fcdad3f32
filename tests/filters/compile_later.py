"""Compilation at the first use instead of at import, so that a worker without these tests does not wait for it."""

from collections.abc import Callable
from functools import cache
from typing import Any

from numba import njit


def compile_later(signature: Any) -> Callable[[Callable], Callable[[], Callable]]:
    """Decorator: a function without arguments that returns the decorated one compiled."""

    def decorate(function: Callable) -> Callable[[], Callable]:
        return cache(lambda: njit(signature)(function))

    return decorate
