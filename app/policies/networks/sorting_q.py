"""Networks that value the moves of the sorting task.

:class:`SharedNetwork` (ours) applies the same weights to every tower. Its inputs per tower are
colours relative to the tower's own and the remaining work only: *misplaced* objects, which must
be removed (from the top down), and *needed* ones, which must be added (from the lowest level
that differs from the goal up). A failed pick changes nothing, so the true value of a pick is
linear in the failure probability of its slot. The network outputs value and slope per object
type and tower; the value never increases with the failure probability, so that the riskier of
two duplicates is never preferred.

:class:`PrintedNetwork` is that of the thesis: one-hot codes, two layers of 128 (table 3.1) in
each of two streams; :class:`InformedNetwork` also observes failure probabilities.

Both are dueling: ``Q = V + A - mean A``. :class:`SharedNetwork` takes the mean over valid moves
and gives all others the value ``NEVER``, in exploration, targets and prediction.

Source: docs/method.md 1.4; Wang et al., *Dueling network architectures* (2016).
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from app.policies.networks.actor_critic import initialise_glorot
from app.policies.networks.one_hot import OneHotLinear
from app.sim.sorting.kernels.task import FAILURE_SCALE
from app.sim.sorting.state import SortingShape

NEVER = -1e9
"""Value of a move that changes nothing."""
BACK_SLOPE = 0.3
"""Largest effect of the failure probability of a free slot, from 0 to 1, on the value of a move
to it: an object there takes more attempts to pick again, if it is picked again at all."""
WINDOW = 4
"""Number of misplaced and of needed objects of a tower that are observed one by one; the others
are only counted."""


def layout_of(shape: SortingShape) -> list[list[Any]]:
    """Return names and sizes of the groups of an observation."""
    k, c = shape.n_slots, shape.n_colours
    return [["clutter", k], ["towers", c * k], ["goal", c * k], ["fail", k]]


def groups_of(shape: SortingShape, obs: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Return clutter (B, K), towers and goal (B, C, K), and failure probabilities (B, K)."""
    k, c = shape.n_slots, shape.n_colours
    clutter, towers, goal, fail = torch.split(obs, [k, c * k, c * k, k], dim=1)
    towers, goal = (one.long().view(-1, c, k) for one in (towers, goal))
    return clutter.long(), towers, goal, fail.float() / FAILURE_SCALE


def valid_moves(clutter: Tensor, towers: Tensor) -> Tensor:
    """Return which moves change the state, (B, n_actions), as ``sorting.valid_moves``.

    Args:
        clutter: Codes of the slots, (B, K).
        towers: Codes of the towers, (B, C, K).
    """
    n, n_towers, k = towers.shape
    there, tops = clutter > 0, (towers > 0).any(dim=2)
    own = torch.eye(n_towers, dtype=torch.bool, device=towers.device)
    place = there[:, :, None].expand(n, k, n_towers)
    back = tops[:, :, None] & ~there[:, None, :]
    across = tops[:, :, None] & ~own
    return torch.cat([place.flatten(1), back.flatten(1), across.flatten(1)], dim=1)


def dueling(value: Tensor, advantage: Tensor, valid: Tensor) -> Tensor:
    """Return ``V + A - mean A``, (B, n_actions), with the mean over valid moves.

    Args:
        value: V, (B, 1).
        advantage: A, (B, n_actions).
        valid: Whether a move is valid, (B, n_actions).
    """
    share = valid.float() / valid.sum(dim=1, keepdim=True).clamp(min=1)
    return value + advantage - (advantage * share).sum(dim=1, keepdim=True)


