"""Objects of the Python interface with values that they cannot have: each is refused in one sentence, or works."""

import copy
import pickle
import random
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.attack.cases import numbers
from benchmarks.attack.material import Material
from benchmarks.attack.outcome import Outcome

_VALUES: tuple[Any, ...] = (
    *(None, 0, 1.5, True, "x", b"x", 1j, object(), np.float64(3.0), float("nan"), [], (), {}, [1, 2], [[1], [1, 2]]),
    *({"dvl": None}, {"sonar": 1}, {1: 2}, np.zeros(0), np.zeros(3), np.zeros((3, 3)), np.zeros((3, 2)), Path("x")),
    *(
        np.array([None]),
        np.array(["a"]),
        np.ma.masked_less(np.zeros(2), 1.0),
        np.zeros(3, complex),
        np.ones((2, 2, 2)),
    ),
)
_CHANGES: Mapping[str, Callable[[Any], Any]] = {
    "as a list": lambda array: array.tolist(),
    "backward": lambda array: array[::-1],
    "all zero": lambda array: 0.0 * array,
    "short": lambda array: array[:-1],
    "empty": lambda array: array[:0],
    "all NaN": lambda array: np.nan * array,
    "infinite": lambda array: array + np.inf,
    "huge": lambda array: array + 1e300,
    "tiny": lambda array: 0.0 * array + 5e-324,
    "complex": lambda array: array + 1j,
    "masked": lambda array: np.ma.masked_less(array, 0.5),
    "text": lambda array: array.astype(str),
    "objects": lambda array: array.astype(object),
    "single precision": lambda array: array.astype(np.float32),
    "turned": lambda array: array.T,
    "one more dimension": lambda array: array[None],
    "not contiguous": lambda array: np.repeat(array, 2, axis=0)[::2],
    "read only": lambda array: np.frombuffer(np.ascontiguousarray(array).tobytes()).reshape(array.shape),
}


@cache
def _sound(results: Path) -> tuple[Any, Any]:
    import auvid_cli as auvid

    return auvid.read_dataset(results / "dataset.h5"), auvid.read_estimate(results / "estimates" / "tukf.h5")


def _changed(rng: random.Random, thing: Any) -> tuple[Any, str]:
    """Return a part with one field changed, and what was changed."""
    name = rng.choice([field.name for field in fields(thing)])
    value = getattr(thing, name)
    if isinstance(value, np.ndarray) and rng.random() < 0.6:
        change = rng.choice([*_CHANGES])
        return replace(thing, **{name: _CHANGES[change](value)}), f"{type(thing).__name__}.{name} {change}"
    new = rng.choice(_VALUES)
    return replace(thing, **{name: new}), f"{type(thing).__name__}.{name} = {str(new)[:40]!r}"


def _attempt(rng: random.Random, results: Path, folder: Path, said: list[str]) -> None:
    import auvid_cli as auvid

    dataset, estimate = _sound(results)
    part = rng.choice(("inputs", "sensor", "truth", "dataset", "estimate", "innovations"))
    said.append(part)
    if part == "inputs":
        inputs, what = _changed(rng, dataset.inputs)
        dataset = replace(dataset, inputs=inputs)
    elif part == "sensor":
        name = rng.choice([*dataset.sensors])
        record, what = _changed(rng, dataset.sensors[name])
        dataset = replace(dataset, sensors=dataset.sensors | {rng.choice((name, name, "depth", "sonar", 3)): record})
    elif part == "truth":
        truth, what = _changed(rng, dataset.truth)
        dataset = replace(dataset, truth=truth)
    elif part == "dataset":
        dataset, what = _changed(rng, dataset)
    elif part == "estimate":
        estimate, what = _changed(rng, estimate)
    else:
        innovations, what = _changed(rng, estimate.innovations["dvl"])
        estimate = replace(estimate, innovations=estimate.innovations | {"dvl": innovations})
    said.append(what)
    uses: Mapping[str, Callable[[], Any]] = {
        "write": lambda: auvid.read_dataset(folder / "x.h5") if auvid.write_dataset(folder / "x.h5", dataset) else None,
        "inspect": lambda: auvid.inspect(dataset),
        "check": lambda: auvid.check(dataset, estimate),
        "export": lambda: auvid.export_model(dataset, estimate, rng.choice(("yaml", "json"))),
        "evaluate": lambda: auvid.evaluate(dataset, estimate),
        "pandas": lambda: (dataset.to_pandas(), estimate.to_pandas(), repr(dataset), repr(estimate)),
        "pickle": lambda: (pickle.loads(pickle.dumps(dataset)), copy.deepcopy(estimate), copy.copy(dataset)),
        "identify": lambda: auvid.identify(dataset, "tukf"),
    }
    of_estimate = "check", "export", "evaluate", "pandas", "pickle"
    use = rng.choice(of_estimate if part in ("estimate", "innovations") else [*uses])
    said.append(use)
    uses[use]()


def is_bare(error: BaseException) -> bool:
    """Whether an exception has not been raised by auvid itself, or has no sentence of its own."""
    from auvid_cli.errors import AuvidError

    if isinstance(error, AuvidError):
        return False
    traceback = error.__traceback__
    while traceback is not None and traceback.tb_next is not None:
        traceback = traceback.tb_next
    own = traceback is not None and "/auvid_cli/" in traceback.tb_frame.f_code.co_filename
    return not (own and isinstance(error, TypeError | ValueError) and str(error))


def attempt(rng: random.Random, results: Path, folder: Path) -> tuple[str, str]:
    """Change a part of sound results and use it; return what was done, and the bare exception or nothing."""
    said: list[str] = []
    try:
        _attempt(rng, results, folder, said)
    except Exception as error:
        if is_bare(error):
            return ", ".join(said), f"{type(error).__name__}: {str(error)[:120]}"
    return ", ".join(said), ""


def perform(home: Path, material: Material, seed: int, index: int) -> Outcome:
    """Do one case."""
    folder = home / "objects"
    folder.mkdir(parents=True, exist_ok=True)
    what, bare = attempt(numbers(seed, "objects", index), material.results, folder)
    return Outcome("objects", index, what, [], faults={"traceback": bare} if bare else {})
