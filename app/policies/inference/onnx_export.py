"""Export of a pick or reach policy as an ONNX model (extra ``onnx``).

The graph is written from the tensors of the checkpoint. Every group of the observation is an
input, described by the data sheet of its environment; ``metadata_props`` contain checkpoint,
cell, training range, and what the model does not contain.
"""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from app.errors import InvalidInput
from app.policies.checkpoints.checkpoint import CHOOSING, SORTING, Checkpoint, purpose_of
from app.policies.inference.reach_policy import PEOPLE_SET, ReachPolicy
from app.policies.inference.value_networks import ValueNetworks, pick_preset_of
from app.policies.networks.actor_critic import BASE_WEIGHT, PlainActor, ResidualActor
from app.policies.networks.ddpg import CLIP
from app.policies.networks.forward import EPSILON
from app.policies.networks.pick import actor_of
from app.sim.envs.pick import PickEnv
from app.sim.envs.reach import ReachEnv
from app.sim.reach.batch import N_ACT
from app.sim.reach.kernels.observation import BASE_START
from app.sim.robot.kernels.arm import CONTROLLED

OPSET = 17
"""Version of the operators; the first with layer normalisation."""
LIMITS = (
    "The networks only: no computation of observations, no joint limits, no safety layer, no "
    "rollout, no check of the training range. Do not move a robot by this model alone."
)
RAW_STATE = """
| q, qd | 2 x 6 | the robot's joint positions and speeds [rad, rad/s] |
| human_q, human_qd | 2 x 18 | the person's joints and their speeds [m, rad; m/s, rad/s] |
| goal | 3 | target [m] |
"""
"""Groups of the raw state (5.8), as in the data sheet."""
_ROW = re.compile(r"^\s*\| ([a-z_, .]*?) \| [^|]* \| ([^|]*?) \|$", re.MULTILINE)
_TENSOR = re.compile(r"(\d+)\.weight")


