"""Actor, critics and outcome probabilities of a checkpoint, for decisions (docs/method.md 3.1).

HTTP route, live cell and evaluations use the same forward passes; torch only trains.
"""

from collections.abc import Callable

import numpy as np
import torch

from app.errors import CheckpointMismatch
from app.policies.checkpoints.checkpoint import (
    CHOOSING,
    Checkpoint,
    expect_layout,
    require_purpose,
)
from app.policies.checkpoints.model_state import tensors_under
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.configs.fields import read_config
from app.policies.configs.pick import PickPreset
from app.policies.networks.actor_critic import ResidualActor
from app.policies.networks.candidate_values import (
    ActorCritic,
    add_base,
    compare,
    evaluate_few,
    new_workspace,
)
from app.policies.networks.forward import (
    FEW,
    MANY,
    Floats,
    Layers,
    centred_layers_of,
    forward_many,
    new_columns,
)
from app.policies.networks.large_pages import in_large_pages
from app.policies.networks.outcome import (
    CLIP,
    N_OUT,
    OutcomeHead,
    OutcomePrediction,
    combine_members,
    new_prediction,
)
from app.policies.networks.pick import LAYOUTS, actor_of, critics_for
from app.sim.core.arrays import Vec
from app.sim.core.jit import direct
from app.sim.pick.kernels.observation_layout import N_FEATURES
from app.sim.pick.raw_state import raw_state
from app.sim.robot.kernels.arm import CONTROLLED
from app.sim.scene.scene import arm_of


def pick_preset_of(checkpoint: Checkpoint) -> PickPreset:
    """Return the training configuration of a checkpoint of the pick scenario.

    Raises:
        InvalidInput: The checkpoint has another purpose or an invalid configuration.
    """
    require_purpose(checkpoint, CHOOSING)
    return read_config(PickPreset, checkpoint.manifest["preset"], "manifest.preset")


def _joint_speeds(checkpoint: Checkpoint) -> Vec:
    """Return the largest joint speeds in the cell of the training [rad/s], shape (6,)."""
    return arm_of(cell_of(checkpoint.manifest)).limits.qd_max


def _skipping(layers: Layers, first: int, n: int) -> Layers:
    """Return layers that ignore ``n`` more inputs from number ``first`` on."""
    weight = np.insert(layers[0].weight, [first] * n, 0.0, axis=0)
    return (layers[0]._replace(weight=weight), *layers[1:])


