"""Stone Soup's cubature filter on auvid's compiled process."""

from collections.abc import Callable
from datetime import datetime, timedelta
from functools import partial
from typing import Any

import numpy as np
from stonesoup.base import Property
from stonesoup.models.base import GaussianModel
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.base import TransitionModel
from stonesoup.predictor.kalman import CubatureKalmanPredictor
from stonesoup.types.array import CovarianceMatrix, StateVector
from stonesoup.types.detection import Detection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.prediction import GaussianStatePrediction
from stonesoup.updater.kalman import CubatureKalmanUpdater, KalmanUpdater

from benchmarks.peers.compiled_point import compiled_point
from benchmarks.peers.problem import N_STATE, Answer, Event, Peer, Problem

_START = datetime(2018, 1, 1)


class _VehicleModel(TransitionModel, GaussianModel):
    """Transition to an event, which is set before each prediction: Stone Soup's times are whole microseconds."""

    advance: Any = Property(doc="Moves a state by a duration with held inputs.")
    event: Any = Property(doc="Where the next prediction leads.")

    @property
    def ndim_state(self) -> int:
        return N_STATE

    def function(self, state: Any, noise: Any = False, **kwargs: Any) -> StateVector:
        point = np.ascontiguousarray(state.state_vector, dtype=float).reshape(-1)
        return StateVector(self.advance(point, self.event.duration, self.event.held))

    def covar(self, **kwargs: Any) -> CovarianceMatrix:
        return self.event.process_noise.view(CovarianceMatrix)


def _detection(event: Event) -> Detection:
    model = LinearGaussian(ndim_state=N_STATE, mapping=event.measured.tolist(), noise_covar=event.noise)
    time = _START + timedelta(seconds=event.time)
    return Detection(StateVector(event.measurement), timestamp=time, measurement_model=model)


def _cubature(problem: Problem, updater_class: type) -> Callable[[], Answer]:
    model = _VehicleModel(advance=compiled_point(problem.process), event=problem.events[0])
    detections = [_detection(event) for event in problem.events]

    def run() -> Answer:
        predictor, updater = CubatureKalmanPredictor(model), updater_class()
        state: Any = GaussianStatePrediction(
            StateVector(problem.prior.mean), CovarianceMatrix(problem.covariance), timestamp=detections[0].timestamp
        )
        for event, detection in zip(problem.events, detections, strict=True):
            if event.duration:
                model.event = event
                state = predictor.predict(state, timestamp=detection.timestamp)
            state = updater.update(SingleHypothesis(state, detection))
        return Answer(np.asarray(state.mean, dtype=float).ravel(), np.asarray(state.covar))

    return run


PEERS = (
    Peer("CKF", "stonesoup", "compiled", "ckf", partial(_cubature, updater_class=CubatureKalmanUpdater)),
    Peer(
        "CKF, linear update",
        "stonesoup",
        "compiled",
        "ckf",
        partial(_cubature, updater_class=KalmanUpdater),
        note="`CubatureKalmanPredictor` with `KalmanUpdater`: linear sensors need no points.",
    ),
)
