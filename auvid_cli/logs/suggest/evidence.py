"""Signs, axes, units and delays of a suggested map, weighed by the evidence of kinematic relations."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.logs.frames import interpolate
from auvid_cli.logs.suggest.names import SENSOR_OF
from auvid_cli.logs.suggest.relations import CROSSED, RelationFit, Track, fit_relations

# Signs of components in the usual axes; an attitude in FLU axes refers to ENU.
USUAL_AXES = {"FRD": (1, 1, 1), "FLU": (1, -1, -1)}
TRIPLES = {
    "attitude": ("phi", "theta", "psi"),
    "gyroscope": ("p", "q", "r"),
    "accelerometer": ("fx", "fy", "fz"),
    "dvl": ("u", "v", "w"),
}
# Log likelihoods.
_REVERSED_COST = 4.0  # cost of a component whose sign differs from that of its axes
_FLU_COST = 1.0  # cost of axes other than FRD
_GRAVITY = 8.0  # evidence of gravity for the sign of fz
_AHEAD = 4.0  # evidence of forward motion for the sign of u
_BELOW = 4.0  # evidence of a positive mean depth for the sign of the depth
# Evidence of a negative mean depth, which may be a height, or count from the start: less than `_REVERSED_COST`
_ABOVE = 0.5
_EXCHANGED = 6.0  # least excess of the crossed responses of fins over the others
_STRENGTHS = ((8.0, "strong"), (2.5, "fair"))  # least log likelihood for each word
MIN_GRAVITY = 5.0  # m/s^2, mean specific force that shows the direction of gravity
_MIN_SPEED = 0.2  # m/s
_MIN_COURSES = 30  # rows with a speed above `_MIN_SPEED`
_MIN_ALIGNMENT = 0.8  # mean resultant length of course minus heading
_MAX_SCATTER_RATIO = 0.25  # scatter of the course about the heading divided by its scatter about the bow
_MIN_DELAY = 0.05  # s
OVER_GROUND = "NED"  # axes of a velocity whose names contain north and east
ROTATED = "rotated"  # key of the log likelihood that the axes of a sensor are not a mirror image
_EXCHANGE = {"rudder": "elevator", "elevator": "rudder"}


class LikelySigns(NamedTuple):
    """Signs with the largest likelihood."""

    signs: dict[str, int]  # 1 or -1 by symbol
    margins: dict[str, float]  # decrease of the log likelihood if a symbol has the other sign

    def strength(self, symbol: str) -> str:
        """Return the strength of the evidence for a sign as a word; empty without evidence."""
        return next((word for limit, word in _STRENGTHS if self.margins.get(symbol, 0.0) >= limit), "")


def likely_signs(
    symbols: Sequence[str], fits: Sequence[RelationFit], expected: Mapping[str, Mapping[str, float]]
) -> LikelySigns:
    """Return the signs that agree best with relations and expectations.

    Parameters
    ----------
    symbols : sequence of str
    fits : sequence of RelationFit
    expected : mapping of mappings
        Log likelihoods that follow from names, values and conventions. A sensor has one for each of its `USUAL_AXES`,
        and one for axes that are `ROTATED`; a symbol has one for its present sign (``"+"``).
    """
    signs = np.array(list(product((1, -1), repeat=len(symbols))), np.int8).reshape(2 ** len(symbols), len(symbols))
    by_symbol = {symbol: signs[:, k] for k, symbol in enumerate(symbols)}
    score = np.zeros(len(signs))
    for fit in fits:
        score += fit.weight * np.prod([by_symbol[symbol] for symbol in fit.symbols if symbol in by_symbol], axis=0)
    for sensor, triple in TRIPLES.items():
        present = [(by_symbol[symbol], k) for k, symbol in enumerate(triple) if symbol in by_symbol]
        if present:
            score += _axes_likelihood(present, expected.get(sensor, {}))
    for symbol, sign in by_symbol.items():
        score += expected.get(symbol, {}).get("+", 0.0) * sign
    best = int(score.argmax())
    margins = {
        symbol: float(score[best] - score[sign != sign[best]].max(initial=-np.inf))
        for symbol, sign in by_symbol.items()
    }
    return LikelySigns({symbol: int(sign[best]) for symbol, sign in by_symbol.items()}, margins)


def _axes_likelihood(present: Sequence[tuple[NDArray[np.int8], int]], expected: Mapping[str, float]) -> Array:
    """Return the log likelihood of a sensor's signs, given the nearest usual axes."""
    scores = []
    for axes, usual in USUAL_AXES.items():
        n_reversed = sum((sign != usual[k]).astype(np.float64) for sign, k in present)
        scores.append(expected.get(axes, 0.0) - _FLU_COST * (axes != "FRD") - _REVERSED_COST * n_reversed)
    mirrored = np.prod([sign for sign, _ in present], axis=0) < 0
    # A missing component may have either sign.
    return np.max(scores, axis=0) - expected.get(ROTATED, 0.0) * (mirrored & (len(present) == len(USUAL_AXES["FRD"])))


