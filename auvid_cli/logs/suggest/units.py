"""Units of a suggested map: those that physics leaves possible."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from auvid_cli.config.log_columns import unit_factor
from auvid_cli.logs.suggest.evidence import course_direction, speed_as_surge
from auvid_cli.logs.suggest.relations import Relation, Signals, Track, fit_relation, integral, on_grid
from auvid_cli.vehicle.parameters import SENSORS
from auvid_cli.vehicle.rigid_body import GRAVITY, MAX_SPEED, MAX_TURN_RATE

# Units in which sensors are logged, by their SI unit; the SI unit comes first.
UNITS = {
    "rad/s": ("rad/s", "deg/s"),
    "rad": ("rad", "deg"),
    "m": ("m", "mm", "cm", "ft"),
    "m/s": ("m/s", "mm/s", "cm/s", "knot"),
    "m/s^2": ("m/s^2", "g", "mg", "cm/s^2", "mm/s^2"),
}
_MIN_SPEED = 0.1  # m/s, along the bow; a slower log has no manoeuvre
_MIN_TURN_RATE = 0.005  # rad/s
_SPEEDS = (0.3, 5.0)  # m/s, of a vehicle whose speed is not measured
_DRIFT_WINDOW = 2.0  # s
_MIN_DEPTH = 0.2  # m
_MAX_DEPTH = 12_000.0  # m
_NEAR_GRAVITY = 0.1  # tolerance of the median size of specific forces
_MAX_TURNS = 6.0  # turns of a heading that is not wrapped
_WRAP = 0.05  # tolerance of a jump of a wrapped heading
_QUANTILE = 0.99
_ANGLE_TOLERANCE = 1.02
_LARGEST_ANGLES = {"phi": np.pi, "theta": 0.5 * np.pi}  # rad
# Costs are negative log likelihoods.
_MIN_DIFFERENCE = 6.0  # of a unit that is excluded, compared with the best
_MAX_MISFIT = 0.7  # of a relation that agrees with the units


class Columns(NamedTuple):
    """Columns of a sensor that have one unit."""

    sensor: str
    tracks: dict[str, Track]  # numbers of the log by component
    stated: str  # unit that the log or a name states; empty without one


class _Tie(NamedTuple):
    """A relation whose gain physics fixes."""

    relation: Relation
    tolerance: float  # standard deviation of the logarithm of the gain
    min_correlation: float = 0.8
    gains: tuple[float, float] = (1.0, 1.0)  # lowest and highest gain in the right units


class _FittedTie(NamedTuple):
    """Gain of a tie in the provisional units."""

    tie: _Tie
    correlation: float
    gain: float

    def cost(self, ratios: Mapping[str, float]) -> float:
        """Return the cost of units with given sizes, by symbol, relative to the provisional ones."""
        first, *others = (ratios.get(symbol, 1.0) for symbol in self.tie.relation.symbols)
        gain = np.log(self.gain * first / np.prod(others))
        low, high = np.log(self.tie.gains)
        return float(0.5 * (max(low - gain, gain - high, 0.0) / self.tie.tolerance) ** 2)


def possible_units(parts: Sequence[Columns], is_over_ground: bool) -> list[tuple[tuple[str, ...], str]]:
    """Return the units that remain possible for each part, the most probable first, and the reasons.

    Ranges, gravity and kinematic relations exclude the others.

    Parameters
    ----------
    parts : sequence of Columns
    is_over_ground : bool
        Whether the names of the velocity say that it is over ground.
    """
    excluded = [_excluded(part) for part in parts]
    candidates = [_candidates(part, reasons) for part, reasons in zip(parts, excluded, strict=True)]
    provisional = [_provisional(part, units) for part, units in zip(parts, candidates, strict=True)]
    ties = _fitted(parts, provisional, is_over_ground)
    combinations = list(product(*candidates))
    costs = np.zeros((len(combinations), len(ties)))
    for row, units in enumerate(combinations):
        ratios = {
            symbol: _ratio(part, unit, usual)
            for part, unit, usual in zip(parts, units, provisional, strict=True)
            for symbol in part.tracks
        }
        costs[row] = [tie.cost(ratios) for tie in ties]
    total = costs.sum(axis=1)
    best = int(total.argmin())
    likely = np.flatnonzero(total <= total[best] + _MIN_DIFFERENCE)
    likely = likely[np.argsort(total[likely], kind="stable")]
    contradicted = [tie for tie, cost in zip(ties, costs[best], strict=True) if cost > _MAX_MISFIT]
    results = []
    for k, part in enumerate(parts):
        own = [tie for tie in ties if {*part.tracks} & {*tie.tie.relation.symbols}]
        wrong = [tie for tie in own if tie in contradicted]
        units = candidates[k] if wrong else tuple(dict.fromkeys(combinations[row][k] for row in likely))
        results.append((units, _reason(part, units, excluded[k], own, wrong)))
    return results


def _ratio(part: Columns, unit: str, usual: str) -> float:
    si = SENSORS[part.sensor][0].unit
    return unit_factor(unit, si) / unit_factor(usual, si)


def _candidates(part: Columns, excluded: Mapping[str, str]) -> tuple[str, ...]:
    if part.stated:
        return (part.stated,)
    units = UNITS[SENSORS[part.sensor][0].unit]
    # If every unit is excluded, the ranges do not fit this log.
    return tuple(unit for unit in units if unit not in excluded) or units


def _provisional(part: Columns, units: tuple[str, ...]) -> str:
    """Return the unit in which relations are computed; angles beyond a turn are not taken as wrapped radians."""
    if part.sensor == "attitude" and "deg" in units and _size(part) > 2.0 * np.pi * _ANGLE_TOLERANCE:
        return "deg"
    return units[0]


def _size(part: Columns, *symbols: str) -> float:
    """Return the largest 99 % quantile of the sizes of the numbers; NaN without any."""
    known = [np.abs(track.values) for symbol, track in part.tracks.items() if not symbols or symbol in symbols]
    known = [values[np.isfinite(values)] for values in known]
    return max((float(np.quantile(values, _QUANTILE)) for values in known if values.size), default=np.nan)


def _excluded(part: Columns) -> dict[str, str]:
    """Return the units in which the numbers would be out of range, with the reason."""
    si = SENSORS[part.sensor][0].unit
    match si:
        case "rad":
            return _excluded_angles(part)
        case "rad/s":
            low, high, size = _MIN_TURN_RATE, MAX_TURN_RATE, _size(part)
        case "m/s":
            low, high, size = (_MIN_SPEED if "u" in part.tracks else 0.0), MAX_SPEED, _size(part)
        case "m":
            low, high, size = _MIN_DEPTH, _MAX_DEPTH, _size(part)
        case _:  # m/s^2
            size = _specific_force(part)
            low, high = (1.0 - _NEAR_GRAVITY) * GRAVITY, (1.0 + _NEAR_GRAVITY) * GRAVITY
    excluded = {}
    for unit in UNITS[si]:
        size_si = unit_factor(unit, si) * size
        if word := "small" if size_si < low else "large" if size_si > high else "":
            excluded[unit] = f"{size:.3g} {unit} would be too {word} for a vehicle"
    return excluded


def _specific_force(part: Columns) -> float:
    """Return the median size of the specific force; NaN without the component along gravity."""
    if "fz" not in part.tracks:
        return np.nan
    squares = [np.square(track.values) for track in part.tracks.values()]
    sizes = np.sqrt(np.sum(squares, axis=0))
    return float(np.nanmedian(sizes)) if np.isfinite(sizes).any() else np.nan


def _excluded_angles(part: Columns) -> dict[str, str]:
    for symbol, largest in _LARGEST_ANGLES.items():
        if (size := _size(part, symbol)) > _ANGLE_TOLERANCE * largest:
            return {"rad": f"{symbol} reaches {size:.3g}, more than {largest:.3g} rad"}
    if "psi" not in part.tracks:
        return {}
    psi = part.tracks["psi"].values
    psi = psi[np.isfinite(psi)]
    for turn, other, name in ((360.0, "rad", "360"), (2.0 * np.pi, "deg", "2 pi")):
        jumps = np.abs(np.diff(psi))
        # A wrapped heading stays within one turn, and jumps by nearly a turn, but otherwise changes little.
        is_wrap = np.abs(jumps - turn) < _WRAP * turn
        within = psi.size > 1 and np.ptp(psi) < (1.0 + 1e-3) * turn
        if within and is_wrap.any() and float(np.median(jumps)) < _WRAP * turn:
            return {other: f"the heading wraps by {name}"}
    if psi.size and np.ptp(psi) > 2.0 * np.pi * _MAX_TURNS:
        return {"rad": f"the heading changes by {np.ptp(psi):.3g}"}
    return {}


def _fitted(parts: Sequence[Columns], units: Sequence[str], is_over_ground: bool) -> list[_FittedTie]:
    tracks = {
        symbol: track._replace(values=unit_factor(unit, SENSORS[part.sensor][0].unit) * track.values)
        for part, unit in zip(parts, units, strict=True)
        for symbol, track in part.tracks.items()
    }
    over_ground = {"u", "v"} <= {*tracks} and (is_over_ground or bool(course_direction(tracks)))
    if over_ground:
        tracks = {symbol: track for symbol, track in tracks.items() if symbol == "w"} | speed_as_surge(tracks)
    signals = on_grid(tracks)
    if signals is None:
        return []
    fitted = []
    for tie in _ties(signals, over_ground):
        fit = fit_relation(tie.relation, signals.step)
        if fit is not None and abs(fit.correlation) >= tie.min_correlation:
            fitted.append(_FittedTie(tie, fit.correlation, fit.gain))
    return fitted


def _ties(s: Signals, over_ground: bool) -> Iterator[_Tie]:
    for symbol, angle in (("p", "phi"), ("q", "theta"), ("r", "psi")):
        if s.has(symbol, angle):
            relation = Relation((symbol, angle), f"{symbol} is the rate of {angle}", s.mean(symbol), s.rate(angle))
            yield _Tie(relation, tolerance=0.4)
    if s.has("down"):
        yield from _ties_of_depth(s, over_ground)
    for force, angle, sign in (("fx", "theta", 1.0), ("fy", "phi", -1.0)):
        if s.has(force, angle):
            words, gravity = f"{force} contains gravity due to {angle}", sign * GRAVITY * np.sin(s.mean(angle))
            yield _Tie(Relation((force, angle), words, s.mean(force), gravity), tolerance=0.6)
    if s.has("q", "fx") and not s.has("theta"):
        tilt = Relation(("q", "fx"), "q is the rate of the tilt in fx", s.mean("q"), s.rate("fx") / GRAVITY)
        yield _Tie(tilt, tolerance=0.8, min_correlation=0.6)


def _ties_of_depth(s: Signals, over_ground: bool) -> Iterator[_Tie]:
    if over_ground and s.has("w"):
        # Its sign is still unknown, and the gain does not depend on it.
        sinking = Relation(("w", "down"), "vertical velocity is the rate of depth", s.mean("w"), s.rate("down"))
        yield _Tie(sinking, tolerance=0.12, min_correlation=0.9)
    if s.has("theta"):
        yield from _ties_of_pitch(s, over_ground)
    elif s.has("q"):
        # Changes over some seconds, because the integral of a turn rate drifts.
        pitch = s.change(integral(s.mean("q"), s.step), _DRIFT_WINDOW)
        sinking = s.change(s.rate("down"), _DRIFT_WINDOW)
        if s.has("u"):
            heave = () if over_ground else tuple(s.change(w, _DRIFT_WINDOW) for w in s.means("w"))
            words = "depth changes with u times the integral of q"
            relation = Relation(("down", "u", "q"), words, sinking, -s.mean("u") * pitch, heave, window=_DRIFT_WINDOW)
            yield _Tie(relation, tolerance=0.15, min_correlation=0.85)
        else:
            words = "depth changes with the integral of q"
            relation = Relation(("down", "q"), words, sinking, -pitch, window=_DRIFT_WINDOW)
            yield _Tie(relation, tolerance=0.5, gains=_SPEEDS)


def _ties_of_pitch(s: Signals, over_ground: bool) -> Iterator[_Tie]:
    climb = np.sin(s.mean("theta"))
    if not s.has("u"):
        relation = Relation(("down", "theta"), "depth changes with pitch", s.rate("down"), -climb)
        yield _Tie(relation, tolerance=0.5, gains=_SPEEDS)
        return
    diving = -s.mean("u") * climb
    heave = () if over_ground else s.means("w")
    words = "depth changes with u sin(theta)"
    yield _Tie(Relation(("down", "u", "theta"), words, s.rate("down"), diving, heave), 0.12, min_correlation=0.9)
    if heave:
        words = "w is the rate of depth"
        relation = Relation(("w", "down"), words, s.mean("w"), s.rate("down"), (diving,))
        # It is the small rest of the climb that pitch does not explain.
        yield _Tie(relation, tolerance=0.2, min_correlation=0.9)


def _reason(
    part: Columns,
    units: tuple[str, ...],
    excluded: Mapping[str, str],
    ties: Sequence[_FittedTie],
    wrong: Sequence[_FittedTie],
) -> str:
    reached = max((float(np.nanmax(np.abs(track.values), initial=0.0)) for track in part.tracks.values()), default=0.0)
    if wrong:
        relations = ", ".join(tie.tie.relation.words for tie in wrong)
        return f"no unit agrees with: {relations}; values reach {reached:.4g}"
    if len(units) > 1:
        return f"nothing in the log shows which; values reach {reached:.4g}"
    reasons = [f"{tie.tie.relation.words} (correlation {abs(tie.correlation):.2f})" for tie in ties]
    reasons = [*excluded.values(), *reasons] or ["the only usual unit"]
    return f"{'; '.join(reasons)}; values reach {reached:.4g}"
