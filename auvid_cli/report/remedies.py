"""What may help filters that diverged or were led astray."""

from collections.abc import Sequence

from auvid_cli.config.augmented_states import BiasName
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation.consistency import status_of
from auvid_cli.report.notation import filter_label

# Errors with which a DVL is no linear sensor.
_NONLINEAR = (BiasName.DVL, BiasName.CURRENT)
# Times the natural magnitudes: a prior that suits most runs, and one for these errors.
_NARROW, _NARROWER = 1.0, 0.3


def remedies(estimates: Sequence[Estimate]) -> list[str]:
    """Return a line for each remedy with the filters that it is for; none where only a closer look will help."""
    labels_by_remedy: dict[str, list[str]] = {}
    for estimate in estimates:
        remedy = _remedy(estimate)
        if remedy is not None:
            labels_by_remedy.setdefault(remedy, []).append(filter_label(estimate.filter))
    return [f"{', '.join(labels)}: {remedy}" for remedy, labels in labels_by_remedy.items()]


def _remedy(estimate: Estimate) -> str | None:
    if status_of(estimate) == "completed":
        return None
    settings, is_fit = estimate.experiment.identification, estimate.is_free_run_fit
    factor, nonlinear = settings.prior.factor, [b.value for b in settings.estimate.biases if b in _NONLINEAR]
    if nonlinear and not is_fit:
        narrow = f"needs a narrow prior (--set identification.prior.factor={_NARROWER:g})"
        return (
            f"with {' and '.join(nonlinear)} to be found a Kalman filter "
            f"{narrow if factor > _NARROWER else 'may go astray from a narrow prior too'}; output_error needs none "
            "(--filter output_error)"
        )
    if estimate.completed:
        return None
    if is_fit:
        by_prior = ", or let the prior hold it (--set identification.output_error.use_prior=true)"
        return (
            "the data do not determine the model, or it is unstable in open loop: take another filter"
            f"{'' if settings.output_error.use_prior else by_prior}"
        )
    if settings.prior.from_estimate is not None:
        return "the earlier estimate (identification.prior.from_estimate) may not fit these data: start without it"
    if factor > _NARROW:
        return f"narrow the prior (--set identification.prior.factor={_NARROW:g}), or take another filter"
    return "the prior is narrow already: raise the process noise (identification.process_noise), or take another filter"
