"""Judge candidates of a suggested map by the weighted evidence of kinematic relations."""

from collections.abc import Mapping, Sequence
from itertools import combinations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.log_columns import unit_factor
from auvid_cli.logs.frames import interpolate
from auvid_cli.logs.suggest.ties import CROSSED, Agreement, Track, find_ties
from auvid_cli.vehicle.parameters import SENSORS

Array = NDArray[np.float64]
# Signs of components in the axes that vehicles use; an attitude of FLU axes refers to ENU.
USUAL_AXES = {"FRD": (1, 1, 1), "FLU": (1, -1, -1)}
TRIPLES = {
    "attitude": ("phi", "theta", "psi"),
    "gyroscope": ("p", "q", "r"),
    "accelerometer": ("fx", "fy", "fz"),
    "dvl": ("u", "v", "w"),
}
# Of log likelihoods: what a component costs that counts the other way than its axes, and axes that are not expected.
_REVERSED, _UNEXPECTED = 4.0, 1.0
# From where on the evidence of a sign is called so.
_STRENGTHS = ((8.0, "strong"), (2.5, "fair"))
# Of log likelihoods, what speaks for a sign: gravity, being below the surface, going ahead. Negative depths may be
# heights, or count from where a run began, which says little: less than what a reversed sign of all else costs.
_GRAVITY, _BELOW, _ABOVE, _AHEAD = 8.0, 4.0, 0.5, 4.0
_SOME_GRAVITY, _SOME_SPEED = 5.0, 0.2
# How well the directions of a velocity over ground agree with the heading, and what part of the scatter about the bow
# that leaves.
_ALIGNED, _BETTER = 0.8, 0.25
_EXCHANGED = 6.0
# Correlation from where on a gain tells a unit, and how near it must be.
_TELLING, _NEAR = 0.8, 0.15
# s: a delay of less is not worth an offset.
_LEAST_DELAY = 0.05
# Axes of a velocity that is called by north and east.
OVER_GROUND = "NED"
_FINS = {"rudder": "elevator", "elevator": "rudder"}
# Units that a sensor's numbers may be in other than was guessed, told by the gain of a tie.
_UNITS = {
    "gyroscope": ("rad/s", "deg/s"),
    "attitude": ("rad", "deg"),
    "depth": ("m", "mm", "cm", "ft"),
    "dvl": ("m/s", "mm/s", "cm/s", "knot"),
    "accelerometer": ("m/s^2", "g"),
}


class LikelySigns(NamedTuple):
    """The signs that agree best with the evidence.

    Attributes
    ----------
    signs : dict of int
        1 or -1 by symbol.
    margins : dict of float
        By symbol how much less likely, as a logarithm, everything is with its other sign; 0 where only what is usual
        speaks for it, and no data.
    """

    signs: dict[str, int]
    margins: dict[str, float]

    def strength(self, symbol: str) -> str:
        """Say how surely a sign is known; empty if the data do not tell."""
        return next((word for limit, word in _STRENGTHS if self.margins.get(symbol, 0.0) >= limit), "")


def weigh(
    symbols: Sequence[str], ties: Sequence[Agreement], expected: Mapping[str, Mapping[str, float]]
) -> LikelySigns:
    """Find the signs of all symbols that agree best with ties and expectations.

    Parameters
    ----------
    symbols : sequence of str
    ties : sequence of Agreement
    expected : mapping of mappings
        By sensor what names, values and conventions say for each of its `USUAL_AXES`, and by symbol for its sign as it
        is (``"+"``), as logarithms.
    """
    signs = np.array(list(product((1, -1), repeat=len(symbols))), np.int8).reshape(2 ** len(symbols), len(symbols))
    of = {symbol: signs[:, k] for k, symbol in enumerate(symbols)}
    score = np.zeros(len(signs))
    for tie in ties:
        sides = [of[symbol] for symbol in tie.symbols if symbol in of]
        score += tie.weight * np.prod(sides, axis=0)
    for sensor, triple in TRIPLES.items():
        present = [(of[symbol], k) for k, symbol in enumerate(triple) if symbol in of]
        if present:
            score += _likely_axes(present, expected.get(sensor, {}))
    for symbol, own in of.items():
        score += expected.get(symbol, {}).get("+", 0.0) * own
    best = int(score.argmax())
    margins = {symbol: float(score[best] - score[own != own[best]].max(initial=-np.inf)) for symbol, own in of.items()}
    return LikelySigns({symbol: int(own[best]) for symbol, own in of.items()}, margins)


