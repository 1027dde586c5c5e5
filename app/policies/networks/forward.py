"""Forward passes of small networks for decisions, without torch.

Inputs that are equal in all rows are multiplied once. Up to ``FEW`` rows are evaluated by a
compiled function that skips units that are zero; more rows are multiplied by the matrix library
of numpy.
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

FEW = 12
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


@kernel(inline="always")
def _activate(layer: Layer, last: bool, row: Floats) -> None:
    """Normalise and rectify the sums of a layer in place, shape (n_out,)."""
    n = row.shape[0]
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


@kernel(inline="always")
def _add(factor: np.float32, weights: Floats, row: Floats) -> None:
    """Add multiples of the weights of one input, shape (n_out,), to the sums of a layer."""
    for j in range(row.shape[0]):
        row[j] += factor * weights[j]


@kernel(nogil=True, fastmath=QUICK)
def forward_few(layers: Layers, x: Floats, varying: Flags, work: Floats, out: Floats) -> None:
    """Write the outputs of a network for a few rows.

    Args:
        layers: The network.
        x: Inputs, shape (n, n_in).
        varying: Whether an input differs between rows, shape (n_in,).
        work: Work space, shape (3, width of the widest layer).
        out: Filled, shape (n, n_out).
    """
    first, n_layers = layers[0], len(layers)
    shared = work[0, : first.bias.shape[0]]
    copy_values(first.bias, shared)
    for k in range(x.shape[1]):
        if not varying[k]:
            _add(x[0, k], first.weight[k], shared)
    for i in range(x.shape[0]):
        now = work[1, : shared.shape[0]]
        copy_values(shared, now)
        for k in range(x.shape[1]):
            if varying[k]:
                _add(x[i, k], first.weight[k], now)
        _activate(first, n_layers == 1, now)
        for d in range(1, n_layers):
            layer = layers[d]
            after = work[1 + d % 2, : layer.bias.shape[0]]
            copy_values(layer.bias, after)
            for k in range(now.shape[0]):
                if now[k] != 0.0:
                    _add(now[k], layer.weight[k], after)
            _activate(layer, d == n_layers - 1, after)
            now = after
        copy_values(now, out[i])


@kernel(nogil=True, fastmath=QUICK)
def _activate_rows(layer: Layer, sums: Floats, last: bool, rows: Floats) -> None:
    """Add ``sums``, shape (n_out,), to rows, shape (n, n_out); normalise and rectify them."""
    for i in range(rows.shape[0]):
        _add(np.float32(1.0), sums, rows[i])
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


def width_of(layers: Layers) -> int:
    """Return the number of units of the widest layer."""
    return max(len(layer.bias) for layer in layers)


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
