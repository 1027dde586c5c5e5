"""Solve a small sorting task by value iteration, tabular Q-learning and the DQN.

    python -m tools.docs.sorting.tiny [--seed 3]

Writes ``docs/results/sorting-tiny.json`` and the tables of ``docs/sorting-tiny.md``. The task
has two clutter slots, two colours and two sizes; its reachable states are enumerated.
"""

import argparse
import re
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from app.policies.algorithms.dqn import SortingDQN
from app.policies.algorithms.vecenv import BatchVecEnv
from app.policies.configs.sorting import SortingPreset
from app.sim.cells.cell import load_cell
from app.sim.core.arrays import Vec
from app.sim.envs.sorting import SortingTask
from app.sim.sorting.batch import (
    OUTCOMES,
    SortingBatch,
    SortingSettings,
    apply,
    observe,
    valid_moves,
)
from app.sim.sorting.kernels.reward import SortingWeights, distance_cost
from app.sim.sorting.planner import solve
from app.sim.sorting.state import SortingShape, SortingState
from tools.docs.results import RESULTS, ROOT, Json, write_result

RESULT, PAGE = RESULTS / "sorting-tiny.json", ROOT / "docs/sorting-tiny.md"
SHAPE = SortingShape(n_slots=2, n_colours=2, n_sizes=2)
FAIL = np.array([0.4, 0.1])
"""Failure probabilities of the two slots."""
GAMMA = 0.95
"""Discount per attempt."""
SETTINGS = SortingSettings(disturbed_share=0.5)
"""Half of the starts are disturbed: arbitrary objects on towers, partly built goals."""
STARTS = 20_000
"""Starts from which the states are enumerated; none was new after 2,000."""
TABLE_ENVS, TABLE_STEPS = 64, 40_000
"""Environments of tabular Q-learning, and their total steps."""
SAME = 1e-9
"""Tolerance for equal values."""
NEAR = 0.005
"""Loss below which a move counts as good: a tenth of the cost of an attempt."""
WEIGHTS = SortingWeights()
NAMES = ("", "red small", "red large", "blue small", "blue large")
"""Objects by code."""


class Model(NamedTuple):
    """The task as tables over ``n`` states."""

    states: list[SortingState]
    """All states."""
    number: dict[bytes, int]
    """Number of a state by its observation."""
    valid: NDArray[np.bool_]
    """Whether a move changes the state, shape (n, n_actions)."""
    after: NDArray[np.int64]
    """State after a successful move, shape (n, n_actions)."""
    chance: Vec
    """Probability of success, shape (n, n_actions)."""
    gain: Vec
    """Reward of a success, shape (n, n_actions)."""
    lost: Vec
    """Reward of a failure, shape (n, n_actions)."""
    solved: NDArray[np.bool_]
    """Whether the goal is reached, shape (n,)."""


def all_states(seed: int) -> list[SortingState]:
    """Return all reachable states in a fixed order."""
    batch = SortingBatch(SHAPE, FAIL, STARTS, seed, SETTINGS)
    batch.reset()
    found = {observe(state).tobytes(): state for state in map(batch.state_of, range(STARTS))}
    line = list(found.values())
    while line:
        state = line.pop()
        for action in np.flatnonzero(valid_moves(state, SHAPE)):
            after = apply(state, SHAPE, SHAPE.move_of(int(action)))
            key = observe(after).tobytes()
            if key not in found:
                found[key] = after
                line.append(after)
    return [found[key] for key in sorted(found)]


def model_of(states: list[SortingState]) -> Model:
    """Return the task as tables (docs/method.md 1.3)."""
    number = {observe(state).tobytes(): i for i, state in enumerate(states)}
    shape = (len(states), SHAPE.n_actions)
    model = Model(
        states=states,
        number=number,
        valid=np.array([valid_moves(state, SHAPE) for state in states]),
        after=np.zeros(shape, dtype=np.int64),
        chance=np.ones(shape),
        gain=np.zeros(shape),
        lost=np.zeros(shape),
        solved=np.array([state.solved for state in states]),
    )
    for i, state in enumerate(states):
        stays = distance_cost(state.towers, state.goal, SHAPE.n_sizes, WEIGHTS)
        for action in np.flatnonzero(model.valid[i]):
            move = SHAPE.move_of(int(action))
            after = apply(state, SHAPE, move)
            away = distance_cost(after.towers, after.goal, SHAPE.n_sizes, WEIGHTS)
            back = WEIGHTS.back if move.place < SHAPE.n_slots else 0.0
            bonus = WEIGHTS.success if after.solved else 0.0
            model.after[i, action] = number[observe(after).tobytes()]
            model.gain[i, action] = bonus - WEIGHTS.move - back - away
            model.lost[i, action] = -WEIGHTS.move - WEIGHTS.fail - stays
            if move.pick < SHAPE.n_slots:
                model.chance[i, action] = 1.0 - state.fail[move.pick]
    return model


