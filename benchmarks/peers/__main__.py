"""Time auvid's filters beside those of other libraries on the same data: `python -m benchmarks.peers`."""

import argparse
import sys
from collections.abc import Sequence
from importlib import import_module, metadata
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

from benchmarks.timing import Timed, described_machine, hold_to_one_core, round_robin, seconds_of

if TYPE_CHECKING:
    from benchmarks.peers.problem import Answer, Peer, Problem
    from benchmarks.peers.table import Entry

# Modules with peers, and what to install for each.
_MODULES = {
    "filterpy_filters": "filterpy",
    "numpy_ckf": "numpy",
    "stonesoup_filter": "stonesoup",
    "jax_filter": "dynamax",
}
RESULTS = Path(__file__).parents[1] / "results" / "peers.json"
_PACKAGES = ("auvid", "filterpy", "stonesoup", "dynamax", "jax", "jaxlib", "numba", "llvmlite", "numpy", "scipy")


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--events", type=int, default=2120, help="of the default experiment, from its start (20 s)")
    parser.add_argument("--repetitions", type=int, default=7, help="rounds in which all filters take turns")
    parser.add_argument(
        "--only", action="append", choices=_MODULES.values(), help="a library to set beside auvid; all without it"
    )
    parser.add_argument(
        "--keep", action="store_true", help="leave docs/performance.md and results/peers.json as they are"
    )
    return parser.parse_args()


def _gather(only: list[str] | None) -> tuple[list["Peer"], list[str]]:
    """Return the peers whose libraries are installed, and a line for each library that is not."""
    peers, left_out = [], []
    for name, package in _MODULES.items():
        if only and package not in only:
            continue
        try:
            peers.extend(import_module(f"benchmarks.peers.{name}").PEERS)
        except ModuleNotFoundError as error:
            if error.name is None or error.name.startswith("benchmarks"):
                raise
            left_out.append(f"{package} is left out, for {error.name} is not installed: `pip install {package}`")
    return peers, left_out


def _enter(peer: "Peer", reference: "Peer", problem: "Problem") -> "Entry":
    """Run a peer once, which also compiles, and auvid to the same event."""
    from benchmarks.peers.table import Entry

    print(f"first run of {peer.library} {peer.name}, {peer.process_model}", file=sys.stderr)
    part = problem.first(min(peer.max_events or len(problem.events), len(problem.events)))
    run = peer.build(part)
    answers: list[Answer] = []
    first_run = seconds_of(lambda: answers.append(run()))
    return Entry(peer, answers[0], reference.build(part)(), len(part.events), first_run, Timed(run))


def _environment(problem: "Problem", repetitions: int) -> dict[str, str]:
    installed = {distribution.name.lower() for distribution in metadata.distributions()}
    return {
        **described_machine(),
        "packages": ", ".join(f"{name} {metadata.version(name)}" for name in _PACKAGES if name in installed),
        "data": f"{len(problem.events)} events of the first {problem.timeline.time[-1]:.1f} s, "
        f"{len(problem.timeline.measurement)} measurements; {repetitions} rounds",
    }


def _overhead(bare: Sequence[float], auvid: Sequence[float], n_events: int) -> list[str]:
    """Say how long the EKF takes beside the filterpy that it is built on."""
    alone, whole = (median(seconds) / n_events * 1e6 for seconds in (bare, auvid))
    multiple = median((b - a) / a for a, b in zip(bare, auvid, strict=True))
    return [
        f"filterpy's own `predict` and `update` on 31 states, given F, H and Q: {alone:.1f} us per event",
        f"auvid's EKF, as many predictions and updates of the same sizes: {whole:.1f} us per event; the difference, "
        f"model and records included, is {multiple:.2f} times filterpy's own",
    ]


def main() -> None:
    """Run everything and write the table."""
    options = _options()
    hold_to_one_core()
    # Only now, because numerical libraries read the number of threads when they are loaded.
    from auvid_cli.data.files import write_text
    from benchmarks.peers.auvid_filters import PEERS
    from benchmarks.peers.ekf_overhead import filterpy_alone
    from benchmarks.peers.problem import make_problem
    from benchmarks.peers.table import as_json, compare, markdown
    from docs.section import replace_section

    problem = make_problem(options.events)
    references = {peer.reference: peer for peer in PEERS}
    peers, remarks = _gather(options.only)
    own = {name: _enter(peer, peer, problem) for name, peer in references.items()}
    entries = list(own.values())
    for peer in peers:
        try:
            entries.append(_enter(peer, references[peer.reference], problem))
        except (ArithmeticError, ValueError) as error:
            # An answer too: a covariance that lost definiteness, for example.
            remarks.append(f"{peer.library} {peer.name}, {peer.process_model}, failed: {error}")
    bare = Timed(filterpy_alone(problem))
    bare.run()

    round_robin([*(entry.timed for entry in entries), bare], options.repetitions)
    order = list(references)
    entries.sort(key=lambda entry: order.index(entry.peer.reference))
    rows = [compare(entry, own[entry.peer.reference], own["tukf"]) for entry in entries]
    remarks = _overhead(bare.seconds, own["ekf"].timed.seconds, len(problem.events)) + remarks
    environment = _environment(problem, options.repetitions)
    text = markdown(rows, environment, remarks)
    print(text)
    if not options.keep:
        replace_section("peers", text)
        write_text(RESULTS, as_json(rows, environment, remarks))


if __name__ == "__main__":
    main()