class SharedNetwork(nn.Module):
    """Values of all moves, with one set of weights for all towers."""

    relative: Tensor
    """Codes with colours relative to each tower's, (C, n_types + 1)."""
    absolute: Tensor
    """The inverse mapping, (C, n_types + 1)."""

    def __init__(self, shape: SortingShape, width: int) -> None:
        super().__init__()
        self.shape = shape
        n_colours, n_types = shape.n_colours, shape.n_types
        codes = n_types + 1
        relative = _relative_codes(shape)
        self.register_buffer("relative", relative, persistent=False)
        self.register_buffer("absolute", relative.argsort(dim=1), persistent=False)
        n_in = 2 * WINDOW * codes + 4 * codes + 4
        self.tower = nn.Sequential(
            nn.Linear(n_in, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU()
        )
        self.joint = nn.Sequential(nn.Linear(n_colours * width, width), nn.ReLU())
        self.head = nn.Linear(width, 2 * n_types + 2 + n_colours)
        self.value = nn.Linear(width, 1)

    def forward(self, obs: Tensor) -> Tensor:
        """Return the values of all moves, NEVER where nothing changes, (B, n_actions)."""
        clutter, towers, goal, fail = groups_of(self.shape, obs)
        n, n_towers, _ = towers.shape
        seen = self.tower(self._features(clutter, towers, goal, fail))
        # Inputs of a tower come first, then those of the others in order of their colours.
        order = torch.arange(n_towers, device=obs.device)
        order = (order[:, None] + order[None, :]) % n_towers
        joint = self.joint(seen[:, order].flatten(2))
        valid = valid_moves(clutter, towers)
        advantage = self._advantages(self.head(joint), clutter, towers, fail)
        value = self.value(joint).mean(dim=1)
        return dueling(value, advantage, valid).masked_fill(~valid, NEVER)

    def best(self, obs: Tensor) -> Tensor:
        """Return the moves of greatest value, (B,)."""
        best: Tensor = self(obs).argmax(dim=1)
        return best

    def _features(self, clutter: Tensor, towers: Tensor, goal: Tensor, fail: Tensor) -> Tensor:
        """Return the inputs of every tower, (B, C, n_in)."""
        n, n_towers, k = towers.shape
        codes, levels = self.shape.n_types + 1, torch.arange(k, device=towers.device)
        rel_tower = self.relative[torch.arange(n_towers)[None, :, None], towers]
        rel_goal = self.relative[torch.arange(n_towers)[None, :, None], goal]
        height, wanted = (towers > 0).sum(dim=2), (goal > 0).sum(dim=2)
        same = (towers == goal).long().cumprod(dim=2).sum(dim=2)
        in_place = torch.minimum(same, torch.minimum(height, wanted))
        misplaced = rel_tower * (levels >= in_place[:, :, None])
        needed = rel_goal * (levels >= in_place[:, :, None])
        steps = levels[:WINDOW] if k >= WINDOW else torch.arange(WINDOW, device=towers.device)
        up = (in_place[:, :, None] + steps).clamp(max=k - 1)
        fits = in_place[:, :, None] + steps < k
        down = height[:, :, None] - 1 - steps
        next_needed = needed.gather(2, up) * fits
        next_misplaced = misplaced.gather(2, down.clamp(min=0)) * (down >= 0)
        counts = clutter.new_zeros((n, codes), dtype=torch.float32)
        counts.scatter_add_(1, clutter, torch.ones_like(fail))
        safest = torch.ones_like(counts).scatter_reduce_(1, clutter, fail, "amin")
        absolute = self.absolute.expand(n, -1, -1)
        parts = [
            functional.one_hot(next_needed, codes).flatten(2).float(),
            functional.one_hot(next_misplaced, codes).flatten(2).float(),
            _histogram(needed, codes),
            _histogram(misplaced, codes),
            counts[:, None].expand(-1, n_towers, -1).gather(2, absolute) / 2.0,
            safest[:, None].expand(-1, n_towers, -1).gather(2, absolute),
            (height - in_place)[:, :, None] / 4.0,
            (wanted - in_place)[:, :, None] / 4.0,
            (height == in_place)[:, :, None].float(),
            (wanted == in_place)[:, :, None].float(),
        ]
        return torch.cat(parts, dim=2)

    def _advantages(self, out: Tensor, clutter: Tensor, towers: Tensor, fail: Tensor) -> Tensor:
        """Return the advantages of all moves, (B, n_actions), from the outputs of the towers.

        The gain of a tower from an object does not depend on where it comes from. A move from
        another tower cannot fail; the gain of that tower from the removal is added.

        Args:
            out: Outputs of the head, (B, C, 2 n_types + 2 + C).
            clutter: Codes of the slots, (B, K).
            towers: Codes of the towers, (B, C, K).
            fail: Failure probabilities of the slots, (B, K).
        """
        n, n_towers, _ = out.shape
        n_types = self.shape.n_types
        gain, slope, back, across = torch.split(out, [n_types, n_types, 2, n_towers], dim=2)
        # (B, K, C): type of each slot's object, relative to each tower.
        kind = (self.relative.T[clutter] - 1).clamp(min=0)
        per_slot = kind.transpose(1, 2)
        risk = functional.softplus(slope).gather(2, per_slot) * fail[:, None]
        place = (gain.gather(2, per_slot) - risk).transpose(1, 2)
        preference = BACK_SLOPE * torch.tanh(back[:, :, 1:])
        free = back[:, :, :1] + preference * fail[:, None]
        # Column j of a tower's output concerns the tower j colours further.
        order = torch.arange(n_towers, device=out.device)
        order = (order[None, :] - order[:, None]) % n_towers
        over = across.gather(2, order.expand(n, -1, -1))
        # (B, C from, C to): type of each top object, relative to the tower it is moved to.
        top = towers.gather(2, ((towers > 0).sum(dim=2, keepdim=True) - 1).clamp(min=0))
        top_kind = (self.relative.T[top.squeeze(2)] - 1).clamp(min=0)
        over = over + gain.gather(2, top_kind.transpose(1, 2)).transpose(1, 2)
        return torch.cat([place.flatten(1), free.flatten(1), over.flatten(1)], dim=1)


class PrintedNetwork(nn.Module):
    """Two dueling streams of two layers each over one-hot codes (table 3.1).

    As in Stable-Baselines 2, the library of the thesis, value and advantages have hidden layers
    of their own. Failure probabilities are not observed: the policy has to learn them.
    """

    informed = False
    """Whether failure probabilities are observed."""

    def __init__(self, shape: SortingShape, width: int) -> None:
        super().__init__()
        self.n_places = shape.n_slots * (1 + 2 * shape.n_colours)
        sizes = self.n_places, shape.n_types + 1, shape.n_slots, width
        self.advantage_first, self.value_first = OneHotLinear(*sizes), OneHotLinear(*sizes)
        self.advantage = _second_layer(width, shape.n_actions)
        self.value = _second_layer(width, 1)
        initialise_glorot(self)

    def forward(self, obs: Tensor) -> Tensor:
        """Return the values of all moves, (B, n_actions), valid or not."""
        codes, fail = self._split(obs)
        advantage = self.advantage(self.advantage_first(codes, fail))
        value = self.value(self.value_first(codes, fail))
        values: Tensor = value + advantage - advantage.mean(dim=1, keepdim=True)
        return values

    def best(self, obs: Tensor) -> Tensor:
        """Return the moves of greatest value, (B,): those of greatest advantage."""
        advantage: Tensor = self.advantage(self.advantage_first(*self._split(obs)))
        return advantage.argmax(dim=1)

    def _split(self, obs: Tensor) -> tuple[Tensor, Tensor | None]:
        """Return codes, and failure probabilities if they are observed."""
        codes = obs[:, : self.n_places].to(torch.uint8).contiguous()
        fail = obs[:, self.n_places :].float() / FAILURE_SCALE if self.informed else None
        return codes, fail


def _second_layer(width: int, n_out: int) -> nn.Sequential:
    """Return the layers of a stream after its first one."""
    return nn.Sequential(nn.ReLU(), nn.Linear(width, width), nn.ReLU(), nn.Linear(width, n_out))


class InformedNetwork(PrintedNetwork):
    """:class:`PrintedNetwork` with the failure probabilities of the slots as inputs."""

    informed = True


def _relative_codes(shape: SortingShape) -> Tensor:
    """Return codes with colours relative to each tower's own, (C, n_types + 1)."""
    rows = []
    for tower in range(shape.n_colours):
        turned = [
            shape.code((shape.colour_of(code) - tower) % shape.n_colours, shape.size_of(code))
            for code in range(1, shape.n_types + 1)
        ]
        rows.append([0, *turned])
    return torch.tensor(rows)


def _histogram(codes: Tensor, n: int) -> Tensor:
    """Return half the count of each code but 0 along the last axis, (B, C, n)."""
    counts = codes.new_zeros((*codes.shape[:2], n), dtype=torch.float32)
    counts.scatter_add_(2, codes, (codes > 0).float())
    return counts / 2.0


NETWORKS: Mapping[str, type[SharedNetwork] | type[PrintedNetwork]] = MappingProxyType(
    {"shared": SharedNetwork, "printed": PrintedNetwork, "printed-informed": InformedNetwork}
)
"""Networks by the name that presets give them."""
