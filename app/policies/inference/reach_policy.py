"""A trained policy of the reach scenario, for inference.

The network is evaluated from the checkpoint's tensors by numpy, and by a kernel for few states,
because the overhead of a library exceeds the computation.

Source: docs/method.md 2.2 to 2.4.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.errors import CheckpointMismatch, InvalidInput
from app.policies.checkpoints.checkpoint import (
    REACHING,
    Checkpoint,
    expect_layout,
    require_purpose,
)
from app.policies.checkpoints.model_state import tensors_under
from app.policies.configs.fields import read_config
from app.policies.configs.reach import ReachPreset
from app.policies.inference.trained_policy import TrainedPolicy
from app.policies.networks.actor_critic import BASE_WEIGHT, SET_WIDTH, PeopleSetShape
from app.policies.networks.ddpg import CLIP, RunningNormalisation
from app.sim.core.arrays import Vec
from app.sim.core.jit import direct
from app.sim.people.kernels.people import MAX_PEOPLE
from app.sim.prediction.kernels.networks import Network
from app.sim.reach.batch import N_ACT, GoalRule, LimitRule, ViewName, goal_region_of
from app.sim.reach.goal_sets import OF_GRID, halton_targets
from app.sim.reach.kernels import option_features, people_set
from app.sim.reach.kernels.observation import BASE_START, N_FEATURES, SIZES, STATE_SIZES
from app.sim.reach.recipe_rules import BlockedRules
from app.sim.reach.rollout.kernels.actor import (
    FEW,
    CompiledActor,
    act_batch,
    new_compiled_actor,
)
from app.sim.robot.actions import ActionSettings

LAYOUTS = {
    "features": [[name, size] for name, size in SIZES],
    "state": [[name, size] for name, size in STATE_SIZES],
    "forecast": [[name, size] for name, size in (*SIZES, *option_features.SIZES)],
    "people-set": [
        [name, size] for name, size in (*SIZES, *option_features.SIZES, *people_set.SIZES)
    ],
}
"""Names and sizes of the groups of each kind of observation, as manifests carry them."""
PEOPLE_SET = PeopleSetShape(
    N_FEATURES + option_features.N_OPTION_FEATURES, MAX_PEOPLE, people_set.N_BLOCK
)
"""Position of the people set in the observation of that name."""
MAX_LAYERS = 16
"""Most layers of a network taken from a checkpoint."""

ACTOR_LAYERS, SET_LAYERS = "actor.net", "actor.people_set.0.block"
"""Prefix of the names of an actor's tensors."""
NORMALISATION = "actor.norm"
"""Prefix of the names of the tensors that normalise observations."""

Floats = NDArray[np.float32]
Layer = tuple[Floats, Floats]


def blocked_rules_of(preset: ReachPreset) -> BlockedRules | None:
    """Return the rules of an arm that contacts block; None where they do not."""
    if preset.episode.collision != "blocks":
        return None
    alone = preset.reward.bonus == "alone"
    return BlockedRules(command_cost=preset.reward.c_u, bonus_alone=alone)


