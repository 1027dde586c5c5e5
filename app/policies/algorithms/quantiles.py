"""Distributional critics: each says quantiles of the return, and targets leave out the highest.

The quantiles of all critics for the next state are put together and sorted; the highest are
left out against overestimation, and every critic's quantiles learn from all that remain by the
quantile Huber loss.

Source: Kuznetsov et al., *Controlling overestimation bias with truncated mixture of continuous
distributional quantile critics* (2020). Deviates: TD3's actor in place of one that seeks
entropy.
"""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from app.policies.networks.actor_critic import Critics, CrowdShape
from app.sim.core.jit import FAST, kernel


class QuantileCritics(Critics):
    """Critics that say ``n_quantiles`` values each.

    Args:
        width: Units per hidden layer.
        n_obs: Length of observations.
        n_act: Numbers of an action.
        n_critics: Number of critics.
        layers: Hidden layers of each.
        normed: Whether they are normalised.
        n_quantiles: Quantiles of each.
        dropped: Highest quantiles that targets leave out, per critic.
        crowd: Where people stand as a set; None: nowhere.
    """

    def __init__(
        self,
        width: int,
        n_obs: int,
        n_act: int,
        n_critics: int = 2,
        layers: int = 2,
        normed: bool = True,
        n_quantiles: int = 25,
        dropped: int = 2,
        crowd: CrowdShape | None = None,
    ) -> None:
        super().__init__(width, n_obs, n_act, n_critics, layers, normed, n_quantiles, crowd)
        self._kept = n_critics * (n_quantiles - dropped)

    def targets(self, obs: Tensor, act: Tensor) -> Tensor:
        """Return the values that targets are made of, shape (B, K): all but the highest.

        They are in no order, and no gradients come through.
        """
        together = torch.cat(self.forward(obs, act), dim=1).float().numpy()
        apart = np.partition(together, self._kept - 1, axis=1)
        return torch.from_numpy(apart[:, : self._kept])

    def first(self, obs: Tensor, act: Tensor) -> Tensor:
        """Return the mean of all quantiles, shape (B, 1), which an actor climbs."""
        return torch.cat(self.forward(obs, act), dim=1).mean(dim=1, keepdim=True)

    def loss(
        self, obs: Tensor, act: Tensor, target: Tensor, weights: Tensor | None
    ) -> tuple[Tensor, Tensor]:
        """Return the quantile Huber loss of all critics, and errors of their means, (B,).

        Args:
            obs: Observations, (B, n_obs).
            act: Actions, (B, n_act).
            target: What they should say, (B, K).
            weights: Importance weights, (B, 1); None: all equal.
        """
        shares = torch.full((len(obs),), 1.0 / len(obs))
        if weights is not None:
            shares = shares * weights.squeeze(1)
        said = [quantiles.float() for quantiles in self.forward(obs, act)]
        loss = torch.stack([quantile_loss(one, target, shares) for one in said]).sum()
        means = torch.stack([one.detach().mean(dim=1) for one in said]).mean(dim=0)
        return loss, (means - target.mean(dim=1)).abs()


def quantile_loss(quantiles: Tensor, target: Tensor, shares: Tensor) -> Tensor:
    """Return the quantile Huber loss (threshold 1) of rows.

    Args:
        quantiles: What a critic says, (B, n).
        target: Samples that they should be quantiles of, (B, K).
        shares: What each row counts, (B,).
    """
    loss: Tensor = _QuantileLoss.apply(quantiles, target, shares)  # type: ignore[no-untyped-call]
    return loss


class _QuantileLoss(torch.autograd.Function):
    """The loss and its gradient in one compiled pass: pairs of values are never stored."""

    @staticmethod
    def forward(ctx: Any, quantiles: Tensor, target: Tensor, shares: Tensor) -> Tensor:
        gradient = np.zeros(quantiles.shape, dtype=np.float32)
        said = np.ascontiguousarray(quantiles.detach().numpy())
        wanted = np.ascontiguousarray(target.numpy())
        loss = _tilted_huber(said, wanted, shares.numpy(), gradient)
        ctx.save_for_backward(torch.from_numpy(gradient))
        return torch.tensor(loss, dtype=torch.float32)

    @staticmethod
    def backward(ctx: Any, above: Tensor) -> tuple[Tensor, None, None]:
        return above * ctx.saved_tensors[0], None, None


@kernel(error_model="numpy", fastmath=FAST | {"reassoc"})
def _tilted_huber(
    said: NDArray[np.float32],
    wanted: NDArray[np.float32],
    shares: NDArray[np.float32],
    gradient: NDArray[np.float32],
) -> float:
    """Return the loss and write its gradient by ``said``, shape (B, n)."""
    n, k_all = said.shape[1], wanted.shape[1]
    total = 0.0
    for row in range(said.shape[0]):
        share = shares[row] / np.float32(n * k_all)
        for i in range(n):
            level, value = np.float32((i + 0.5) / n), said[row, i]
            loss, slope = np.float32(0.0), np.float32(0.0)
            for k in range(k_all):
                error = wanted[row, k] - value
                tilt = level if error >= 0.0 else np.float32(1.0) - level
                cut = min(np.float32(1.0), max(np.float32(-1.0), error))
                loss += tilt * cut * (error - np.float32(0.5) * cut)
                slope += tilt * cut
            gradient[row, i] = -share * slope
            total += share * loss
    return total
