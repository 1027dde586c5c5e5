"""Task selection by the critic (docs/method.md 3.1).

``R_i = Q(s_i, pi(s_i))`` for every candidate, with the smaller of both critics; the candidate
with the greatest value is selected. With hysteresis the previous target is kept unless another
one is better by a margin, which prevents oscillation. HTTP route, live cell and evaluations use
the same networks.

Source: thesis eq. (5.1)-(5.7). Deviates: hysteresis is ours; 0 gives the source's rule.
"""

import time
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from app.errors import CheckpointMismatch, InvalidInput
from app.policies.checkpoints.checkpoint import (
    CHOOSING,
    Checkpoint,
    expect_layout,
    require_purpose,
)
from app.policies.checkpoints.model_state import under
from app.policies.configs.fields import read_config
from app.policies.configs.pick import PickPreset
from app.policies.inference.trained_policy import TrainedPolicy
from app.policies.networks.outcome import OutcomeHead, OutcomePrediction
from app.policies.networks.pick import LAYOUTS, actor_of, critics_for
from app.sim.cells.cell import Cell, require_cell
from app.sim.core.arrays import Vec
from app.sim.core.out_of_range import OutsideField
from app.sim.human import model as human
from app.sim.human.person import Person
from app.sim.perception.observed_people import (
    as_known,
    checked_people,
    checked_vector,
    is_far,
    nearest_index,
)
from app.sim.pick.batch import TaskView, observation_workspace_of, observe, step_robot
from app.sim.pick.kernels.grasp import LIFT, GraspRules
from app.sim.pick.task_policy import (
    NOT_BEGUN,
    Candidate,
    Decision,
    Objective,
    OutcomeEstimate,
    PickProgress,
)
from app.sim.robot import ur10 as robot
from app.sim.robot.actions import ActionSettings
from app.sim.robot.kernels.arm import CONTROLLED
from app.sim.robot.measured_state import StateLimits
from app.sim.scene.scene import FAR_AWAY, arm_of, people_of

HYSTERESIS = 0.5
"""Margin of the value by which another candidate must be better."""
LEAST_SUCCESS = 0.01
"""Least probability of success that an expected time is divided by."""
LONGEST_S = 60.0
"""Maximum observed remaining time [s]."""
MAX_CANDIDATES = 1000
"""Maximum number of candidates of one query."""

_FAR_PERSON = Person(q=human.rest_posture(*FAR_AWAY), qd=np.zeros(18))
"""Observed person of an empty cell."""


def pick_preset_of(checkpoint: Checkpoint) -> PickPreset:
    """Return the training configuration of a checkpoint of the pick scenario.

    Raises:
        InvalidInput: The checkpoint has another purpose or an invalid configuration.
    """
    require_purpose(checkpoint, CHOOSING)
    return read_config(PickPreset, checkpoint.manifest["preset"], "manifest.preset")


class ValueNetworks:
    """Actor and critics of a checkpoint, for inference.

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
        self.actor = actor_of(preset, self.n_obs)
        self.critic = critics_for(preset, self.n_obs)
        arrays = checkpoint.arrays()
        self.outcome: OutcomeHead | None = None
        parts: dict[str, torch.nn.Module] = {"actor": self.actor, "critic": self.critic}
        if "outcome.mean" in arrays:
            self.outcome = parts["outcome"] = OutcomeHead(self.n_obs)
        for name, module in parts.items():
            try:
                module.load_state_dict(under(arrays, name))
            except RuntimeError as error:
                raise CheckpointMismatch("tensors", f"those of {name}", str(error)) from error
            module.eval()

    def predict(
        self, obs: NDArray[np.float32], values: NDArray[np.float32]
    ) -> OutcomePrediction | None:
        """Return the predicted outcomes of observations; None without such a network.

        Args:
            obs: Observations, shape (n, n_obs).
            values: The critic's values, shape (n,).
        """
        if self.outcome is None:
            return None
        with torch.inference_mode():
            return self.outcome.predict(torch.as_tensor(obs), torch.as_tensor(values))

    def act_and_value(
        self, obs: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return actions, shape (n, 5), and values, shape (n,), of observations."""
        with torch.inference_mode():
            rows = torch.as_tensor(obs)
            act = self.actor(rows)
            return act.numpy(), self.critic.least(rows, act).numpy()


def estimates(predicted: OutcomePrediction) -> tuple[OutcomeEstimate, ...]:
    """Return predicted outcomes one by one, with the intervals of their probabilities."""
    low = (predicted.probability - predicted.spread).clamp(0.0, 1.0).tolist()
    high = (predicted.probability + predicted.spread).clamp(0.0, 1.0).tolist()
    return tuple(
        OutcomeEstimate(
            success=mean[0],
            success_interval=(least[0], most[0]),
            contact=mean[1],
            contact_interval=(least[1], most[1]),
            time_s=time_s,
        )
        for mean, least, most, time_s in zip(
            predicted.probability.tolist(), low, high, predicted.time_s.tolist(), strict=True
        )
    )