def value_iteration(model: Model) -> tuple[Vec, int]:
    """Return the values of all moves (-inf without effect) and the number of sweeps."""
    value, sweeps = np.zeros(len(model.states)), 0
    while True:
        success = model.gain + GAMMA * value[model.after]
        failure = model.lost + GAMMA * value[:, None]
        q = model.chance * success + (1.0 - model.chance) * failure
        q = np.where(model.valid, q, -np.inf)
        better = np.where(model.solved, 0.0, q.max(axis=1))
        sweeps += 1
        if np.abs(better - value).max() < 1e-12:
            return q, sweeps
        value = better


def q_learning(model: Model, seed: int) -> Vec:
    """Return the values of tabular Q-learning, which only observes transitions.

    The learning rate of a move is ``n^-0.7`` at its n-th visit; moves are drawn evenly among
    those that change something.

    Source: Watkins, Dayan, *Q-learning* (1992).
    """
    rng = np.random.default_rng(seed)
    batch = SortingBatch(SHAPE, FAIL, TABLE_ENVS, seed, SETTINGS)
    q = np.where(model.valid, 0.0, -np.inf)
    value, visits = np.zeros(len(q)), np.zeros(q.shape)
    here = [model.number[row.tobytes()] for row in batch.reset()]
    for _ in range(TABLE_STEPS):
        act = (rng.random(batch.masks().shape) * batch.masks()).argmax(axis=1)
        step = batch.step(act)
        following = [model.number[row.tobytes()] for row in step.obs]
        for e, (i, a) in enumerate(zip(here, act.tolist(), strict=True)):
            ended = int(step.ended[e])
            last = model.number[step.last_obs[e].tobytes()] if ended else following[e]
            to_come = 0.0 if OUTCOMES[ended] == "success" else value[last]
            visits[i, a] += 1.0
            q[i, a] += visits[i, a] ** -0.7 * (step.rew[e] + GAMMA * to_come - q[i, a])
            value[i] = q[i].max()
        here = following
    return q


def preset() -> SortingPreset:
    """Return ``sorting-e0-dqn`` at this size: no expert labels, no interference.

    Deviates: five updates per step of all environments, half of the moves random to the end,
    one-step returns. Returns over several attempts are those of the moves that were tried, not
    of the best ones, so that their values are too low with much exploration.
    """
    base = SortingPreset()
    learning = {
        "total_steps": 192_000,
        "n_envs": 64,
        "gradient_steps": 5,
        "buffer_size": 50_000,
        "learning_starts": 2_000,
        "lr_end": 1e-5,
        "gamma": GAMMA,
        "n_steps": 1,
    }
    episode = {
        "solved_episodes": 0.0,
        "disturbed_share": SETTINGS.disturbed_share,
        "even_share": SETTINGS.even_share,
        "random_map_share": 0.0,
    }
    groups = {
        "name": "sorting-tiny-dqn",
        "learning": base.learning.model_copy(update=learning),
        "networks": base.networks.model_copy(update={"width": 64}),
        "exploration": base.exploration.model_copy(update={"eps_end": 0.5}),
        "episode": base.episode.model_copy(update=episode),
        "people": base.people.model_copy(update={"human_rate": 0.0}),
    }
    return base.model_copy(update=groups)


def dqn(model: Model, seed: int) -> Vec:
    """Return the values of the DQN."""
    chosen = preset()
    batch = SortingBatch(SHAPE, FAIL, chosen.learning.n_envs, seed, SETTINGS)
    env = BatchVecEnv(SortingTask(load_cell("sorting-e0"), batch))
    learner = SortingDQN(chosen, env, batch, seed)
    learner.learn(chosen.learning.total_steps)
    obs = torch.as_tensor(np.array([observe(state) for state in model.states]))
    with torch.inference_mode():
        q = learner.q_net(obs).numpy().astype(np.float64)
    return np.where(model.valid, q, -np.inf)


def timed(found: Callable[[], Vec]) -> tuple[Vec, float]:
    """Return values and CPU time [s]."""
    began = time.process_time()
    q = found()
    return q, time.process_time() - began


def agreement(model: Model, best: Vec, q: Vec) -> Json:
    """Return errors of values and losses of greedy moves over unsolved states.

    Args:
        model: The task.
        best: Values by value iteration, shape (n, n_actions).
        q: Values to compare, shape (n, n_actions).
    """
    rows = np.flatnonzero(~model.solved)
    valid = model.valid[rows]
    gap = best[rows].max(axis=1) - best[rows, q[rows].argmax(axis=1)]
    error = np.abs(np.where(valid, q[rows], 0.0) - np.where(valid, best[rows], 0.0))[valid]
    return {
        "optimal_moves": int((gap < SAME).sum()),
        "good_moves": int((gap < NEAR).sum()),
        "states": len(rows),
        "worst_loss": float(gap.max()),
        "mean_value_error": float(error.mean()),
        "worst_value_error": float(error.max()),
    }


