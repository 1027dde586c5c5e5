"""Truncated quantile critics: distributional critics without the highest quantiles in targets.

The quantiles of all critics for the next state are pooled; the highest are dropped to reduce
overestimation. The remaining ones are the targets of every critic under the quantile Huber
loss.

Source: Kuznetsov et al., *Controlling overestimation bias with truncated mixture of continuous
distributional quantile critics* (2020). Deviates: the actor of TD3 in place of that of SAC.
"""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from app.policies.networks.actor_critic import Critics
from app.sim.core.jit import FAST, kernel


class QuantileCritics(Critics):
    """Critics with several quantiles of the return each.

    Args:
        networks: Map observations beside actions to quantiles.
        dropped: Number of highest quantiles dropped in targets, per critic.
    """

    def __init__(self, *networks: nn.Module, dropped: int) -> None:
        super().__init__(*networks)
        self._dropped = dropped * len(networks)

    def least(self, obs: Tensor, act: Tensor) -> Tensor:
        """Return the minimum over the critics' mean quantiles, shape (n,)."""
        means = [quantiles.mean(dim=1) for quantiles in self.forward(obs, act)]
        return torch.stack(means).amin(dim=0)

    def targets(self, obs: Tensor, act: Tensor) -> Tensor:
        """Return the quantiles for targets, shape (B, K): all but the highest.

        They are unordered and without gradient.
        """
        together = torch.cat(self.forward(obs, act), dim=1).float().numpy()
        kept = together.shape[1] - self._dropped
        apart = np.partition(together, kept - 1, axis=1)
        return torch.from_numpy(apart[:, :kept])

    def first(self, obs: Tensor, act: Tensor) -> Tensor:
        """Return the value that the actor maximises, shape (B, 1): the mean quantile."""
        return torch.cat(self.forward(obs, act), dim=1).mean(dim=1, keepdim=True)

    def loss(
        self, obs: Tensor, act: Tensor, target: Tensor, weights: Tensor | None
    ) -> tuple[Tensor, Tensor]:
        """Return the quantile Huber loss of all critics, and errors of their means, shape (B,).

        Args:
            obs: Observations, shape (B, n_obs).
            act: Actions, shape (B, n_act).
            target: Target values, shape (B, K).
            weights: Importance weights, shape (B, 1); None for equal weights.
        """
        shares = torch.full((len(obs),), 1.0 / len(obs))
        if weights is not None:
            shares = shares * weights.squeeze(1)
        predicted = [quantiles.float() for quantiles in self.forward(obs, act)]
        loss = torch.stack([quantile_loss(one, target, shares) for one in predicted]).sum()
        means = torch.stack([one.detach().mean(dim=1) for one in predicted]).mean(dim=0)
        return loss, (means - target.mean(dim=1)).abs()


def quantile_loss(quantiles: Tensor, target: Tensor, shares: Tensor) -> Tensor:
    """Return the weighted sum of quantile Huber losses (threshold 1).

    Args:
        quantiles: Quantiles of a critic, shape (B, n).
        target: Samples of the target distribution, shape (B, K).
        shares: Weight of each row, shape (B,).
    """
    loss: Tensor = _QuantileLoss.apply(quantiles, target, shares)  # type: ignore[no-untyped-call]
    return loss


class _QuantileLoss(torch.autograd.Function):
    """Loss and gradient in one compiled pass, without storing pairs of values."""

    @staticmethod
    def forward(ctx: Any, quantiles: Tensor, target: Tensor, shares: Tensor) -> Tensor:
        gradient = np.zeros(quantiles.shape, dtype=np.float32)
        predicted = np.ascontiguousarray(quantiles.detach().numpy())
        target_values = np.ascontiguousarray(target.numpy())
        loss = _tilted_huber(predicted, target_values, shares.numpy(), gradient)
        ctx.save_for_backward(torch.from_numpy(gradient))
        return torch.tensor(loss, dtype=torch.float32)

    @staticmethod
    def backward(ctx: Any, above: Tensor) -> tuple[Tensor, None, None]:
        return above * ctx.saved_tensors[0], None, None


@kernel(error_model="numpy", fastmath=FAST | {"reassoc"})
def _tilted_huber(
    predicted: NDArray[np.float32],
    target_values: NDArray[np.float32],
    shares: NDArray[np.float32],
    gradient: NDArray[np.float32],
) -> float:
    """Return the loss and write its gradient by ``predicted``, shape (B, n)."""
    n, k_all = predicted.shape[1], target_values.shape[1]
    total = 0.0
    for row in range(predicted.shape[0]):
        share = shares[row] / np.float32(n * k_all)
        for i in range(n):
            level, value = np.float32((i + 0.5) / n), predicted[row, i]
            loss, slope = np.float32(0.0), np.float32(0.0)
            for k in range(k_all):
                error = target_values[row, k] - value
                tilt = level if error >= 0.0 else np.float32(1.0) - level
                cut = min(np.float32(1.0), max(np.float32(-1.0), error))
                loss += tilt * cut * (error - np.float32(0.5) * cut)
                slope += tilt * cut
            gradient[row, i] = -share * slope
            total += share * loss
    return total
