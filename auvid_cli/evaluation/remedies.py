"""What may help a filter that diverged or was led astray."""

from auvid_cli.config.extra_states import AugmentedStates, BiasName
from auvid_cli.config.filter_name import FilterName
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.innovations import WINDOW
from auvid_cli.evaluation.consistency import LARGEST_NIS, LARGEST_NIS_IN_WINDOW, mean_nis, windowed_nis

# Errors with which a DVL is no linear sensor.
_NONLINEAR = [
    name
    for name in BiasName
    if any(block.sensor == "dvl" and not block.additive for block in AugmentedStates().blocks_of(name))
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


def remedy_of_linearisation(estimate: Estimate) -> str:
    """Return what may help an EKF whose innovations are too large at the start of the run only; empty if not."""
    is_ekf = estimate.filter == FilterName.EKF
    if not is_ekf or not mean_nis(estimate) <= LARGEST_NIS:
        return ""
    windows = [windowed_nis(innovations) for innovations in estimate.innovations.values()]
    begin = min((float(window[0, 0]) for window in windows if len(window)), default=0.0)
    late = [nis for window in windows for start, nis in window if start > begin + 0.5 * WINDOW]
    if any(nis > LARGEST_NIS_IN_WINDOW for nis in late):
        return ""
    return (
        "an EKF linearises about its own estimate, which is far off in the first seconds; its standard deviations are "
        "too small from then on, with either ekf.transition: use the CKF, the TUKF or the smoother, or a narrower "
        "prior (identification.prior.factor)"
    )


def remedy_of_divergence(estimate: Estimate) -> str:
    """Return what may help a filter that did not end well."""
    settings = estimate.experiment.identification
    if remedy := remedy_of_nonlinearity(estimate):
        return remedy
    if estimate.status.startswith("unconverged"):
        return _remedy_of_unconverged(estimate)
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


def _remedy_of_unconverged(estimate: Estimate) -> str:
    """Return what may help a fit that did not settle: more steps, unless it is where the data are not met."""
    settings, large = estimate.experiment.identification, "its residuals are larger than the noise"
    if estimate.is_free_run_fit:
        more = f"identification.output_error.max_evaluations={2 * settings.output_error.max_evaluations}"
        held = "" if settings.output_error.use_prior else " or let the prior hold them (output_error.use_prior)"
        elsewhere = (
            f"{large}: allow more steps (--set {more}); if they stay large, fit shorter segments (--use), or take the "
            "smoother"
        )
    else:
        more = f"identification.smoother.max_passes={2 * settings.smoother.max_passes}"
        held = " or narrow the prior (identification.prior.factor)"
        elsewhere = (
            f"{large}, where more steps (--set {more}) seldom help: look at signs, units and delays (auvid inspect), "
            "and let the data say how much process noise the model needs (--set identification.noise=estimate, or "
            "auvid tune)"
        )
    if not mean_nis(estimate) <= LARGEST_NIS:
        return elsewhere
    return (
        f"its residuals are as large as the noise: allow more steps (--set {more}); coefficients that still move "
        f"then are not determined by these data: hold them (identification.coefficients){held}"
    )