class ReachPolicy(TrainedPolicy):
    """Reach policy of a checkpoint; safe to call from several threads.

    Args:
        checkpoint: A ``policy`` checkpoint of a reach preset.

    Raises:
        CheckpointMismatch: The checkpoint has another task, network or layout.
        InvalidInput: The preset names an unknown rule.
    """

    def __init__(self, checkpoint: Checkpoint) -> None:
        require_purpose(checkpoint, REACHING)
        manifest = checkpoint.manifest
        preset = read_config(ReachPreset, manifest["preset"], "manifest.preset")
        super().__init__(checkpoint)
        self.trained_range: Mapping[str, Mapping[str, list[float]]] = manifest["trained_range"]
        """Minimum and maximum of each state variable in training."""
        self.view: ViewName = preset.episode.observation
        """Kind of observation."""
        expect_layout(checkpoint, LAYOUTS[self.view], N_ACT)
        self.goals: GoalRule = preset.episode.goals
        """Set of the training goals."""
        self.limits: LimitRule = preset.episode.limits
        """Limits of the joints in training."""
        self.blocked: BlockedRules | None = blocked_rules_of(preset)
        """Rules of an arm that contacts block in training; None where they do not."""
        self.dt: float = self._cell.robot.dt
        """Control period of the training cell [s]."""
        self.action: ActionSettings = preset.action.settings
        """Meaning of the actions (docs/method.md 2.2)."""
        self.targets: Vec | None = None
        """Training targets [m], shape (n, 3); None for a whole box."""
        if self.goals in OF_GRID:
            self.targets = goal_region_of(self._cell).targets()
        elif self.goals == "halton":
            self.targets = halton_targets(goal_region_of(self._cell), preset.episode.n_halton)
        self.n_obs = sum(size for _, size in manifest["layout"])
        """Length of an observation."""
        arrays, n_seen = checkpoint.arrays(), self.n_obs
        self._set_layers: tuple[Layer, ...] = ()
        if self.view == "people-set":
            self._set_layers = _layers_of(arrays, SET_LAYERS, PEOPLE_SET.n_block, SET_WIDTH)
            n_seen = PEOPLE_SET.first + SET_WIDTH
        self._layers = _layers_of(arrays, ACTOR_LAYERS, n_seen, N_ACT)
        self.moments: tuple[Floats, Floats] | None = None
        """Mean and deviation that normalise observations, shape (n_obs,) each; None: none."""
        if preset.networks.normalisation == "running":
            self.moments = _moments_of(arrays, self.n_obs)
        self.is_residual = preset.networks.actor == "residual"
        """Whether the network adds to the action of the base controller."""
        self._few = self.kernel_network
        self._actor: CompiledActor | None = None
        self._answers: Callable[..., None] | None = None

    @property
    def kernel_network(self) -> Network | None:
        """The network as kernels play it; None where it is of another kind."""
        if self.view != "forecast" or not self.is_residual or len(self._layers) != 3:
            return None
        if len(self._layers[0][1]) != len(self._layers[1][1]):
            return None
        return Network(*(array for layer in self._layers for array in layer))

    def acts(self, obs: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return actions in [-1, 1], shape (n, 6), of observations, shape (n, n_obs).

        Raises:
            InvalidInput: They have another shape.
            CheckpointMismatch: An action is not finite: sums of large weights overflow.
        """
        if obs.ndim != 2 or obs.shape[1] != self.n_obs:
            raise InvalidInput(
                "obs", list(obs.shape), f"must have the shape ['n', {self.n_obs}]"
            )
        if self._few is not None and len(obs) <= FEW:
            return _finite(self._compiled_acts(self._few, obs))
        seen = self._with_encoded_set(obs)
        if self.moments is not None:
            mean, spread = self.moments
            seen = ((obs - mean) / spread).clip(-CLIP, CLIP)
        rows = _hidden(seen, self._layers[:-1])
        weight, bias = self._layers[-1]
        rows = rows @ weight
        rows += bias
        if self.is_residual:
            base = obs[:, BASE_START : BASE_START + N_ACT].clip(-1.0, 1.0)
            rows += np.arctanh(np.float32(BASE_WEIGHT) * base)
        return _finite(np.tanh(rows, out=rows))

    def _compiled_acts(self, network: Network, obs: Floats) -> Floats:
        """Return the actions of :meth:`acts`, computed by the kernel."""
        seen = np.ascontiguousarray(obs, dtype=np.float32)
        acts = np.empty((len(seen), N_ACT), dtype=np.float32)
        if self._actor is None:
            self._actor = new_compiled_actor(network, BASE_WEIGHT)  # the kernel keeps the GIL
        arguments = self._actor, seen, acts
        if self._answers is None:
            self._answers = direct(act_batch, arguments)
        self._answers(*arguments)
        return acts

    def _with_encoded_set(self, obs: Floats) -> Floats:
        """Return the input of the first layer, with encoded people."""
        if not self._set_layers:
            return obs
        blocks = obs[:, PEOPLE_SET.first :].reshape(-1, PEOPLE_SET.n_people, PEOPLE_SET.n_block)
        found = _hidden(blocks, self._set_layers) * blocks[:, :, :1]
        return np.concatenate([obs[:, : PEOPLE_SET.first], found.max(axis=1)], axis=1)


def _finite(acts: Floats) -> Floats:
    """Return actions that are finite.

    Raises:
        CheckpointMismatch: One is not.
    """
    if not np.isfinite(acts).all():
        raise CheckpointMismatch("action", "finite numbers", "NaN or infinite")
    return acts


def _hidden(rows: Floats, layers: tuple[Layer, ...]) -> Floats:
    """Return the outputs of rectified layers over the last axis."""
    for weight, bias in layers:
        rows = rows @ weight
        rows += bias
        np.maximum(rows, 0.0, out=rows)
    return rows


def _layers_of(
    arrays: Mapping[str, NDArray[Any]], name: str, n_in: int, n_out: int
) -> tuple[Layer, ...]:
    """Return weights, shape (n_in, n_out), and biases of a network, layer by layer.

    Args:
        arrays: Tensors of a checkpoint.
        name: Prefix of the tensor names.
        n_in: Input size.
        n_out: Output size.

    Raises:
        CheckpointMismatch: The tensors do not form such a network.
    """
    layers: list[Layer] = []
    for number in range(MAX_LAYERS):
        weight = arrays.get(f"{name}.{2 * number}.weight")
        bias = arrays.get(f"{name}.{2 * number}.bias")
        if weight is None or bias is None:
            break
        if weight.ndim != 2 or weight.shape[1] != n_in or bias.shape != weight.shape[:1]:
            found = f"{list(weight.shape)} and {list(bias.shape)}"
            field = f"tensors.{name}.{2 * number}"
            raise CheckpointMismatch(field, f"[n, {n_in}] and [n]", found)
        n_in = len(bias)
        rows = np.ascontiguousarray(weight.T, dtype=np.float32)
        layers.append((rows, bias.astype(np.float32)))
    if not layers or n_in != n_out:
        raise CheckpointMismatch("tensors", f"{name} of {n_out} numbers", "none such")
    used = {f"{name}.{2 * k}.{part}" for k in range(len(layers)) for part in ("weight", "bias")}
    rest = sorted(one for one in arrays if one.startswith(f"{name}.") and one not in used)
    if rest:
        raise CheckpointMismatch("tensors", f"{name} of {len(layers)} layers only", rest[0])
    return tuple(layers)


def _moments_of(arrays: Mapping[str, NDArray[Any]], n_obs: int) -> tuple[Floats, Floats]:
    """Return mean and deviation of the observations in training, shape (n_obs,) each.

    Raises:
        CheckpointMismatch: Their tensors are missing, have another shape, or give no finite
            mean and deviation.
    """
    norm = RunningNormalisation(n_obs)
    try:
        norm.load_state_dict(tensors_under(arrays, NORMALISATION))
    except RuntimeError as error:
        raise CheckpointMismatch("tensors", "those of its normalisation", str(error)) from None
    mean, spread = (part.numpy() for part in norm.moments())
    count = norm.count.item()
    if count <= 0.0 or not np.isfinite([mean, spread]).all():
        wanted = "a positive count with finite mean and deviation"
        raise CheckpointMismatch(f"tensors.{NORMALISATION}", wanted, f"count {count:g}")
    return mean, spread
