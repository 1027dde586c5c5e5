"""Sparse linear layer over one-hot codes, compiled, with its gradient.

The product of ``P`` one-hot vectors, with codes in ``0 .. n_codes - 1``, and a matrix is the
sum of ``P`` rows of the matrix. Code 0 denotes a free place and is the most frequent one; the
sum therefore starts from free places and adds the differences of the others::

    y = sum_p W[p, 0] + sum_{p: code_p > 0} (W[p, code_p] - W[p, 0])

Function and weights are those of the dense product up to rounding.
"""

import math
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from app.sim.core.jit import kernel

Floats = NDArray[np.float32]
Codes = NDArray[np.uint8]


@kernel(nogil=True, fastmath=True)
def sum_rows(codes: Codes, n_codes: int, weight: Floats, out: Floats) -> None:
    """Add the differences of occupied to free places to each row of ``out``.

    Args:
        codes: Codes, shape (n, P).
        weight: One row per place and code, shape (P * n_codes, width).
        out: Sums, changed in place, shape (n, width).
    """
    for i in range(codes.shape[0]):
        for p in range(codes.shape[1]):
            if codes[i, p] != 0:
                free = p * n_codes
                there = free + codes[i, p]
                for j in range(out.shape[1]):
                    out[i, j] += weight[there, j] - weight[free, j]


@kernel(nogil=True, fastmath=True)
def add_gradient(codes: Codes, n_codes: int, above: Floats, total: Floats, out: Floats) -> None:
    """Write the gradient of the layer with respect to the matrix.

    Args:
        codes: Codes, shape (n, P).
        n_codes: Number of codes of a place.
        above: Gradient with respect to the layer's output, shape (n, width).
        total: Sum of ``above`` over rows, shape (width,).
        out: Gradient, filled, shape (P * n_codes, width).
    """
    for p in range(codes.shape[1]):
        for k in range(p * n_codes, (p + 1) * n_codes):
            for j in range(out.shape[1]):
                out[k, j] = total[j] if k == p * n_codes else 0.0
    for i in range(codes.shape[0]):
        for p in range(codes.shape[1]):
            if codes[i, p] != 0:
                free = p * n_codes
                there = free + codes[i, p]
                for j in range(out.shape[1]):
                    out[there, j] += above[i, j]
                    out[free, j] -= above[i, j]


class _Product(torch.autograd.Function):
    """``one_hot(codes) @ weight``."""

    @staticmethod
    def forward(ctx: Any, codes: Tensor, n_codes: int, weight: Tensor) -> Tensor:
        ctx.save_for_backward(codes)
        ctx.n_codes = n_codes
        out = weight[::n_codes].sum(dim=0).expand(len(codes), -1).contiguous()
        sum_rows(codes.numpy(), n_codes, weight.detach().numpy(), out.numpy())
        return out

    @staticmethod
    def backward(ctx: Any, *above: Tensor) -> tuple[None, None, Tensor]:
        (codes,) = ctx.saved_tensors
        given = above[0].contiguous()
        out = given.new_empty((codes.shape[1] * ctx.n_codes, given.shape[1]))
        add_gradient(
            codes.numpy(), ctx.n_codes, given.numpy(), given.sum(dim=0).numpy(), out.numpy()
        )
        return None, None, out


class OneHotLinear(nn.Module):
    """Linear layer over one-hot codes and plain numbers.

    Weights are Glorot-uniform, biases zero, as in Stable-Baselines 2 (docs/method.md 1.4).

    Args:
        n_places: Number of codes, P.
        n_codes: Number of codes of a place; 0 is a free place.
        n_plain: Number of plain numbers.
        width: Number of outputs.
    """

    def __init__(self, n_places: int, n_codes: int, n_plain: int, width: int) -> None:
        super().__init__()
        n_coded = n_places * n_codes
        bound = math.sqrt(6.0 / (n_coded + n_plain + width))
        self.n_codes = n_codes
        self.weight = nn.Parameter(torch.empty(n_coded, width).uniform_(-bound, bound))
        """One row per place and code, (P * n_codes, width)."""
        self.plain = nn.Parameter(torch.empty(n_plain, width).uniform_(-bound, bound))
        """One row per plain number, (n_plain, width)."""
        self.bias = nn.Parameter(torch.zeros(width))

    def forward(self, codes: Tensor, plain: Tensor | None) -> Tensor:
        """Return (B, width) for codes, uint8, (B, P), and plain numbers, (B, n_plain).

        Without plain numbers the result is that of zeros.
        """
        summed: Tensor = _Product.apply(codes, self.n_codes, self.weight)  # type: ignore[no-untyped-call]
        if plain is None:
            return summed + self.bias
        return summed + torch.addmm(self.bias, plain, self.plain)
