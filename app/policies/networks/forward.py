"""Forward passes of small networks for decisions, without torch.

Inputs that are equal in all rows are multiplied once. Up to ``FEW`` rows are evaluated by a
compiled function that skips units that are zero in all rows; more rows are multiplied by the
matrix library of numpy.
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
    """Normalise and rectify the sums of a layer in place, shape (n_out,) or longer."""
    n = layer.bias.shape[0]
    if layer.gain.shape[0] > 0:
        mean, square = np.float32(0.0), np.float32(0.0)
        for j in range(n):
            mean += row[j]
        mean /= n
        for j in range(n):
            square += (row[j] - mean) ** 2
        scale = np.float32(1.0 / np.sqrt(square / n + EPSILON))
        for j in range(n):
            row[j] = (row[j] - mean) * scale * layer.gain[j] + layer.shift[j]
    if not last:
        for j in range(n):
            row[j] = max(row[j], np.float32(0.0))


@kernel(nogil=True, fastmath=QUICK)
def _add(rows: int, x: Floats, units: Units, n: int, weights: Floats, sums: Floats) -> None:
    """Add n inputs times their weights, shape (n_in, n_out), to the sums of each row.

    Four inputs at once: a sum is read and written once for four products, and weights that
    were read for one row are in the first cache for the next.

    Args:
        rows: Number of rows.
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
def _nonzero(rows: int, x: Floats, n_in: int, units: Units) -> int:
    """Write the indices of the inputs that are not zero in all rows; return their number."""
    n = 0
    for k in range(n_in):
        for i in range(rows):
            if x[i, k] != 0.0:
                units[n] = k
                n += 1
                break
    return n


@kernel(inline="always")
def _inputs_where(varying: Flags, differs: bool, units: Units) -> int:
    """Write the indices of the inputs that differ between rows, or do not; return how many."""
    n = 0
    for k in range(varying.shape[0]):
        if varying[k] == differs:
            units[n] = k
            n += 1
    return n


@kernel(nogil=True, fastmath=QUICK)
def forward_few(
    layers: Layers, x: Floats, varying: Flags, work: UnitsWorkspace, out: Floats
) -> None:
    """Write the outputs of a network for a few rows.

    Args:
        layers: The network.
        x: Inputs, shape (n, n_in).
        varying: Whether an input differs between rows, shape (n_in,).
        work: Work space for n rows.
        out: Filled, shape (n, n_out).
    """
    first, n_layers, rows = layers[0], len(layers), x.shape[0]
    units, shared, now = work.units, work.rows[0], work.rows[1]
    copy_values(first.bias, shared[0])
    n = _inputs_where(varying, False, units)
    _add(1, x, units, n, first.weight, shared)
    n = _inputs_where(varying, True, units)
    for i in range(rows):
        copy_values(shared[0], now[i])
    _add(rows, x, units, n, first.weight, now)
    for i in range(rows):
        _activate(first, n_layers == 1, now[i])
    for d in range(1, n_layers):
        layer, after = layers[d], work.rows[1 - d % 2]
        n = _nonzero(rows, now, layer.weight.shape[0], units)
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
def _activate_rows(layer: Layer, sums: Floats, last: bool, rows: Floats) -> None:
    """Add ``sums``, shape (n_out,), to rows, shape (n, n_out); normalise and rectify them."""
    for i in range(rows.shape[0]):
        for j in range(sums.shape[0]):
            rows[i, j] += sums[j]
        _activate(layer, last, rows[i])


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


def forward_many(layers: Layers, x: Floats, varying: Flags) -> Floats:
    """Return the outputs of a network by the matrix library, shape (n, n_out).

    Args:
        layers: The network.
        x: Inputs, shape (n, n_in).
        varying: Whether an input differs between rows, shape (n_in,).
    """
    first, last = layers[0], layers[-1]
    sums: Floats = np.add(first.bias, x[0, ~varying] @ first.weight[~varying])
    rows: Floats = np.matmul(x[:, varying], first.weight[varying])
    _activate_rows(first, sums, first is last, rows)
    for layer in layers[1:]:
        rows = np.matmul(rows, layer.weight)
        _activate_rows(layer, layer.bias, layer is last, rows)
    return rows
