"""Tables of the environments' docstrings state what the environments have."""

import inspect
import re
from math import prod

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.envs.pick import PickEnv
from app.sim.envs.reach import ReachEnv
from app.sim.envs.sorting import SortingEnv
from app.sim.pick.batch import WHOLE_PICK, PickBatch
from app.sim.pick.kernels.observation_layout import LAYOUT as PICK_LAYOUT
from app.sim.pick.kernels.observation_layout import N_PICK
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.kernels.observation import LAYOUT as REACH_LAYOUT
from app.sim.reach.kernels.observation import N_FEATURES
from app.sim.reach.kernels.option_features import N_OPTION_FEATURES
from app.sim.robot.ur10 import Robot
from app.sim.sorting.batch import SortingSettings, batch_in
from app.sim.sorting.kernels.reward import SortingWeights
from app.sim.sorting.kernels.task import SUCCESS

HEAD = "| group | size | content |\n"
CLEARANCES = "clearance", "look_ahead", "look_ahead_base"


def sizes(sheet: object) -> list[int]:
    """Total sizes of the tables of groups in a docstring."""
    tables = [part.split("\n\n")[0] for part in (inspect.getdoc(sheet) or "").split(HEAD)[1:]]
    return [
        sum(
            sum(prod(map(int, term.split(" x "))) for term in size.split(" + "))
            for size in re.findall(r"^\| [^|]+ \| (\d[\d x+]*) \|", table, re.MULTILINE)
        )
        for table in tables
    ]


def test_groups_of_a_pick_add_up() -> None:
    assert sizes(PickEnv) == [N_PICK]


def test_groups_of_reach_add_up() -> None:
    assert sizes(ReachEnv) == [N_FEATURES, N_OPTION_FEATURES]


def test_rewards_of_sorting_are_the_default_weights() -> None:
    text = (inspect.getdoc(SortingEnv) or "").split("## Reward\n")[1].split("##")[0]
    weights = SortingWeights()
    names = "move", "empty", "stuck", "fail", "back", "distance", "success"
    stated = [abs(float(found)) for found in re.findall(r"``([+-][\d.]+)(?: d / K)?``", text)]
    assert stated == [getattr(weights, name) for name in names]


@pytest.mark.parametrize("sheet", [PickEnv, ReachEnv])
def test_velocities_of_the_tool_are_scaled_as_stated(sheet: type[PickEnv | ReachEnv]) -> None:
    layout = PICK_LAYOUT if sheet is PickEnv else REACH_LAYOUT
    batch = (
        PickBatch(load_cell("pick-and-place"), 4, 5, WHOLE_PICK)
        if sheet is PickEnv
        else ReachBatch(load_cell("shared-workspace"), 4, 5, ReachSettings())
    )
    batch.reset()
    obs = batch.step(np.full((4, batch.n_act), 0.3, dtype=np.float32)).obs
    robot = Robot(batch.cell.robot.tool_length)
    state = batch.state
    velocity = np.array(
        [robot.jacobian(q)[:3] @ qd for q, qd in zip(state.q, state.qd, strict=True)]
    )
    text = inspect.getdoc(sheet) or ""
    (row,) = re.findall(r"^\| tcp_velocity \| 3 \| (.*) \|$", text, re.MULTILINE)
    factor = 2.0 if row.startswith("twice ") else 1.0
    np.testing.assert_allclose(obs[:, layout["tcp_velocity"]], factor * velocity, atol=1e-5)


def test_clearances_of_reach_consider_the_people_stated() -> None:
    people = ReachSettings(people=("walker", "walker", "walker"))
    batch = ReachBatch(load_cell("shared-workspace"), 60, 3, people)
    batch.reset()
    rows, goals = np.arange(60), batch.state.goal[:, None]
    of_all, *of_each = (
        batch.observe_goals(rows, goals, person)[:, 0] for person in (None, 0, 1, 2)
    )
    least = np.min(of_each, axis=0)
    alone = {
        name
        for name in CLEARANCES
        if not np.allclose(of_all[:, REACH_LAYOUT[name]], least[:, REACH_LAYOUT[name]])
    }
    text = " ".join((inspect.getdoc(ReachEnv) or "").split())
    (stated,) = re.findall(r"Clearances [^.:]*consider all people([^.:]*)[.:]", text)
    assert alone == set(re.findall(r"\w+_\w+", stated))


def test_the_bonus_of_sorting_is_for_attempts_alone_as_stated() -> None:
    settings = SortingSettings(human_rate=0.3, disturbed_share=0.6)
    batch = batch_in(load_cell("sorting-e0"), 2000, 7, settings)
    batch.reset()
    rng, rewards = np.random.default_rng(0), []
    for _ in range(60):
        moves = batch.masks()
        result = batch.step((rng.random(moves.shape) * moves).argmax(axis=1))
        rewards.append(result.rew[result.ended == SUCCESS].copy())
    bonus = np.concatenate(rewards) > 0.5
    assert bonus.any() and not bonus.all()
    text = " ".join((inspect.getdoc(SortingEnv) or "").split())
    assert "``+1`` for an attempt that meets the goal" in text