def _averaged(layers: Layers) -> Layers:
    """Return layers whose output is the mean of all outputs, such as quantiles."""
    last = layers[-1]
    weight, bias = last.weight.mean(axis=1, keepdims=True), last.bias.mean(keepdims=True)
    return (*layers[:-1], last._replace(weight=weight, bias=bias))


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
        n = sum(size for _, size in checkpoint.manifest["layout"])
        actor, critics = actor_of(preset, n), critics_for(preset, n)
        self._qd_max = None if isinstance(actor, ResidualActor) else _joint_speeds(checkpoint)
        self.n_obs = n if self._qd_max is None else N_FEATURES
        """Length of the observations; policies of the raw state read it from features."""
        self._n = n if self._qd_max is None else n + CONTROLLED
        outcome, arrays = OutcomeHead(self._n), checkpoint.arrays()
        self.predicts = "outcome.mean" in arrays
        """Whether the checkpoint predicts outcomes."""
        parts: dict[str, torch.nn.Module] = {"actor": actor, "critic": critics}
        given = {name: tensors_under(arrays, name) for name in parts}
        if self.predicts:
            parts["outcome"] = outcome  # older checkpoints do not state the offsets
            given["outcome"] = {"between": outcome.between, **tensors_under(arrays, "outcome")}
        for name, module in parts.items():
            try:
                module.load_state_dict(given[name])
            except RuntimeError as error:
                raise CheckpointMismatch("tensors", f"those of {name}", str(error)) from error
        self.between = outcome.between.numpy()
        """Least and greatest offset of the log-odds of each outcome between cells, (3, 2)."""
        base, fade = n, None
        if isinstance(actor, ResidualActor):
            base, fade = actor.base.start, actor.fade
        still = self._n - n  # a plain actor corrects a base motion of 0 behind its inputs
        self._networks = in_large_pages(
            ActorCritic(
                actor=_skipping(centred_layers_of(actor.net), n, still),
                critics=tuple(
                    _averaged(_skipping(centred_layers_of(one.children()), n, still))
                    for one in critics.children()
                ),
                members=tuple(
                    centred_layers_of(member.children()) for member in outcome.members
                ),
                base=base,
                fade=np.array(fade or (), dtype=np.float32),
                mean=outcome.mean.numpy(),
                scale=outcome.scale.numpy(),
                widen=float(outcome.widen),
                between=self.between,
            )
        )
        self._work = new_workspace(self._networks, self._n, CONTROLLED)  # kept by the GIL
        self._few: Callable[..., None] | None = None

    def evaluate(
        self, obs: Floats, *, predict: bool = True
    ) -> tuple[Floats, Floats, OutcomePrediction | None]:
        """Return actions, values and outcomes of observations.

        Args:
            obs: Observations, shape (n, n_obs), contiguous.
            predict: Whether to predict outcomes.

        Returns:
            Actions, shape (n, 5), values, shape (n,), and predicted outcomes; None where they
            are not asked for or the checkpoint does not predict them.
        """
        obs = self._seen(obs)
        act = np.empty((len(obs), CONTROLLED), dtype=np.float32)
        values, outcomes = np.empty(len(obs), dtype=np.float32), new_prediction(len(obs))
        predict = predict and self.predicts
        if len(obs) > FEW:
            every = self._networks.actor, *self._networks.critics, *self._networks.members
            work = new_columns(every)
            for k in range(0, len(obs), MANY):
                rows = slice(k, k + MANY)
                part = OutcomePrediction(*(one[rows] for one in outcomes)) if predict else None
                self._evaluate_many(obs[rows], act[rows], values[rows], part, work)
        else:
            arguments = self._networks, obs, self._work, act, values, outcomes
            if self._few is None:
                self._few = direct(evaluate_few, arguments)
            self._few(*arguments)
        return act, values, outcomes if predict else None

    def require_finite(self, obs: Floats) -> None:
        """Check that each network gives finite numbers.

        The least of two critics may be finite where one is not.

        Args:
            obs: Observations, shape (n, n_obs), n at most ``MANY``, contiguous.

        Raises:
            CheckpointMismatch: A number is not finite: sums of large weights overflow.
        """
        act, _, outcomes = self.evaluate(obs)
        nets, seen = self._networks, self._seen(obs)
        rows, work = np.hstack([seen, act]), new_columns((nets.actor, *nets.critics))

        def are_finite(layers: Layers, given: Floats) -> bool:
            columns, constant = np.ascontiguousarray(given.T), np.zeros_like(given[:1])
            varying = np.ones(given.shape[1], dtype=np.bool_)
            found = forward_many(layers, columns, constant, varying, work)
            return bool(np.isfinite(found).all())

        finite = {
            "action": are_finite(nets.actor, seen),
            "value": all(are_finite(critic, rows) for critic in nets.critics),
            "outcome": all(np.isfinite(one).all() for one in outcomes or ()),
        }
        for name, is_finite in finite.items():
            if not is_finite:
                raise CheckpointMismatch(name, "finite numbers", "NaN or infinite")

    def _seen(self, obs: Floats) -> Floats:
        """Return the inputs of the networks, which may be the raw state."""
        if self._qd_max is None:
            return obs
        state = raw_state(obs, self._qd_max)
        return np.hstack([state, np.zeros((len(obs), CONTROLLED), dtype=np.float32)])

    def _evaluate_many(
        self,
        obs: Floats,
        act: Floats,
        values: Floats,
        outcomes: OutcomePrediction | None,
        work: Floats,
    ) -> None:
        """Fill actions, values and outcomes, where they are asked for, of many observations."""
        nets, n = self._networks, self._n
        varying = np.empty(n + CONTROLLED, dtype=np.bool_)
        compare(obs, varying[:n])
        varying[n:] = True
        one = np.zeros((1, n + CONTROLLED), dtype=np.float32)
        one[0, :n] = obs[0]
        (places,) = varying[:n].nonzero()
        inputs = np.empty((len(places) + CONTROLLED, len(obs)), dtype=np.float32)
        inputs[: len(places)] = obs[:, places].T
        act[:] = forward_many(nets.actor, inputs[: len(places)], obs[:1], varying[:n], work).T
        add_base(obs, nets.base, nets.fade, act)
        inputs[len(places) :] = act.T
        values[:] = np.inf
        for critic in nets.critics:
            np.minimum(values, forward_many(critic, inputs, one, varying, work)[0], out=values)
        if outcomes is None:
            return
        inputs[len(places)] = values
        places, seen = np.append(places, n), inputs[: len(places) + 1]
        seen -= nets.mean[places, None]
        seen /= nets.scale[places, None]
        seen.clip(-CLIP, CLIP, out=seen)
        one = ((one[:, : n + 1] - nets.mean) / nets.scale).clip(-CLIP, CLIP)
        outputs = np.empty((len(nets.members), len(obs), N_OUT), dtype=np.float32)
        for member, output in zip(nets.members, outputs, strict=True):
            output[:] = forward_many(member, seen, one, varying[: n + 1], work).T
        combine_members(outputs, nets.widen, nets.between, outcomes)