def _likely_axes(present: Sequence[tuple[NDArray[np.int8], int]], expected: Mapping[str, float]) -> Array:
    """Return how likely the signs of a sensor are: its nearest axes, less what is reversed in them."""
    scores = []
    for axes, usual in USUAL_AXES.items():
        reversed_ones = sum((own != usual[k]).astype(np.float64) for own, k in present)
        scores.append(expected.get(axes, 0.0) - _UNEXPECTED * (axes != "FRD") - _REVERSED * reversed_ones)
    return np.max(scores, axis=0)


class Evidence(NamedTuple):
    """What the data say.

    Attributes
    ----------
    ties : list of Agreement
    verdict : LikelySigns
    over_ground : str
        NED or ENU if the velocity of the DVL is over ground, else empty.
    exchanged : bool
        Whether rudder and elevator are exchanged.
    delays : dict of float
        s, by sensor: how late its times are.
    units : dict of str
        By sensor whose numbers must be in another unit than was guessed.
    """

    ties: list[Agreement]
    verdict: LikelySigns
    over_ground: str
    exchanged: bool
    delays: dict[str, float]
    units: dict[str, str]

    def words(self, symbols: Sequence[str]) -> str:
        """Say what speaks for the signs of some symbols, and how strongly."""
        by_strength: dict[str, list[str]] = {}
        for symbol in symbols:
            by_strength.setdefault(self.verdict.strength(symbol), []).append(symbol.removeprefix("fins."))
        said = ", ".join(
            f"{tie.words} ({abs(tie.correlation):.2f})"
            for tie in self.ties
            if tie.weight and {*symbols} & {*tie.symbols}
        )
        strengths = ", ".join(f"{word} for {', '.join(of)}" for word, of in by_strength.items() if word)
        unknown = ", ".join(by_strength.get("", ()))
        return "; ".join(
            text
            for text, applies in (
                (f"evidence {strengths}: {said or 'their values'}", strengths),
                (f"check: nothing tells {unknown}", unknown),
            )
            if applies
        )


def judge(
    tracks: Mapping[str, Track], expected: Mapping[str, Mapping[str, float]], guessed: Mapping[str, str]
) -> Evidence:
    """Judge signals in SI.

    Parameters
    ----------
    tracks : mapping of str to Track
        By symbol.
    expected : mapping of mappings
        What names and conventions say, see `weigh`.
    guessed : mapping of str to str
        By sensor whose unit nothing states the one that its numbers were read in.
    """
    tracks, units = dict(tracks), {}
    is_named = OVER_GROUND in expected.get("dvl", {}) and {"u", "v"} <= {*tracks}
    direction = 1 if is_named else _direction(tracks)
    if direction:
        tracks = _along_the_bow(tracks)
    ties = find_ties(tracks)
    for tie in ties:
        for sensor, unit in _mistaken(tie, guessed):
            if sensor not in units:
                units[sensor] = unit
                tracks = {**tracks, **_rescaled(tracks, sensor, _factor(sensor, unit, guessed))}
    if units:
        ties = find_ties(tracks)
    crossed = sum(abs(tie.weight) for tie in ties if {*_FINS} & {*tie.symbols} and CROSSED in tie.symbols)
    as_named = sum(abs(tie.weight) for tie in ties if {*_FINS} & {*tie.symbols} and CROSSED not in tie.symbols)
    exchanged = {*_FINS} <= {*tracks} and crossed > as_named + _EXCHANGED
    if exchanged:
        tracks = {_FINS.get(symbol, symbol): track for symbol, track in tracks.items()}
        ties = find_ties(tracks)
    ties = [tie for tie in ties if CROSSED not in tie.symbols]
    delays: dict[str, float] = {}
    # One after the other: what is late spoils all ties that it stands in.
    while (late := _latest(ties)) is not None and late[0] not in delays:
        delays |= [late]
        tracks = _earlier(tracks, *late)
        ties = [tie for tie in find_ties(tracks) if CROSSED not in tie.symbols]
    verdict = weigh(list(tracks), ties, _with_values(tracks, expected))
    over_ground = OVER_GROUND if is_named else _over_ground(direction, verdict)
    return Evidence(ties, verdict, over_ground, exchanged, delays, units)


def _with_values(
    tracks: Mapping[str, Track], expected: Mapping[str, Mapping[str, float]]
) -> dict[str, dict[str, float]]:
    """Add to what is expected what the values say by themselves."""
    full = {key: dict(value) for key, value in expected.items()}
    for symbol, positive, negative in (("down", _BELOW, -_ABOVE), ("u", _AHEAD, -_AHEAD), ("fz", -_GRAVITY, _GRAVITY)):
        if symbol in tracks and np.isfinite(tracks[symbol].values).any():
            mean = float(np.nanmean(tracks[symbol].values))
            if symbol != "fz" or abs(mean) > _SOME_GRAVITY:
                of = full.setdefault(symbol, {})
                of["+"] = of.get("+", 0.0) + (positive if mean > 0.0 else negative if mean < 0.0 else 0.0)
    return full