class Graph:
    """Nodes and constants of a graph."""

    def __init__(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        self._arrays = arrays
        self.nodes: list[onnx.NodeProto] = []
        """The nodes."""
        self.constants: list[onnx.TensorProto] = []
        """The constants."""

    def add(self, kind: str, *inputs: str, output: str | None = None, **attributes: Any) -> str:
        """Add a node and return the name of its output."""
        name = output or f"{kind.lower()}_{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, inputs, [name], **attributes))
        return name

    def constant(self, values: Any, kind: type = np.float32) -> str:
        """Add a constant and return its name."""
        name = f"constant_{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.asarray(values, dtype=kind), name))
        return name

    def columns(self, x: str, first: int, last: int) -> str:
        """Return the columns ``first`` to ``last - 1``."""
        places = (self.constant([k], np.int64) for k in (first, last, 1))
        return self.add("Slice", x, *places)

    def clip(self, x: str, low: float, high: float) -> str:
        """Return values bounded to an interval."""
        return self.add("Clip", x, self.constant(low), self.constant(high))

    def layers(self, x: str, prefix: str, *, rectified: bool = False) -> str:
        """Return the output of linear layers, normalised or not, rectified in between.

        Args:
            x: Input; the product is over its last axis.
            prefix: Start of the names of the tensors.
            rectified: Whether the last layer is rectified, too.
        """
        start, first = f"{prefix}.", True
        names = (name.removeprefix(start) for name in self._arrays if name.startswith(start))
        for number in sorted(int(m[1]) for m in map(_TENSOR.fullmatch, names) if m):
            weight, bias = (
                self._arrays[f"{start}{number}.{part}"] for part in ("weight", "bias")
            )
            if weight.ndim == 1:
                inputs = x, self.constant(weight), self.constant(bias)
                x = self.add("LayerNormalization", *inputs, axis=-1, epsilon=EPSILON)
                continue
            if not first:
                x = self.add("Relu", x)
            first = False
            product = self.add("MatMul", x, self.constant(weight.T))
            x = self.add("Add", product, self.constant(bias))
        return self.add("Relu", x) if rectified else x

    def residual(self, net: str, base: str) -> str:
        """Return ``tanh(net + atanh(0.9 base))``; ``base`` is bounded."""
        share = self.add("Mul", base, self.constant(BASE_WEIGHT))
        return self.add("Tanh", self.add("Add", net, self.add("Atanh", share)))


def export(checkpoint: Checkpoint, name: str) -> bytes:
    """Return the ONNX model of a checkpoint.

    Args:
        checkpoint: The policy.
        name: Its name, for the metadata.

    Raises:
        InvalidInput: It is a sorting policy.
        CheckpointMismatch: Its tensors do not fit its manifest.
    """
    purpose = purpose_of(checkpoint.manifest)
    if purpose == SORTING:
        rule = (
            "is a sorting policy, which is not exported: its moves need the rules of the task; "
            "POST /v1/sorting decides"
        )
        raise InvalidInput("checkpoint", name, rule)
    graph = Graph(checkpoint.arrays())
    groups: list[tuple[str, int]] = [(group, n) for group, n in checkpoint.manifest["layout"]]
    obs = graph.add("Concat", *(group for group, _ in groups), axis=1)
    if purpose == CHOOSING:
        raw = pick_preset_of(checkpoint).episode.observation == "state"
        sheet = RAW_STATE if raw else PickEnv.__doc__ or ""
        outputs = _pick(graph, checkpoint, obs)
    else:
        outputs, sheet = _reach(graph, checkpoint, obs), ReachEnv.__doc__ or ""
    inputs = [
        _tensor(group, size, text)
        for (group, size), text in zip(groups, contents(groups, sheet), strict=True)
    ]
    made = helper.make_graph(
        graph.nodes, "policy", inputs, outputs, graph.constants, doc_string=LIMITS
    )
    model = helper.make_model(
        made, opset_imports=[helper.make_opsetid("", OPSET)], producer_name="tandem"
    )
    model.ir_version = 8  # that of the operators' version
    helper.set_model_props(model, {"name": name, **_metadata(checkpoint, purpose)})
    onnx.checker.check_model(model)
    content: bytes = model.SerializeToString()
    return content


def _pick(graph: Graph, checkpoint: Checkpoint, obs: str) -> list[onnx.ValueInfoProto]:
    """Add actor and critics of task selection."""
    preset = pick_preset_of(checkpoint)
    ValueNetworks(checkpoint)  # checks the tensors
    n_obs = sum(size for _, size in checkpoint.manifest["layout"])
    act = _pick_action(graph, actor_of(preset, n_obs), obs)
    both = graph.add("Concat", obs, act, axis=1)
    values = [
        graph.layers(both, f"critic.q{k}") for k in range(1, preset.networks.n_critics + 1)
    ]
    if preset.networks.critic == "quantiles":
        values = [graph.add("ReduceMean", one, axes=[1], keepdims=1) for one in values]
    graph.add("Min", *values, output="value")
    return [
        _tensor("action", CONTROLLED, "joint actions in [-1, 1] (docs/method.md 2.2)"),
        _tensor("value", 1, "Q(s, action): expected discounted reward; the largest is chosen"),
    ]


def _pick_action(graph: Graph, actor: ResidualActor | PlainActor, obs: str) -> str:
    if isinstance(actor, PlainActor):
        return graph.add("Tanh", graph.layers(obs, "actor.net"), output="action")
    columns = graph.columns(obs, actor.base.start, actor.base.stop)
    base = graph.clip(columns, -1.0, 1.0)
    act = graph.residual(graph.layers(obs, "actor.net"), base)
    if actor.fade is None:
        return graph.add("Identity", act, output="action")
    place, full, zero = actor.fade
    left = graph.add("Sub", graph.constant(zero), graph.columns(obs, place, place + 1))
    share = graph.clip(graph.add("Div", left, graph.constant(zero - full)), 0.0, 1.0)
    change = graph.add("Mul", share, graph.add("Sub", act, base))
    return graph.add("Add", base, change, output="action")


def _reach(graph: Graph, checkpoint: Checkpoint, obs: str) -> list[onnx.ValueInfoProto]:
    """Add the actor of a reach policy."""
    policy, seen = ReachPolicy(checkpoint), obs
    if policy.view == "people-set":
        seen = _with_encoded_set(graph, obs, policy.n_obs)
    if policy.moments is not None:
        mean, spread = (graph.constant(one) for one in policy.moments)
        seen = graph.clip(graph.add("Div", graph.add("Sub", obs, mean), spread), -CLIP, CLIP)
    net = graph.layers(seen, "actor.net")
    if policy.is_residual:
        base = graph.clip(graph.columns(obs, BASE_START, BASE_START + N_ACT), -1.0, 1.0)
        act = graph.residual(net, base)
    else:
        act = graph.add("Tanh", net)
    graph.add("Identity", act, output="action")
    return [_tensor("action", N_ACT, "joint actions in [-1, 1] (docs/method.md 2.2)")]


def _with_encoded_set(graph: Graph, obs: str, n_obs: int) -> str:
    """Return observations with the set encoding of the people."""
    first, n_people, n_block = PEOPLE_SET
    shape = graph.constant([-1, n_people, n_block], np.int64)
    blocks = graph.add("Reshape", graph.columns(obs, first, n_obs), shape)
    places = (graph.constant([k], np.int64) for k in (0, 1, 2))
    present = graph.add("Slice", blocks, *places)
    found = graph.add(
        "Mul", graph.layers(blocks, "actor.people_set.0.block", rectified=True), present
    )
    pooled = graph.add("ReduceMax", found, axes=[1], keepdims=0)
    return graph.add("Concat", graph.columns(obs, 0, first), pooled, axis=1)


def contents(groups: Sequence[tuple[str, int]], sheet: str) -> Iterator[str]:
    """Yield the content of each group, with unit and normalisation, from a data sheet.

    Args:
        groups: Names and sizes.
        sheet: Docstring of the environment, with its table of groups.
    """
    known: dict[str, str] = {}
    for names, text in _ROW.findall(sheet):
        row = [name.strip() for name in names.split(",")]
        stem = row[0].rpartition("_")[0]
        known |= {(stem + name if name.startswith("_") else name): text for name in row}
    for name, _ in groups:
        start = next((k for k in known if k.endswith("...") and name.startswith(k[:-3])), "")
        yield known.get(name) or known.get(start, "")


def _metadata(checkpoint: Checkpoint, purpose: str) -> dict[str, str]:
    manifest = checkpoint.manifest
    return {
        "checkpoint": checkpoint.sha256,
        "purpose": purpose,
        "preset": str(manifest["preset"].get("name", "")),
        "cell": manifest["cell"],
        "trained_range": json.dumps(manifest["trained_range"]),
        "units": "SI units and radians, in the robot's base frame; each input states its "
        "content, unit and normalisation",
        "limits": LIMITS,
    }


def _tensor(name: str, size: int, text: str) -> onnx.ValueInfoProto:
    return helper.make_tensor_value_info(name, TensorProto.FLOAT, ["n", size], text)
