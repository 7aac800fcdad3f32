"""Antipodal sigma points: drawing from a factor, mean and covariance of their images, and the measurement update."""

from collections.abc import Callable

import numpy as np

from auvid_cli.arrays import wrap
from auvid_cli.filters.factor import carlson_update, triangularise
from auvid_cli.filters.workspace import FEWER, PAIRS, lanes_of, n_blocks
from auvid_cli.numerics import LANES, compiled

# Unsigned: an index that may be negative keeps a loop scalar.
_0, _2, _3, _4 = (np.uint64(number) for number in (0, 2, 3, 4))
_wrap = compiled(inline=True)(wrap)


def four_products(pairs: int) -> Callable:
    """Return a compiled matrix product for right-hand rows of `pairs` elements; a constant length vectorises.

    It takes four rows and four terms at a time, so that each number is loaded and stored a quarter as often.
    """
    row = np.uint64(pairs)

    @compiled(reassociate=True)
    def products(left, first, across, along, n_terms, right, out):
        """Fill `out` with four rows ``sum_j left_j right_j`` of a matrix product, each `pairs` long.

        `n_terms` is rounded up to a multiple of four. Term j of row i of `left` is at ``first + i across + j along``.
        """
        first, across, along, n_terms = np.uint64(first), np.uint64(across), np.uint64(along), np.uint64(n_terms)
        for k in range(_4 * row):
            out[k] = 0.0
        for j in range(_0, n_terms, _4):
            a = first + j * along
            b, c, d = a + across, a + _2 * across, a + _3 * across
            a0, a1, a2, a3 = left[a], left[a + along], left[a + _2 * along], left[a + _3 * along]
            b0, b1, b2, b3 = left[b], left[b + along], left[b + _2 * along], left[b + _3 * along]
            c0, c1, c2, c3 = left[c], left[c + along], left[c + _2 * along], left[c + _3 * along]
            d0, d1, d2, d3 = left[d], left[d + along], left[d + _2 * along], left[d + _3 * along]
            for k in range(row):
                t = j * row + k
                t0, t1, t2, t3 = right[t], right[t + row], right[t + _2 * row], right[t + _3 * row]
                out[k] += a0 * t0 + a1 * t1 + a2 * t2 + a3 * t3
                out[k + row] += b0 * t0 + b1 * t1 + b2 * t2 + b3 * t3
                out[k + _2 * row] += c0 * t0 + c1 * t1 + c2 * t2 + c3 * t3
                out[k + _3 * row] += d0 * t0 + d1 * t1 + d2 * t2 + d3 * t3

    return products


_in_whole_tile = four_products(PAIRS)
_in_half_tile = four_products(FEWER[1])
_in_quarter_tile = four_products(FEWER[0])


@compiled(inline=True)
def products_in_tile(left, first, across, along, n_terms, right, pairs, out):
    """Fill `out` with four rows of a matrix product, each `pairs` long; see `four_products`."""
    if pairs == PAIRS:
        _in_whole_tile(left, first, across, along, n_terms, right, out)
    elif pairs == FEWER[1]:
        _in_half_tile(left, first, across, along, n_terms, right, out)
    else:
        _in_quarter_tile(left, first, across, along, n_terms, right, out)


@compiled(inline=True)
def pairs_in(basis, tile):
    """Return the number of pairs in a tile."""
    return basis.last if tile == basis.directions.shape[0] - 1 else PAIRS


@compiled(reassociate=True, inline=True)
def draw_points(basis, state, n_moving, work):
    """Fill one block per tile with the points ``mean +- S delta_k``, and the last block with the centre if needed.

    Lanes of +delta come first, then those of -delta; lanes without a direction hold the mean. Rows of moving states
    come first in a block, then the parameters.
    """
    n, mean, columns, points, scratch = state.n, state.mean, state.columns, work.points, work.product
    n_parameters, n_tiles = n - n_moving, basis.directions.shape[0]
    width = columns.shape[1]
    factor = columns.reshape(-1)
    for i in range(0 if basis.centred else n):
        points[n_tiles, (i - n_parameters if i >= n_parameters else i + n_moving) * LANES] = mean[i]
    for tile in range(n_tiles):
        pairs = pairs_in(basis, tile)
        for i in range(0, n, 4):
            products_in_tile(factor, i, 1, width, i + 4, basis.directions[tile], pairs, scratch)
            for r in range(min(4, n - i)):
                row = i + r - n_parameters if i + r >= n_parameters else i + r + n_moving
                centre, deviations = mean[i + r], scratch[r * pairs : (r + 1) * pairs]
                plus, minus = points[tile, row * LANES :], points[tile, row * LANES + pairs :]
                for k in range(pairs):
                    plus[k] = centre + deviations[k]
                    minus[k] = centre - deviations[k]