class Evidence(NamedTuple):
    """Result of the relations between the signals of a log."""

    fits: list[RelationFit]
    verdict: LikelySigns
    over_ground: str  # ``NED`` or ``ENU`` if the velocity of the DVL is over ground, else empty
    exchanged: bool  # whether rudder and elevator are exchanged
    delays: dict[str, float]  # delay of the times of a sensor, s

    def words(self, symbols: Sequence[str]) -> str:
        """Return the evidence for the signs of some symbols: strength, relations and correlations."""
        by_strength: dict[str, list[str]] = {}
        for symbol in symbols:
            by_strength.setdefault(self.verdict.strength(symbol), []).append(symbol.removeprefix("fins."))
        relations = ", ".join(
            f"{fit.words} (correlation {abs(fit.correlation):.2f})"
            for fit in self.fits
            if fit.weight and {*symbols} & {*fit.symbols}
        )
        unknown = ", ".join(by_strength.pop("", ()))
        strengths = ", ".join(f"{word} evidence for the sign of {', '.join(of)}" for word, of in by_strength.items())
        texts = [f"{strengths}: {relations or 'mean value'}"] if strengths else []
        if unknown:
            texts.append(f"no evidence for the sign of {unknown}")
        return "; ".join(texts)


def weigh_evidence(tracks: Mapping[str, Track], expected: Mapping[str, Mapping[str, float]]) -> Evidence:
    """Find exchanged fins, delays and signs, in this order, by the relations between signals.

    Parameters
    ----------
    tracks : mapping of str to Track
        Signals in SI by symbol.
    expected : mapping of mappings
        Log likelihoods that follow from names and conventions; see `likely_signs`.
    """
    is_named = OVER_GROUND in expected.get("dvl", {}) and {"u", "v"} <= {*tracks}
    direction = 1 if is_named else course_direction(tracks)
    tracks = speed_as_surge(tracks) if direction else dict(tracks)
    fits = fit_relations(tracks)
    of_fins = [fit for fit in fits if {*_EXCHANGE} & {*fit.symbols}]
    crossed = sum(abs(fit.weight) for fit in of_fins if CROSSED in fit.symbols)
    as_named = sum(abs(fit.weight) for fit in of_fins if CROSSED not in fit.symbols)
    exchanged = {*_EXCHANGE} <= {*tracks} and crossed > as_named + _EXCHANGED
    if exchanged:
        tracks = {_EXCHANGE.get(symbol, symbol): track for symbol, track in tracks.items()}
        fits = fit_relations(tracks)
    fits = [fit for fit in fits if CROSSED not in fit.symbols]
    delays: dict[str, float] = {}
    # One sensor at a time, because its delay affects all relations that contain it.
    while (late := _latest_sensor(fits, tracks)) is not None and late[0] not in delays:
        delays |= [late]
        sensor, delay = late
        tracks = {
            symbol: track._replace(time=track.time - delay) if SENSOR_OF.get(symbol) == sensor else track
            for symbol, track in tracks.items()
        }
        fits = [fit for fit in fit_relations(tracks) if CROSSED not in fit.symbols]
    verdict = likely_signs(list(tracks), fits, _with_values(tracks, expected))
    over_ground = ""
    if direction:
        over_ground = OVER_GROUND if is_named or direction * verdict.signs["psi"] > 0 else "ENU"
    return Evidence(fits, verdict, over_ground, exchanged, delays)


