"""Actor, critics and outcome probabilities of a checkpoint, for decisions (docs/method.md 3.1).

HTTP route, live cell and evaluations use the same forward passes; torch only trains.
"""

import numpy as np
import torch
from numpy.typing import NDArray

from app.errors import CheckpointMismatch
from app.policies.checkpoints.checkpoint import (
    CHOOSING,
    Checkpoint,
    expect_layout,
    require_purpose,
)
from app.policies.checkpoints.model_state import under
from app.policies.configs.fields import read_config
from app.policies.configs.pick import PickPreset
from app.policies.networks.actor_critic import BASE_WEIGHT
from app.policies.networks.forward import ForwardPass
from app.policies.networks.outcome import CLIP, OutcomeHead, OutcomePrediction, combine
from app.policies.networks.pick import LAYOUTS, actor_of, critics_for
from app.sim.robot.kernels.arm import CONTROLLED

Floats = NDArray[np.float32]


def pick_preset_of(checkpoint: Checkpoint) -> PickPreset:
    """Return the training configuration of a checkpoint of the pick scenario.

    Raises:
        InvalidInput: The checkpoint has another purpose or an invalid configuration.
    """
    require_purpose(checkpoint, CHOOSING)
    return read_config(PickPreset, checkpoint.manifest["preset"], "manifest.preset")


class ValueNetworks:
    """Actor, critics and outcome networks; safe to call from several threads.

    Args:
        checkpoint: A ``policy`` checkpoint.

    Raises:
        CheckpointMismatch: The layout of observations or actions is another one.
    """

    def __init__(self, checkpoint: Checkpoint) -> None:
        preset = pick_preset_of(checkpoint)
        expect_layout(checkpoint, LAYOUTS[preset.episode.observation], CONTROLLED)
        self.n_obs = sum(size for _, size in checkpoint.manifest["layout"])
        """Length of the observations."""
        actor, critics = actor_of(preset, self.n_obs), critics_for(preset, self.n_obs)
        outcome, arrays = OutcomeHead(self.n_obs), checkpoint.arrays()
        self.predicts = "outcome.mean" in arrays
        """Whether the checkpoint predicts outcomes."""
        parts: dict[str, torch.nn.Module] = {"actor": actor, "critic": critics}
        if self.predicts:
            parts["outcome"] = outcome
        for name, module in parts.items():
            try:
                module.load_state_dict(under(arrays, name))
            except RuntimeError as error:
                raise CheckpointMismatch("tensors", f"those of {name}", str(error)) from error
        self._base, self._fade = actor.base, actor.fade
        self._actor = ForwardPass(actor.net)
        self._critics = [ForwardPass(critic.children()) for critic in critics.children()]
        self._members = [ForwardPass(member.children()) for member in outcome.members]
        self._mean, self._scale = outcome.mean.numpy(), outcome.scale.numpy()
        self._widen = float(outcome.widen)

    def act_and_value(self, obs: Floats) -> tuple[Floats, Floats]:
        """Return actions, shape (n, 5), and values, shape (n,), of observations."""
        both = np.empty((len(obs), self.n_obs + CONTROLLED), dtype=np.float32)
        varying = np.ones(both.shape[1], dtype=bool)
        varying[: self.n_obs] = (obs != obs[:1]).any(axis=0)
        act = self._act(obs, self._actor(obs, varying[: self.n_obs]))
        both[:, : self.n_obs], both[:, self.n_obs :] = obs, act
        values = [critic(both, varying) for critic in self._critics]
        return act, np.minimum.reduce(values)[:, 0]

    def _act(self, obs: Floats, residual: Floats) -> Floats:
        """Return the actions that add residuals to base motions (``ResidualActor``)."""
        base = obs[:, self._base].clip(-1.0, 1.0)
        act: Floats = np.tanh(residual + np.arctanh(np.float32(BASE_WEIGHT) * base))
        if self._fade is None:
            return act
        place, full, zero = self._fade
        share = ((zero - obs[:, place : place + 1]) / (zero - full)).clip(0.0, 1.0)
        faded: Floats = base + share * (act - base)
        return faded

    def predict(self, obs: Floats, values: Floats) -> OutcomePrediction | None:
        """Return the predicted outcomes of observations; None without such a network.

        Args:
            obs: Observations, shape (n, n_obs).
            values: The critic's values, shape (n,).
        """
        if not self.predicts:
            return None
        rows = np.empty((len(obs), self.n_obs + 1), dtype=np.float32)
        np.subtract(obs, self._mean[:-1], out=rows[:, :-1])
        np.subtract(values, self._mean[-1], out=rows[:, -1])
        rows /= self._scale
        rows.clip(-CLIP, CLIP, out=rows)
        varying = (rows != rows[:1]).any(axis=0)
        return combine(
            np.stack([member(rows, varying) for member in self._members]), self._widen
        )