@compiled(reassociate=True, inline=True)
def all_finite(n, values):
    """Whether the first n values are finite; the sum needs one branch instead of n."""
    total = 0.0
    for i in range(n):
        total += values[i]
    return np.isfinite(total)


@compiled(reassociate=True, inline=True)
def collect_points(images, basis, n_images, first_even, image_mean, work):
    """Compute mean, odd and even part of the images of the points.

    Parameters
    ----------
    images : ndarray, shape (n_tiles + 1, at least n_images * LANES)
        Images of the points by block; the first lane of the last block is that of the centre.
    basis : Basis
    n_images : int
        Number of rows of an image.
    first_even : int
        First column of the even part in ``work.spread``.
    image_mean : ndarray, shape (n_images,)
        Filled in.
    work : Workspace
        ``regression`` is filled with the odd part: the derivative of row i of the image by column j of S. ``spread``
        is filled, from `first_even` on, with rows whose Gram matrix is the covariance of the even part.
    """
    odd, regression, spread, scratch = work.odd, work.regression, work.spread, work.product
    n_tiles, m = basis.directions.shape[0], basis.present.size
    root, present = np.sqrt(2.0 * basis.weight), basis.present
    for i in range(n_images):
        middle, total = spread[i, first_even : first_even + m], 0.0
        for tile in range(n_tiles):
            pairs, first = pairs_in(basis, tile), tile * PAIRS
            plus, minus = images[tile, i * LANES :], images[tile, i * LANES + pairs :]
            means, differences, used = middle[first:], odd[i, first:], present[first:]
            for k in range(pairs):
                means[k] = 0.5 * (plus[k] + minus[k])
                differences[k] = basis.weight * (plus[k] - minus[k])
                total += means[k] * used[k]
        centre = 2.0 * basis.weight * total if basis.centred else images[n_tiles, i * LANES]
        shift = 0.0
        for k in range(m):
            value = (middle[k] - centre) * present[k]
            shift += value
            middle[k] = root * value
        shift *= 2.0 * basis.weight
        image_mean[i] = centre if basis.centred else centre + shift
        spread[i, first_even + m] = 0.0 if basis.centred else np.sqrt(basis.curvature) * shift
    # Cubature points lie on axes: no products are needed.
    if basis.length > 0.0:
        for i in range(n_images):
            for k in range(m):
                regression[i, k] = basis.length * odd[i, k]
        return
    rows = odd.reshape(-1)
    for i in range(0, n_images, 4):
        for tile in range(n_tiles):
            pairs = pairs_in(basis, tile)
            products_in_tile(rows, i * m, m, 1, m, basis.transposed[tile], pairs, scratch)
            for r in range(4):
                target = regression[i + r, tile * PAIRS : tile * PAIRS + pairs]
                source = scratch[r * pairs : (r + 1) * pairs]
                for k in range(pairs):
                    target[k] = source[k]


@compiled()
def wrapped(difference, angular):
    """Wrap a difference of angles to [-pi, pi)."""
    return _wrap(difference) if angular else difference


@compiled(reassociate=True, inline=True)
def gather(components, which, state, measured):
    """Fill in the product of a measurement row with the factor; `which` counts the components of all sensors."""
    n, columns = state.n, state.columns
    for j in range(measured.size):
        measured[j] = 0.0
    for entry in range(components.begin[which], components.begin[which + 1]):
        place, weight = components.place[entry], components.weight[entry]
        for j in range(n):
            measured[j] += weight * columns[j, place]


@compiled(inline=True)
def combined(components, which, values):
    """Return the product of a component's measurement row with values of the state."""
    total = 0.0
    for entry in range(components.begin[which], components.begin[which + 1]):
        total += components.weight[entry] * values[components.place[entry]]
    return total


@compiled(reassociate=True)
def predict_nonlinearly(model, state, timeline, event, sensor, work):
    """Append a nonlinear sensor's prediction to mean and factor, with the even part in ``work.spread``."""
    n, mean, columns, data = state.n, state.mean, state.columns, model.data
    n_moving, n_components = data.noise_density.size, timeline.measurement.shape[1]
    inputs = timeline.inputs[timeline.event_input[event]]
    draw_points(model.basis, state, n_moving, work)
    for b in range(n_blocks(model.basis)):
        moving, parameters = work.points[b, : n_moving * LANES], work.points[b, n_moving * LANES :]
        n_lanes = lanes_of(model.basis, b)
        model.observe(
            *(moving, parameters, sensor, inputs, data.constants, data.selection, n_lanes),
            work.images[b],
            work.process,
        )
    for i in range(work.spread.shape[0]):
        for k in range(work.spread.shape[1]):
            work.spread[i, k] = 0.0
    collect_points(work.images, model.basis, n_components, 0, mean[n : n + n_components], work)
    for c in range(n_components):
        for j in range(n):
            columns[j, n + c] = work.regression[c, j]