def select(
    values: NDArray[np.floating], previous: NDArray[np.int64] | int | None, hysteresis: float
) -> NDArray[np.int64]:
    """Return the index of the selected candidate, shape (...,).

    Args:
        values: Value of each candidate, shape (..., n); -inf where there is none.
        previous: Index selected last, shape (...,); None: none.
        hysteresis: Margin by which another candidate must be better; 0 is the source's rule.
    """
    best: NDArray[np.int64] = values.argmax(axis=-1)
    if previous is None:
        return best
    last = np.expand_dims(previous, -1)
    gain = values.max(axis=-1) - np.take_along_axis(values, last, axis=-1)[..., 0]
    return np.where(gain > hysteresis, best, previous)


class TaskChooser(TrainedPolicy):
    """A :class:`~app.sim.pick.task_policy.TaskPolicy` made of one checkpoint.

    Args:
        checkpoint: A ``policy`` checkpoint.
        cell: Work cell of the decisions; by default the training cell.
        hysteresis: Margin by which another candidate must be better.

    Raises:
        CheckpointMismatch: The checkpoint is for another cell or layout.
    """

    def __init__(
        self, checkpoint: Checkpoint, cell: Cell | None = None, hysteresis: float = HYSTERESIS
    ) -> None:
        super().__init__(checkpoint)
        if cell is not None:
            require_cell(cell, self.cell, self.cell_sha256)
        self.action: ActionSettings = pick_preset_of(checkpoint).action.settings
        """Meaning of the actions (docs/method.md 2.2)."""
        self.grasp: GraspRules = pick_preset_of(checkpoint).episode.grasp
        """Phases of a pick."""
        self._hysteresis = hysteresis
        self._networks = ValueNetworks(checkpoint)
        self._arm, self._people = arm_of(self._cell), people_of(self._cell)
        self._sight = observation_workspace_of(self._cell)
        self._limits, self._ranges = (
            StateLimits(self._arm, limits_jerk=False),
            _TrainedRanges(checkpoint),
        )

    def decide(
        self,
        q: Vec,
        qd: Vec,
        people: Sequence[Person],
        candidates: Sequence[Candidate],
        *,
        previous: str | None = None,
        progress: PickProgress = NOT_BEGUN,
        time_left_s: float = 10.0,
        objective: Objective = "value",
    ) -> Decision:
        """Select one candidate; see :class:`~app.sim.pick.task_policy.TaskPolicy`.

        People farther away than in training are not observed (``observed_people.py``). Of the
        others, policies for one person observe the one nearest to the robot; the shipped one
        observes also the one nearest to the candidate.
        """
        started = time.perf_counter()
        robot_state = self._limits.take(q, qd)
        q, qd, _ = robot_state.clamped
        observed = self._observed(robot_state.measured.q, people)
        ids, goals = _check_candidates(candidates)
        last = ids.index(previous) if previous in ids else None
        if not np.isfinite(time_left_s):
            raise InvalidInput("time_left_s", time_left_s, "must be finite [s]")
        time_left_s = min(LONGEST_S, max(0.0, time_left_s))
        task = TaskView(
            n_obs=self._networks.n_obs,
            grasp=self.grasp,
            current=last,
            phase=progress.phase,
            closing_s=progress.closing_s,
        )
        shared = self._arm, self._people, self._sight
        people_arrays = _arrays(observed, self._people.bodies[0])
        obs, reachable = observe(*shared, (q, qd), people_arrays, goals, time_left_s, task)
        act, values = self._networks.act_and_value(obs)
        predicted = self._networks.predict(obs, values)
        outcomes = None if predicted is None else estimates(predicted)
        index = self._choose(objective, values, outcomes, last)
        if last is not None and progress.phase == LIFT:
            index = last
        seen, person = observed[0]
        qd_target = self._speeds(q, qd, act)
        return Decision(
            chosen=ids[index],
            index=index,
            values=tuple(float(value) for value in values),
            actions=act,
            qd_target=qd_target,
            reachable=tuple(bool(flag) for flag in reachable),
            outside=robot_state.outside + self._ranges.of_state(q, qd, person, seen),
            outside_candidates=tuple(self._ranges.of_goal(goal) for goal in goals),
            outcomes=outcomes,
            checkpoint=self.checkpoint,
            elapsed_ms=1e3 * (time.perf_counter() - started),
            seen=seen,
        )

    def _choose(
        self,
        objective: Objective,
        values: NDArray[np.float32],
        outcomes: tuple[OutcomeEstimate, ...] | None,
        last: int | None,
    ) -> int:
        """Return the index of the best candidate under an objective."""
        if objective == "value":
            return int(select(values, last, self._hysteresis))
        if outcomes is None:
            rule = "needs a checkpoint with outcome probabilities"
            raise InvalidInput("objective", objective, rule, ("value",))
        if objective == "success":
            scores = [one.success for one in outcomes]
        else:
            scores = [-one.time_s / max(one.success, LEAST_SUCCESS) for one in outcomes]
        return int(np.argmax(scores))

    def _speeds(self, q: Vec, qd: Vec, act: NDArray[np.float32]) -> Vec:
        """Return the joint speeds of actions, shape (n, 5) [rad/s], shape (n, 6)."""
        if self.action.meaning == "coefficient":
            segments = (
                step_robot(self._arm, q, qd, np.zeros(6), row, self.action) for row in act
            )
            return np.stack([segment.qd for segment in segments])
        speeds = np.zeros((len(act), 6))
        speeds[:, :CONTROLLED] = act * self._arm.limits.qd_max[:CONTROLLED]
        return speeds

    def _observed(self, q: Vec, people: Sequence[Person]) -> list[tuple[int | None, Person]]:
        """Return index and state of the observed people, the nearest to the robot first.

        In an empty cell it is a person far away.
        """
        known = checked_people(people)
        near = [i for i, person in enumerate(known) if not is_far(person)]
        first = nearest_index(self._arm, self._people, q, [known[i] for i in near])
        if first is None:
            return [(None, _FAR_PERSON)]
        return [(i, as_known(known[i])) for i in (near.pop(first), *near)]


