"""Forward passes of small networks for decisions, without torch.

Inputs that are equal in all rows are multiplied once, and units that are zero in all rows are
skipped. Up to ``FEW`` rows are evaluated by a compiled function; more rows are multiplied by
the matrix library of numpy.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from torch import nn

from app.sim.core.jit import FAST, kernel
from app.sim.geometry.capsules import copy_values

Floats = NDArray[np.float32]
Flags = NDArray[np.bool_]
Units = NDArray[np.int64]

FEW = 48
"""Number of rows up to which the compiled function is faster."""
MANY = 1024
"""Most rows of one product; its work space fits the second cache for most processors."""
QUICK = {*FAST, "reassoc"}
"""Fast-math flags; the order of sums is free."""
EPSILON = 1e-5
"""Added to the variance by layer normalisation, as in torch."""


class Layer(NamedTuple):
    """Linear layer, and layer normalisation where ``gain`` is not empty."""

    weight: Floats
    """Weights, shape (n_in, n_out)."""
    bias: Floats
    """Biases, shape (n_out,)."""
    gain: Floats
    """Factors after normalisation, shape (n_out,) or (0,)."""
    shift: Floats
    """Summands after normalisation, shape (n_out,) or (0,)."""


Layers = tuple[Layer, ...]
"""Layers of a network, rectified except for the last one."""


class UnitsWorkspace(NamedTuple):
    """Work space of :func:`forward_few`."""

    rows: Floats
    """Units of two layers, shape (2, rows, width of the widest layer)."""
    units: Units
    """Indices of inputs, shape (number of inputs or units of the widest layer,)."""


def new_units(networks: Iterable[Layers], n_rows: int) -> UnitsWorkspace:
    """Return work space for networks and a number of rows."""
    layers = [layer for network in networks for layer in network]
    n_in, n_out = (max(layer.weight.shape[axis] for layer in layers) for axis in range(2))
    rows = np.empty((2, n_rows, n_out), dtype=np.float32)
    return UnitsWorkspace(rows, np.empty(max(n_in, n_out), dtype=np.int64))


@kernel(inline="always")
def _activate(layer: Layer, last: bool, row: Floats) -> None:
    """Normalise and rectify the sums of a layer in place, shape (n_out,) or longer.

    The mean of sums to normalise is 0; see :func:`centred_layers_of`.
    """
    n = layer.bias.shape[0]
    if layer.gain.shape[0] > 0:
        square = np.float32(0.0)
        for j in range(n):
            square += row[j] ** 2
        scale = np.float32(1.0 / np.sqrt(square / n + EPSILON))
        for j in range(n):
            row[j] = row[j] * scale * layer.gain[j] + layer.shift[j]
    if not last:
        for j in range(n):
            row[j] = max(row[j], np.float32(0.0))


@kernel(nogil=True, fastmath=QUICK)
def _add(rows: int, x: Floats, units: Units, n: int, weights: Floats, sums: Floats) -> None:
    """Add n inputs times their weights, shape (n_in, n_out), to the sums of each row.

    Four inputs at once: a sum is read and written once for four products, and weights that
    were read for one row are in the first cache for the next.

    Args:
        x: Inputs, shape (rows, n_in) or larger.
        units: Indices of the inputs, of which the first n count.
        n: Number of inputs.
        weights: Weights, shape (n_in, n_out).
        sums: Sums, shape (rows, n_out) or larger.
    """
    whole, n_out = n - n % 4, weights.shape[1]
    for b in range(0, whole, 4):
        k0, k1, k2, k3 = units[b], units[b + 1], units[b + 2], units[b + 3]
        w0, w1, w2, w3 = weights[k0], weights[k1], weights[k2], weights[k3]
        for i in range(rows):
            x0, x1, x2, x3, row = x[i, k0], x[i, k1], x[i, k2], x[i, k3], sums[i]
            for j in range(n_out):
                row[j] += x0 * w0[j] + x1 * w1[j] + x2 * w2[j] + x3 * w3[j]
    for b in range(whole, n):
        for i in range(rows):
            factor, weight, row = x[i, units[b]], weights[units[b]], sums[i]
            for j in range(n_out):
                row[j] += factor * weight[j]


@kernel(inline="always")
def _nonzero(rows: int, x: Floats, total: Floats, n_in: int, units: Units) -> int:
    """Write the indices of the units that are not zero in all rows; return their number.

    Args:
        x: Rectified units, shape (rows, n_in) or larger.
        total: Work space, shape (n_in,) or longer.
        n_in: Number of units.
        units: Filled, shape (n_in,) or longer.
    """
    for k in range(n_in):
        total[k] = x[0, k]
    for i in range(1, rows):
        for k in range(n_in):
            total[k] += x[i, k]
    n = 0
    for k in range(n_in):  # without branches, which cannot be predicted
        units[n] = k
        n += total[k] != 0.0
    return n


@kernel(nogil=True)
def _add_constants(x: Floats, varying: Flags, units: Units, layer: Layer, sums: Floats) -> None:
    """Write the biases of a layer plus what inputs add to them that are equal in all rows.

    Inputs of 0 add nothing.

    Args:
        x: Inputs of a row, shape (1 or more, n_in).
        varying: Whether an input differs between rows, shape (n_in,).
        units: Work space, shape (n_in,) or longer.
        layer: The first layer.
        sums: Filled, shape (1 or more, n_out) or larger.
    """
    copy_values(layer.bias, sums[0])
    n = 0
    for k in range(varying.shape[0]):
        units[n] = k
        n += (not varying[k]) & (x[0, k] != 0.0)
    _add(1, x, units, n, layer.weight, sums)


@kernel(nogil=True, fastmath=QUICK)
def forward_few(
    layers: Layers, x: Floats, varying: Flags, work: UnitsWorkspace, out: Floats
) -> None:
    """Write the outputs of a network for a few rows.

    Args:
        layers: The network, from :func:`centred_layers_of`.
        x: Inputs, shape (n, n_in).
        varying: Whether an input differs between rows, shape (n_in,).
        work: Work space for n rows.
        out: Filled, shape (n, n_out).
    """
    first, n_layers, rows = layers[0], len(layers), x.shape[0]
    units, shared, now = work.units, work.rows[0], work.rows[1]
    _add_constants(x, varying, units, first, shared)
    n = 0
    for k in range(varying.shape[0]):
        units[n] = k
        n += varying[k]
    for i in range(rows):
        copy_values(shared[0], now[i])
    _add(rows, x, units, n, first.weight, now)
    for i in range(rows):
        _activate(first, n_layers == 1, now[i])
    for d in range(1, n_layers):
        layer, after = layers[d], work.rows[1 - d % 2]
        n = _nonzero(rows, now, after[0], layer.weight.shape[0], units)
        for i in range(rows):
            copy_values(layer.bias, after[i])
        _add(rows, now, units, n, layer.weight, after)
        for i in range(rows):
            _activate(layer, d == n_layers - 1, after[i])
        now = after
    for i in range(rows):
        for j in range(out.shape[1]):
            out[i, j] = now[i, j]


@kernel(nogil=True, fastmath=QUICK)
def _activate_columns(
    layer: Layer, sums: Floats, scale: Floats, columns: Floats, to: Floats, speaking: Units
) -> int:
    """Add sums to a layer's units, normalise and rectify them; leave out those that are silent.

    The mean of units to normalise is 0; see :func:`centred_layers_of`.

    Args:
        layer: A layer that is not the last.
        sums: Added to each unit, shape (n_out,).
        scale: Work space, shape (n,).
        columns: Units of n rows, shape (n_out, n).
        to: Filled with those that are not zero in all rows, shape (n_out, n).
        speaking: Filled with their indices, shape (n_out,) or longer.

    Returns:
        Their number.
    """
    kept, n_out, n = 0, sums.shape[0], scale.shape[0]
    normed, zero, one = layer.gain.shape[0] > 0, np.float32(0.0), np.float32(1.0)
    for i in range(n):
        scale[i] = zero if normed else one
    if normed:
        for j in range(n_out):
            for i in range(n):
                scale[i] += (columns[j, i] + sums[j]) ** 2
        for i in range(n):
            scale[i] = one / np.sqrt(scale[i] / n_out + np.float32(EPSILON))
    for j in range(n_out):
        unit, after, added, total = columns[j], to[kept], sums[j], zero
        gain, shift = (layer.gain[j], layer.shift[j]) if normed else (one, zero)
        for i in range(n):
            after[i] = max((unit[i] + added) * scale[i] * gain + shift, zero)
            total += after[i]
        if total != zero:
            speaking[kept] = j
            kept += 1
    return kept


def layers_of(modules: Iterable[nn.Module]) -> Layers:
    """Return the weights of linear layers, each followed by layer normalisation or not."""
    layers: list[Layer] = []
    none = np.zeros(0, dtype=np.float32)
    for module in modules:
        if isinstance(module, nn.Linear):
            weight, bias = (p.detach().numpy() for p in (module.weight, module.bias))
            layers.append(Layer(np.ascontiguousarray(weight.T), bias.copy(), none, none))
        elif isinstance(module, nn.LayerNorm):
            gain, shift = (p.detach().numpy().copy() for p in (module.weight, module.bias))
            layers[-1] = layers[-1]._replace(gain=gain, shift=shift)
    return tuple(layers)


def centred_layers_of(modules: Iterable[nn.Module]) -> Layers:
    """Return layers for a forward pass: the sums of normalised layers have a mean of 0."""

    def centred(values: Floats) -> Floats:
        without: Floats = np.subtract(values, values.mean(axis=-1, keepdims=True))
        return without

    return tuple(
        layer._replace(weight=centred(layer.weight), bias=centred(layer.bias))
        if len(layer.gain)
        else layer
        for layer in layers_of(modules)
    )


def new_columns(networks: Iterable[Layers]) -> Floats:
    """Return work space of :func:`forward_many` for networks and up to ``MANY`` rows.

    Sums of a layer, and its units.
    """
    widest = max(layer.bias.shape[0] for network in networks for layer in network)
    return np.empty((2, widest * MANY), dtype=np.float32)


def forward_many(
    layers: Layers, x: Floats, constant: Floats, varying: Flags, work: Floats
) -> Floats:
    """Return the outputs of a network by the matrix library, shape (n_out, n).

    Each input or unit is a row of n values, so that those to skip are left out at no cost.

    Args:
        layers: The network, from :func:`centred_layers_of`.
        x: The inputs that differ between rows, shape (n_varying, n), n at most ``MANY``.
        constant: All inputs of one row, shape (1, n_in).
        varying: Whether an input differs between rows, shape (n_in,).
        work: Work space; the outputs are a part of it.
    """
    first, n, n_in = layers[0], x.shape[1], len(varying)
    scale, units = np.empty(n, dtype=np.float32), np.empty(max(n_in, len(work[0]) // MANY), int)
    sums = np.empty((1, len(first.bias)), dtype=np.float32)
    _add_constants(constant, varying, units, first, sums)
    weight, sums = first.weight[varying], sums[0]
    for layer, after in zip(layers, (*layers[1:], None), strict=True):
        columns, units_of = (part[: len(layer.bias) * n].reshape(-1, n) for part in work)
        np.matmul(weight.T, x, out=columns)
        if after is None:
            break
        kept = _activate_columns(layer, sums, scale, columns, units_of, units)
        x, weight, sums = units_of[:kept], after.weight.take(units[:kept], axis=0), after.bias
    found: Floats = np.add(columns, sums[:, None], out=columns)
    return found