@compiled(reassociate=True, inline=True)
def select(model, state, timeline, event, k, records, work):
    """Predict a measurement, and select the components that are present and within the gate.

    Fills in ``work.component`` with their indices, ``work.error`` with innovations and ``work.noise`` with noise
    variances; returns their number. Parameters as in `update`.
    """
    components, m, sensors, measured = model.components, model.basis.present.size, model.data.sensors, work.measured
    measurement, sensor = timeline.measurement[k], timeline.measurement_sensor[k]
    innovation, variance = records.innovation[k], records.innovation_variance[k]
    nonlinear = sensors.nonlinear[sensor]
    if nonlinear:
        predict_nonlinearly(model, state, timeline, event, sensor, work)
    n_present = 0
    for c in range(measurement.size):
        innovation[c] = np.nan
        variance[c] = np.nan
        if np.isnan(measurement[c]):
            continue
        s, which, noise = n_present, sensor * measurement.size + c, sensors.variance[sensor, c]
        gather(components, which, state, measured)
        total = noise
        for j in range(m):
            total += measured[j] * measured[j]
        if nonlinear:
            for i in range(m + 1):
                even = work.spread[c, i]
                work.spread[s, i] = even
                total += even * even
            for i in range(measurement.size):
                work.spread[s, m + 1 + i] = np.sqrt(noise) if i == s else 0.0
        difference = measurement[c] - combined(components, which, state.mean)
        innovation[c] = wrapped(difference, sensors.angular[sensor, c])
        if innovation[c] ** 2 > sensors.gate * total:
            continue
        n_present += 1
        variance[c] = total
        work.component[s] = c
        work.error[s] = innovation[c]
        work.noise[s] = noise
    return n_present


@compiled(reassociate=True, inline=True)
def decorrelate(state, n_present, work):
    """Replace predicted components by combinations with independent noise, of variance ``work.noise``.

    With the covariance ``L L'`` of the noise in ``work.spread``, the combinations are the rows of the inverse of L
    scaled to a unit diagonal. False if the covariance is not positive definite.
    """
    n, columns, lower, component = state.n, state.columns, work.lower, work.component
    if not triangularise(work.spread, n_present, lower):
        return False
    for s in range(n_present):
        for b in range(s):
            share = lower[s, b] / lower[b, b]
            work.error[s] -= share * work.error[b]
            for j in range(n):
                columns[j, n + component[s]] -= share * columns[j, n + component[b]]
        work.noise[s] = lower[s, s] ** 2
    return True


@compiled(reassociate=True, inline=True)
def condition(components, first, state, n_present, work):
    """Update with components of independent noise, one after another; returns the sum of their NIS.

    `first` is the index of the sensor's first component among those of all sensors.
    """
    n, mean, columns, gain, measured = state.n, state.mean, state.columns, work.gain, work.measured
    nis = 0.0
    for s in range(n_present):
        gather(components, first + work.component[s], state, measured)
        total = carlson_update(columns, n, measured, work.noise[s], gain, work.ratio, work.share)
        step = work.error[s] / total
        nis += work.error[s] * step
        for i in range(gain.size):
            mean[i] += gain[i] * step
        # Innovations of the other components follow the state.
        for other in range(s + 1, n_present):
            work.error[other] -= combined(components, first + work.component[other], gain) * step
    return nis


@compiled(reassociate=True, inline=True)
def update(model, state, timeline, event, k, records, work):
    """Update with the components of one measurement that are present and within the gate.

    Parameters
    ----------
    model : Model
    state : State
        Updated in place.
    timeline : Timeline
    event, k : int
        Indices of the event and of the measurement.
    records : Records
        Filled in for this measurement: the innovation before the update, and the variance of each component, NaN
        outside the gate.
    work : Workspace

    Returns
    -------
    float
        Normalised innovation squared of the whole measurement; NaN or negative if the update failed.
    """
    n_present = select(model, state, timeline, event, k, records, work)
    sensor = timeline.measurement_sensor[k]
    if model.data.sensors.nonlinear[sensor] and not decorrelate(state, n_present, work):
        return np.nan
    return condition(model.components, sensor * timeline.measurement.shape[1], state, n_present, work)