def _direction(tracks: Mapping[str, Track]) -> int:
    """Say how a velocity's direction goes with the heading: 1 if as it, -1 if against it, 0 if it is of the body."""
    if not {"u", "v", "psi"} <= {*tracks}:
        return 0
    u, v, psi = (tracks[symbol] for symbol in ("u", "v", "psi"))
    heading = interpolate(psi.time, psi.values[:, None], u.time, is_angle=True)[:, 0]
    if v.time.size != u.time.size:
        return 0
    known = np.isfinite(heading) & (np.hypot(u.values, v.values) > _SOME_SPEED)
    if np.count_nonzero(known) < 30:
        return 0
    course = np.arctan2(v.values[known], u.values[known])
    by_bow, with_it, against = (
        float(abs(np.exp(1j * (course - sign * heading[known])).mean())) for sign in (0.0, 1.0, -1.0)
    )
    best = max(with_it, against)
    if best < _ALIGNED or 1.0 - best > _BETTER * (1.0 - by_bow):
        return 0
    return 1 if with_it > against else -1


def _along_the_bow(tracks: Mapping[str, Track]) -> dict[str, Track]:
    """Take the size of a velocity over ground for that along the bow; of the others nothing can be said yet."""
    size = np.hypot(tracks["u"].values, tracks["v"].values)
    return {symbol: track for symbol, track in tracks.items() if symbol not in ("v", "w")} | {
        "u": tracks["u"]._replace(values=size)
    }


def _over_ground(direction: int, verdict: LikelySigns) -> str:
    """Name the axes of a velocity over ground that go with the sign of the heading."""
    if not direction:
        return ""
    return OVER_GROUND if direction * verdict.signs["psi"] > 0 else "ENU"


def _mistaken(tie: Agreement, guessed: Mapping[str, str]) -> list[tuple[str, str]]:
    """Name sensors whose unit was guessed, and units of theirs that would explain the gain of a tie."""
    if abs(tie.correlation) < _TELLING or abs(np.log(tie.gain)) < _NEAR:
        return []
    gains: dict[tuple[str, str], float] = {}
    for place, symbol in enumerate(tie.symbols):
        sensor = _sensor_of(symbol)
        # Whether a pitch is in degrees is told by its rate alone: its sine is another thing then.
        if sensor == "attitude" and tie.symbols[0] not in TRIPLES["gyroscope"]:
            continue
        for unit in _UNITS.get(sensor, ()) if sensor in guessed else ():
            factor = _factor(sensor, unit, guessed)
            # Numbers of the first that are read in too large a unit make it too large.
            gains[sensor, unit] = 1.0 / factor if place == 0 else factor
    alone = [units for units, gain in gains.items() if abs(np.log(tie.gain / gain)) < _NEAR]
    if alone:
        return alone
    for pair in combinations(gains, 2):
        if pair[0][0] != pair[1][0] and abs(np.log(tie.gain / (gains[pair[0]] * gains[pair[1]]))) < _NEAR:
            return [*pair]
    return []


def _factor(sensor: str, unit: str, guessed: Mapping[str, str]) -> float:
    """Return what numbers in a unit are of those that were read in the guessed one."""
    si = SENSORS[sensor][0].unit
    return unit_factor(unit, si) / unit_factor(guessed[sensor], si)


def _rescaled(tracks: Mapping[str, Track], sensor: str, factor: float) -> dict[str, Track]:
    symbols = [quantity.symbol for quantity in SENSORS[sensor] if quantity.symbol in tracks]
    return {symbol: tracks[symbol]._replace(values=factor * tracks[symbol].values) for symbol in symbols}


def _latest(ties: Sequence[Agreement]) -> tuple[str, float] | None:
    """Name a sensor that is late, and by how much, s, by the surest of the ties that tell."""
    for tie in sorted(ties, key=lambda tie: abs(tie.correlation), reverse=True):
        first, other = _sensor_of(tie.symbols[0]), _sensor_of(tie.symbols[-1])
        if first != other and abs(tie.delay) >= _LEAST_DELAY:
            # The first is late or the other early: inertial sensors are rather in time.
            return (other, -tie.delay) if first in ("gyroscope", "accelerometer") else (first, tie.delay)
    return None


def _earlier(tracks: Mapping[str, Track], sensor: str, delay: float) -> dict[str, Track]:
    return {
        symbol: track._replace(time=track.time - delay) if _sensor_of(symbol) == sensor else track
        for symbol, track in tracks.items()
    }


def _sensor_of(symbol: str) -> str:
    return next((sensor for sensor, of in SENSORS.items() if symbol in [quantity.symbol for quantity in of]), "")