def _arrays(observed: list[tuple[int | None, Person]], body: Vec) -> tuple[Vec, Vec, Vec]:
    """Return joints, joint speeds and body dimensions of people, shape (P, ...) each."""
    people = [person for _, person in observed]
    sizes = [body if person.size is None else person.size for person in people]
    q, qd = (np.stack([getattr(one, name) for one in people]) for name in ("q", "qd"))
    return q, qd, np.stack(sizes)


class _TrainedRanges:
    """Training range of a checkpoint, to flag inputs outside it."""

    SLACK = 0.02
    """Tolerance of the training range [m, rad or per second]."""

    def __init__(self, checkpoint: Checkpoint) -> None:
        ranges = checkpoint.manifest["trained_range"]
        self._trained_without_people = pick_preset_of(checkpoint).people.human_absent > 0.0
        self._low = {name: np.array(entry["low"]) for name, entry in ranges.items()}
        self._high = {name: np.array(entry["high"]) for name, entry in ranges.items()}

    def of_state(
        self, q: Vec, qd: Vec, person: Person, index: int | None
    ) -> tuple[OutsideField, ...]:
        path = f"people[{index or 0}]"
        alone = (
            *self._outside("q", q, "robot.q", robot.JOINT_NAMES),
            *self._outside("qd", qd, "robot.qd", robot.JOINT_NAMES),
        )
        if index is None and self._trained_without_people:
            return alone
        return (
            *alone,
            *self._outside("human_q", person.q, f"{path}.q", human.JOINT_NAMES),
            *self._outside("human_qd", person.qd, f"{path}.qd", human.JOINT_NAMES),
        )

    def of_goal(self, goal: Vec) -> tuple[OutsideField, ...]:
        return self._outside("goal", goal, "position", ("x", "y", "z"))

    def _outside(
        self, key: str, values: Vec, path: str, names: Sequence[str]
    ) -> tuple[OutsideField, ...]:
        if key not in self._low or len(self._low[key]) != len(values):
            return ()
        low, high = self._low[key], self._high[key]
        beyond = (values < low - self.SLACK) | (values > high + self.SLACK)
        return tuple(
            OutsideField(
                field=f"{path}.{names[i]}",
                value=float(values[i]),
                low=float(low[i]),
                high=float(high[i]),
            )
            for i in np.flatnonzero(beyond).tolist()
        )


def _check_candidates(candidates: Sequence[Candidate]) -> tuple[list[str], Vec]:
    n = len(candidates)
    if not 1 <= n <= MAX_CANDIDATES:
        raise InvalidInput("candidates", n, f"must be 1 to {MAX_CANDIDATES} of them")
    limit = np.full(3, 10.0)
    goals = np.array(
        [
            checked_vector(
                f"candidates[{i}].position", candidate.position, 3, -limit, limit, "m"
            )
            for i, candidate in enumerate(candidates)
        ]
    )
    ids = [candidate.id for candidate in candidates]
    seen: set[str] = set()
    for i, name in enumerate(ids):
        if name in seen:
            raise InvalidInput(f"candidates[{i}].id", name, "must be given once")
        seen.add(name)
    return ids, goals
