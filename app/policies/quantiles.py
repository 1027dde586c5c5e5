"""Distributional critics: each says quantiles of the return, and targets leave out the highest.

The quantiles of all critics for the next state are put together and sorted; the highest are
left out against overestimation, and every critic's quantiles learn from all that remain by the
quantile Huber loss.

Source: Kuznetsov et al., *Controlling overestimation bias with truncated mixture of continuous
distributional quantile critics* (2020). Deviates: TD3's actor in place of one that seeks
entropy.
"""

import torch
from torch import Tensor

from app.policies.networks import Critics


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
    ) -> None:
        super().__init__(width, n_obs, n_act, n_critics, layers, normed, n_quantiles)
        self._kept = n_critics * (n_quantiles - dropped)
        self._levels = (torch.arange(n_quantiles) + 0.5) / n_quantiles

    def targets(self, obs: Tensor, act: Tensor) -> Tensor:
        """Return the values that targets are made of, shape (B, K): all but the highest."""
        together = torch.cat(self.forward(obs, act), dim=1)
        return together.sort(dim=1).values[:, : self._kept]

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
        total, means = torch.zeros(()), []
        for quantiles in self.forward(obs, act):
            quantiles = quantiles.float()
            error = target.unsqueeze(1) - quantiles.unsqueeze(2)
            size = error.abs()
            huber = torch.where(size > 1.0, size - 0.5, 0.5 * error * error)
            wrong_side = (error.detach() < 0.0).float()
            tilted = (self._levels.view(1, -1, 1) - wrong_side).abs() * huber
            rows = tilted.mean(dim=(1, 2))
            total = total + (rows if weights is None else rows * weights.squeeze(1)).mean()
            means.append(quantiles.detach().mean(dim=1))
        errors = (torch.stack(means).mean(dim=0) - target.mean(dim=1)).abs()
        return total, errors