def against_planner(model: Model, best: Vec) -> Json:
    """Return the number of states in which planner and value iteration agree."""
    rows = np.flatnonzero(~model.solved)
    planned, fewest = 0, 0
    for i in rows:
        plan = solve(model.states[i], SHAPE)
        top = np.flatnonzero(best[i] >= best[i].max() - SAME)
        planned += plan.best in top
        fewest += all(int(action) in plan.first for action in top)
    return {"states": len(rows), "plan_is_optimal": planned, "optimum_is_fewest_moves": fewest}


def example(number: dict[bytes, int]) -> int:
    """Return the example state: a blue object on the red tower, a red one in slot 1."""
    towers, goal = np.zeros((2, 2), dtype=np.int8), np.zeros((2, 2), dtype=np.int8)
    red, blue = SHAPE.code(0, 1), SHAPE.code(1, 0)
    towers[0, 0], goal[0, 0], goal[1, 0] = blue, red, blue
    clutter = np.array([red, 0], dtype=np.int8)
    state = SortingState(clutter=clutter, towers=towers, goal=goal, fail=FAIL)
    return number[observe(state).tobytes()]


def move_text(action: int) -> str:
    """Return a move as text."""
    places = ("slot 1", "slot 2", "red tower", "blue tower")
    move = SHAPE.move_of(action)
    return f"{places[move.pick]} to {places[move.place]}"


def measure(seed: int) -> Json:
    """Solve the task by three methods and compare."""
    model = model_of(all_states(seed))
    (best, sweeps), found = value_iteration(model), {}
    found["value iteration"] = timed(lambda: value_iteration(model)[0])
    found["tabular Q-learning"] = timed(lambda: q_learning(model, seed))
    found["DQN"] = timed(lambda: dqn(model, seed))
    shown = example(model.number)
    return {
        "seed": seed,
        "states": len(model.states),
        "pairs": int(model.valid[~model.solved].sum()),
        "sweeps": sweeps,
        "methods": {
            name: {"cpu_seconds": seconds, **agreement(model, best, q)}
            for name, (q, seconds) in found.items()
        },
        "planner": against_planner(model, best),
        "example": {
            move_text(int(action)): {
                name: float(q[shown, action]) for name, (q, _) in found.items()
            }
            for action in np.flatnonzero(model.valid[shown])
        },
        "example_plan": [
            move_text(action) for action in solve(model.states[shown], SHAPE).first
        ],
        "attempts": {"tabular": TABLE_ENVS * TABLE_STEPS, "DQN": preset().learning.total_steps},
    }


def tables(found: Json) -> dict[str, str]:
    """Return the tables of the page by name."""
    names = list(found["methods"])
    lines = ["| move | " + " | ".join(names) + " |", "| --- |" + " ---: |" * len(names)]
    for move, values in found["example"].items():
        lines.append(f"| {move} | " + " | ".join(f"{values[n]:.3f}" for n in names) + " |")
    head = "| method | states with best move | with loss < 0.005 | largest loss "
    head += "| value error, mean | value error, largest | CPU time [s] |"
    rows = [head, "| --- | ---: | ---: | ---: | ---: | ---: | ---: |"]
    for name, one in found["methods"].items():
        rows.append(
            f"| {name} | {one['optimal_moves']} of {one['states']} "
            f"| {one['good_moves']} of {one['states']} "
            f"| {one['worst_loss']:.4f} | {one['mean_value_error']:.4f} "
            f"| {one['worst_value_error']:.4f} | {one['cpu_seconds']:.2f} |"
        )
    return {"example": "\n".join(lines), "agreement": "\n".join(rows)}


def render(page: str, found: Json) -> str:
    """Return the page with its tables replaced."""
    for name, text in tables(found).items():
        begin, end = f"<!-- begin sorting-tiny {name} -->", f"<!-- end sorting-tiny {name} -->"
        page = re.sub(f"{begin}.*?{end}", f"{begin}\n{text}\n{end}", page, flags=re.DOTALL)
    return page


def main() -> None:
    """Measure, and write results and tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=3)
    options = parser.parse_args()
    torch.set_num_threads(1)
    found = measure(options.seed)
    write_result(RESULT, found)
    PAGE.write_text(render(PAGE.read_text(encoding="utf-8"), found), encoding="utf-8")


if __name__ == "__main__":
    main()
