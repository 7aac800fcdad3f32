"""What stands above an exported model, in plain words."""

from auvid_cli.evaluation.accuracy import LARGEST_SHARE_OF_VALUE
from auvid_cli.evaluation.judgement import Grade, Judgement
from auvid_cli.export.losses import Losses, loss_lines
from auvid_cli.export.model import IdentifiedCoefficient, IdentifiedModel


def heading_lines(model: IdentifiedModel, losses: Losses) -> list[str]:
    """Write vehicle, filter, origin, doubts and losses, a line each; for `auvid_cli.export.comment`."""
    experiment, origin = model.experiment, model.origin
    return [
        f"{experiment.vehicle.name}: coefficients identified by {model.filter}",
        f"Exported by auvid {origin.auvid_version} at {origin.created}",
        f"from {origin.estimate},",
        f"made from {origin.dataset}",
        f"(experiment {experiment.name}, seed {experiment.seed}; all settings stand in the estimate file).",
        *reservations(model),
        *loss_lines(losses),
    ]


def reservations(model: IdentifiedModel) -> list[str]:
    """Say what speaks against the estimate and its coefficients, a sentence each."""
    doubts = doubts_of(model.judgement)
    if doubts or not model.not_identified():
        return doubts
    share = f"uncertain by more than {LARGEST_SHARE_OF_VALUE:.0%} of their value"
    return [f"Not identified by these data, {share}: {', '.join(model.not_identified())}."]


def doubts_of(judgement: Judgement) -> list[str]:
    """Say why an estimate is not sound; nothing if it is."""
    return [] if judgement.grade is Grade.SOUND else [f"Do not rely on these values, {judgement}."]


def certainty(coefficient: IdentifiedCoefficient) -> str:
    """Say how sure a coefficient is, as a remark beside its value."""
    if coefficient.standard_deviation is None:
        return "held, not estimated"
    remark = f"standard deviation {coefficient.standard_deviation!r}"
    return remark if coefficient.identified else f"{remark}; identified: false"
