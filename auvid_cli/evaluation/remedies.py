"""What may help a filter that diverged or was led astray."""

from auvid_cli.config.augmented_states import AugmentedStates, BiasName
from auvid_cli.data.estimate import Estimate

# Errors with which a DVL is no linear sensor.
_NONLINEAR = [
    name
    for name in BiasName
    if any(block.sensor == "dvl" and not block.additive for block in AugmentedStates(biases=(name,)).blocks())
]
# Times the natural magnitudes: a prior that suits most runs, and one for these errors.
_NARROW, _NARROWER = 1.0, 0.3


def remedy_of_nonlinearity(estimate: Estimate) -> str:
    """Return what may help if a Kalman filter was led astray by states that make a sensor nonlinear; empty if not."""
    settings = estimate.experiment.identification
    nonlinear = [name.value for name in settings.estimate.biases if name in _NONLINEAR]
    if not nonlinear or estimate.is_free_run_fit:
        return ""
    narrow = f"needs a narrow prior (--set identification.prior.factor={_NARROWER:g})"
    return (
        f"with {' and '.join(nonlinear)} to be found a Kalman filter "
        f"{narrow if settings.prior.factor > _NARROWER else 'may go astray from a narrow prior too'}; "
        "output_error needs none (--filter output_error)"
    )


def remedy_of_divergence(estimate: Estimate) -> str:
    """Return what may help a filter that did not end well."""
    settings = estimate.experiment.identification
    if remedy := remedy_of_nonlinearity(estimate):
        return remedy
    if estimate.is_free_run_fit:
        by_prior = ", or let the prior hold it (--set identification.output_error.use_prior=true)"
        return (
            "the data do not determine the model, or it is unstable in open loop: take another filter"
            f"{'' if settings.output_error.use_prior else by_prior}"
        )
    if settings.prior.from_estimate is not None:
        return "the earlier estimate (identification.prior.from_estimate) may not fit these data: start without it"
    if settings.prior.factor > _NARROW:
        return f"narrow the prior (--set identification.prior.factor={_NARROW:g}), or take another filter"
    return "the prior is narrow already: raise the process noise (identification.process_noise), or take another filter"
