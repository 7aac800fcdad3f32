"""Judgements of estimates, without their data, and without the compiled code that `evaluate` loads."""

from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation import judgement
from auvid_cli.evaluation.judgement import Judgement

__all__ = ["Judgement", "judge"]


def judge(*estimates: Estimate) -> dict[str, Judgement]:
    """Judge estimates of the same data, by filter; the smoother's judges the others, if it is among them."""
    return judgement.judge(estimates)