def _with_values(
    tracks: Mapping[str, Track], expected: Mapping[str, Mapping[str, float]]
) -> dict[str, dict[str, float]]:
    """Return the expectations, together with those that follow from the mean values of signals."""
    full = {key: dict(value) for key, value in expected.items()}
    for symbol, positive, negative in (("down", _BELOW, -_ABOVE), ("u", _AHEAD, -_AHEAD), ("fz", -_GRAVITY, _GRAVITY)):
        if symbol in tracks and np.isfinite(tracks[symbol].values).any():
            mean = float(np.nanmean(tracks[symbol].values))
            if symbol != "fz" or abs(mean) > MIN_GRAVITY:
                of_symbol = full.setdefault(symbol, {})
                score = positive if mean > 0.0 else negative if mean < 0.0 else 0.0
                of_symbol["+"] = of_symbol.get("+", 0.0) + score
    return full


def course_direction(tracks: Mapping[str, Track]) -> int:
    """Return 1 if the direction of a velocity turns with the heading, -1 if it turns against it, 0 in body axes."""
    if not {"u", "v", "psi"} <= {*tracks}:
        return 0
    u, v, psi = (tracks[symbol] for symbol in ("u", "v", "psi"))
    heading = interpolate(psi.time, psi.values[:, None], u.time, is_angle=True)[:, 0]
    if v.time.size != u.time.size:
        return 0
    usable = np.isfinite(heading) & (np.hypot(u.values, v.values) > _MIN_SPEED)
    if np.count_nonzero(usable) < _MIN_COURSES:
        return 0
    course = np.arctan2(v.values[usable], u.values[usable])
    about_bow, with_heading, against = (
        float(abs(np.exp(1j * (course - sign * heading[usable])).mean())) for sign in (0.0, 1.0, -1.0)
    )
    best = max(with_heading, against)
    if best < _MIN_ALIGNMENT or 1.0 - best > _MAX_SCATTER_RATIO * (1.0 - about_bow):
        return 0
    return 1 if with_heading > against else -1


def speed_as_surge(tracks: Mapping[str, Track]) -> dict[str, Track]:
    """Replace a velocity over ground by its size as `u`, because the axes of its components are still unknown."""
    size = np.hypot(tracks["u"].values, tracks["v"].values)
    others = {symbol: track for symbol, track in tracks.items() if symbol not in ("v", "w")}
    return others | {"u": tracks["u"]._replace(values=size)}


def _latest_sensor(fits: Sequence[RelationFit], tracks: Mapping[str, Track]) -> tuple[str, float] | None:
    """Return the sensor with a delay, and the delay, s, from the relation with the largest correlation that has one."""
    for fit in sorted(fits, key=lambda fit: abs(fit.correlation), reverse=True):
        first, other = (SENSOR_OF.get(symbol, "") for symbol in (fit.symbols[0], fit.symbols[-1]))
        # Less than a sampling step is not significant.
        steps = [sampling_step(tracks[symbol]) for symbol in fit.symbols if symbol in tracks]
        if first != other and abs(fit.delay) >= max(_MIN_DELAY, *steps):
            # Inertial sensors are more likely on time, so the other one is early or late.
            return (other, -fit.delay) if first in ("gyroscope", "accelerometer") else (first, fit.delay)
    return None


def sampling_step(track: Track) -> float:
    """Return the median time between new values, s; a row that repeats the value before does not count."""
    known = np.isfinite(track.values)
    time, values = track.time[known], track.values[known]
    is_new = np.append(True, np.diff(values) != 0.0)
    new = time[is_new] if np.count_nonzero(is_new) > 1 else track.time
    return float(np.median(np.diff(new)))
