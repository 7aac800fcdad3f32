"""auvid's own filters, as `auvid run` calls them."""

from collections.abc import Callable

from auvid_cli.filters.problem import OK, Records
from benchmarks.peers.problem import Answer, Peer, Problem


def _filter(name: str) -> Callable[[Problem], Callable[[], Answer]]:
    def build(problem: Problem) -> Callable[[], Answer]:
        records: list[Records] = []

        def run() -> Answer:
            records.clear()
            outcome = problem.filters[name]([problem.timeline], lambda _, part: records.append(part))
            if outcome.failure != OK:
                raise ArithmeticError(f"auvid {name} diverged after {outcome.n_good} events")
            return Answer(records[-1].mean[-1], outcome.covariance)

        return run

    return build


PEERS = tuple(
    Peer(label, "auvid", "compiled", name, _filter(name))
    for name, label in {
        "ekf": "EKF",
        "ekf exact": "EKF, exact transition",
        "ckf": "CKF",
        "tukf": "TUKF",
        "ukf": "UKF",
    }.items()
)
