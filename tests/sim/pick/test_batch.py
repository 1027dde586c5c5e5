"""The batched scenario: determinism, limits, starts, ends, and agreement with the referee."""

from typing import Any

import numpy as np
import pytest

from app.errors import InvalidInput, SimulationError
from app.sim.cells.cell import Cell, load_cell
from app.sim.collision.contact import contact
from app.sim.collision.fcl_recheck import Recheck, Trajectory
from app.sim.collision.kernels import contact as contact_kernel
from app.sim.human import model as human
from app.sim.pick import batch as pick
from app.sim.pick.batch import OUTCOMES, PickBatch, PickSettings
from app.sim.pick.candidate_observer import CandidateObserver
from app.sim.pick.hand_speeds import hand_speeds
from app.sim.pick.kernels.candidates import observe_candidates
from app.sim.pick.kernels.grasp import GraspRules
from app.sim.pick.kernels.observation_layout import LAYOUT
from app.sim.robot.kernels import actions
from app.sim.robot.kernels.joints import JointPath
from app.sim.scene.scene import arm_of, people_of
from tests.sim.driven_batches import check_limits, check_rows, random_actions

TEN_SECONDS = PickSettings(time_limit_s=10.0)


@pytest.fixture(scope="module")
def cell() -> Cell:
    return load_cell()


def test_rows_do_not_depend_on_how_many_there_are(cell: Cell) -> None:
    few, many = PickBatch(cell, 3, 5, TEN_SECONDS), PickBatch(cell, 9, 5, TEN_SECONDS)
    check_rows(few, many, slice(3), 500)


def test_same_seed_gives_the_same_bits_and_another_seed_does_not(cell: Cell) -> None:
    first, second = PickBatch(cell, 4, 5, TEN_SECONDS), PickBatch(cell, 4, 6, TEN_SECONDS)
    start = first.reset().copy()
    assert not np.array_equal(start, second.reset())
    np.testing.assert_array_equal(start, second.reset(seed=5))


def test_limits_hold_through_whole_episodes(cell: Cell) -> None:
    check_limits(PickBatch(cell, 64, 5, TEN_SECONDS), 400)


def test_starts_keep_the_required_clearance_from_the_person(cell: Cell) -> None:
    batch = PickBatch(cell, 400, 7, PickSettings(start_clearance_m=0.05))
    obs = batch.reset()
    assert (batch.state.clear[:, 0] >= 0.05).all()
    assert np.isfinite(obs).all()
    assert (batch.state.outcome == OUTCOMES.index("running")).all()


def test_robot_starts_from_home_cubes_and_docks_in_equal_shares(cell: Cell) -> None:
    batch = PickBatch(cell, 1500, 8, PickSettings(start_clearance_m=-10.0))
    batch.reset()
    at_home = (batch.state.q == np.array(cell.robot.home_q)).all(axis=1)
    docks = batch.world.station_q[batch.world.n_cubes :]
    at_dock = (batch.state.q[:, None] == docks).all(axis=2).any(axis=1)
    assert at_home.mean() == pytest.approx(1 / 3, abs=0.05)
    assert at_dock.mean() == pytest.approx(1 / 3, abs=0.05)


def test_other_starts_keep_the_limits_of_the_joints(cell: Cell) -> None:
    narrow = {
        "q_min": (*cell.robot.q_min[:4], -1.7, cell.robot.q_min[5]),
        "q_max": (*cell.robot.q_max[:4], -1.5, cell.robot.q_max[5]),
    }
    robot = cell.robot.model_copy(update=narrow)
    settings = PickSettings(people=(), anywhere_share=1.0)
    batch = PickBatch(cell.model_copy(update={"robot": robot}), 64, 5, settings)
    batch.reset()
    limits = batch.arm.limits
    assert (batch.state.q >= limits.q_min).all() and (batch.state.q <= limits.q_max).all()
    assert len(np.unique(batch.state.q[:, 4])) > 10


def test_targets_are_drawn_uniformly(cell: Cell) -> None:
    batch = PickBatch(cell, 4000, 9, PickSettings(start_clearance_m=-10.0))
    batch.reset()
    counts = np.bincount(batch.state.candidates[:, 0], minlength=len(cell.stations))
    np.testing.assert_allclose(counts / 4000, 1 / len(cell.stations), atol=0.03)


@pytest.mark.parametrize("fewest", [2, 4])
def test_candidates_are_different_stations_in_the_asked_for_number(
    cell: Cell, fewest: int
) -> None:
    most = fewest + 2
    batch = PickBatch(cell, 500, 10, PickSettings(n_candidates=(fewest, most)))
    batch.reset()
    at = (batch.state.q[:, None] == batch.world.station_q).all(axis=2)
    for row, occupied in zip(batch.state.candidates, at, strict=True):
        offered = row[row >= 0]
        assert len(set(offered)) == len(offered) and not occupied[offered].any()
    sizes = (batch.state.candidates >= 0).sum(axis=1)
    assert set(sizes) == set(range(fewest, most + 1))


def test_more_candidates_than_stations_are_refused(cell: Cell) -> None:
    two = cell.model_copy(update={"stations": (cell.station("cube0"), cell.station("dock1"))})
    with pytest.raises(InvalidInput, match=r"n_candidates = \[2, 3\] must be at most 2"):
        PickBatch(two, 1, 0, PickSettings(n_candidates=(2, 3)))
    batch = PickBatch(two, 20, 0, PickSettings(n_candidates=(2, 2)))
    batch.reset()
    assert set(batch.state.candidates[:, :2].sum(axis=1)) == {1}


@pytest.mark.parametrize(
    ("field", "value", "rule"),
    [
        ("n_candidates", (8, 8), r"in \[1, 6\]"),
        ("n_candidates", (0, 0), r"in \[1, 6\]"),
        ("n_candidates", (3, 2), r"in \[1, 6\]"),
        ("time_limit_s", float("nan"), "positive"),
        ("time_limit_s", -1.0, "positive"),
        ("short_limit_s", float("inf"), "positive"),
        ("short_share", 1.5, r"in \[0, 1\]"),
        ("at_target_share", float("nan"), r"in \[0, 1\]"),
        ("start_clearance_m", float("nan"), "finite"),
        ("target_jitter_m", float("nan"), "finite"),
        ("target_jitter_m", -0.1, "negative"),
        ("start", "nope", "choices: clearance, uniform"),
        ("observation", "nope", "choices: state, features"),
        ("grasp", GraspRules(depth=-0.1), "negative"),
        ("grasp", GraspRules(depth=float("nan")), "finite"),
        ("grasp", GraspRules(close_s=0.0), "positive"),
        ("grasp", GraspRules(depth=0.0, close_s=float("nan")), "positive"),
    ],
)
def test_settings_out_of_range_are_refused(field: str, value: Any, rule: str) -> None:
    with pytest.raises(InvalidInput, match=rf"^{field}[.\w]* = .*{rule}"):
        PickSettings(**{field: value})


@pytest.mark.parametrize(
    "envs", [[3], [-1], [2**32], np.array([True, False, True]), [0.0], [[0]]]
)
def test_only_numbers_of_environments_are_started_and_get_targets(
    cell: Cell, envs: Any
) -> None:
    batch = PickBatch(cell, 3, 5, TEN_SECONDS)
    batch.reset()
    before = batch.state_dict()
    shares = np.full(len(envs), 0.5)
    for call in (
        lambda: batch.start(np.array(envs)),
        lambda: batch.set_goals(np.array(envs), np.zeros((len(envs), 3))),
        lambda: batch.shorten(np.array(envs), shares),
    ):
        with pytest.raises(InvalidInput, match="^envs = .* must be"):
            call()
    np.testing.assert_equal(batch.state_dict(), before)


def test_environments_start_in_any_order_and_as_any_integers(cell: Cell) -> None:
    strided = np.array([2, 9, 0, 9, 1, 9])[::2]
    expected = PickBatch(cell, 3, 5, TEN_SECONDS).reset()
    for envs in (strided, strided.astype(np.int32), strided.astype(np.uint8)):
        batch = PickBatch(cell, 3, 5, TEN_SECONDS)
        np.testing.assert_array_equal(batch.start(envs), expected)


def test_targets_and_starts_that_are_not_finite_or_of_another_shape_are_refused(
    cell: Cell,
) -> None:
    batch, rows = PickBatch(cell, 3, 5, TEN_SECONDS), np.arange(2)
    batch.reset()
    goal = batch.state.goal.copy()
    for wrong in (np.full((2, 3), np.nan), np.full((2, 3), -np.inf)):
        with pytest.raises(SimulationError, match="goals .* finite"):
            batch.set_goals(rows, wrong)
    for shape in ((3, 3), (2, 2), (3,)):
        with pytest.raises(InvalidInput, match="goals .* shape"):
            batch.set_goals(rows, np.zeros(shape))
    with pytest.raises(SimulationError, match="q = .* finite"):
        batch.set_starts(np.full((3, 6), np.nan))
    with pytest.raises(InvalidInput, match="q = .* shape"):
        batch.set_starts(np.zeros(6))
    np.testing.assert_array_equal(batch.state.goal, goal)


def test_meshes_find_no_contact_that_the_kernels_missed(cell: Cell) -> None:
    batch = PickBatch(cell, 24, 12, TEN_SECONDS)
    obs, state = batch.reset(), batch.state
    paths: list[list[tuple[np.ndarray, ...]]] = [[] for _ in range(24)]
    for _ in range(200):
        before = state.q.copy(), state.qd.copy(), state.people.q[:, 0].copy()
        running = np.flatnonzero(state.outcome == 0)
        obs = batch.step(obs[:, LAYOUT["base"]].copy(), auto_reset=False).obs
        for e in running:
            paths[e].append(
                (*(b[e] for b in before), state.qd[e].copy(), state.people.q[e, 0].copy())
            )
    recheck, x = Recheck(cell), np.arange(5)[:, None] / 5
    for e, path in enumerate(paths):
        q, person = [], []
        for q0, qd0, human0, qd1, human1 in path:
            q.append(q0 + cell.robot.dt * (qd0 * x + 0.5 * (qd1 - qd0) * x**2))
            person.append(human0 + (human1 - human0) * x)
        q_robot = np.concatenate([*q, state.q[e : e + 1]])
        q_human = np.concatenate([*person, state.people.q[e]])
        sizes = np.repeat(state.people.size[e], len(q_human), axis=0)
        path = Trajectory(q_robot=q_robot, q_human=q_human, sizes=sizes)
        hit = recheck.first_contact(path)
        assert hit is None or OUTCOMES[state.outcome[e]] == "collision"
    assert {OUTCOMES[outcome] for outcome in state.outcome} >= {"success", "collision"}


def test_single_state_functions_do_what_the_batch_does(cell: Cell) -> None:
    batch = PickBatch(cell, 6, 13, TEN_SECONDS)
    batch.reset()
    state, people, observer = batch.state, batch.world.people, CandidateObserver(cell)
    for act in random_actions(40, batch):
        q, qd, person = state.q.copy(), state.qd.copy(), state.people.q.copy()
        result = batch.step(act, auto_reset=False)
        for e in np.flatnonzero(state.outcome == 0):
            segment = pick.step_robot(batch.arm, q[e], qd[e], np.zeros(6), act[e])
            np.testing.assert_array_equal(segment.q, state.q[e])
            np.testing.assert_array_equal(segment.qd, state.qd[e])
            hit = contact(
                batch.arm,
                people,
                JointPath(q[e], qd[e], segment.c, segment.d),
                (person[e], state.people.q[e]),
                sizes=state.people.size[e],
            )
            assert hit.kind == "none" and hit.clearance_m == state.clear[e, 0]
            seen, _ = observer.observe(
                (segment.q, segment.qd),
                (state.people.q[e], state.people.qd[e], state.people.size[e]),
                state.goal[e : e + 1],
                state.time_left[e],
            )
            np.testing.assert_array_equal(seen[0], result.obs[e])


def test_person_at_the_tool_is_a_contact_with_both_names(cell: Cell) -> None:
    arm, people, zero = arm_of(cell), people_of(cell), np.zeros(6)
    rest = human.rest_posture(*cell.human.home)
    q = PickBatch(cell, 1, 0, TEN_SECONDS).world.station_q[3]
    grip = np.array(cell.stations[3].position) + [0.0, 0.04, 0.06]
    person = human.reach("r", grip, rest, cell.body).q[None]
    found = contact(arm, people, JointPath(q, zero, zero, zero), (person, person))
    assert found.kind == "human"
    assert found.part in ("hand_r", "forearm_r")


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_errors_not_silence(cell: Cell, value: float) -> None:
    arm, people, zero = arm_of(cell), people_of(cell), np.zeros(6)
    person = human.rest_posture(*cell.human.home)[None]
    person[0, 3] = value
    with pytest.raises(SimulationError, match="finite"):
        contact(arm, people, JointPath(arm.home, zero, zero, zero), (person, person))
    with pytest.raises(SimulationError, match="finite"):
        pick.step_robot(arm, arm.home, zero, zero, np.full(5, value))
    with pytest.raises(SimulationError, match="finite"):
        PickBatch(cell, 1, 0, TEN_SECONDS).step(np.full((1, 5), value, dtype=np.float32))


def test_cell_whose_station_is_out_of_reach_is_refused_by_name(cell: Cell) -> None:
    far = cell.stations[0].model_copy(update={"position": (0.0, 2.0, 0.1)})
    broken = cell.model_copy(update={"stations": (far, *cell.stations[1:])})
    with pytest.raises(InvalidInput, match="stations.cube0.position"):
        PickBatch(broken, 1, 0, TEN_SECONDS)


def test_cell_whose_home_turns_the_sixth_joint_is_refused(cell: Cell) -> None:
    robot = cell.robot.model_copy(update={"home_q": (*cell.robot.home_q[:5], 1.0)})
    turned = cell.model_copy(update={"robot": robot})
    with pytest.raises(InvalidInput, match=r"cannot be used for picking: it needs home_q\[5\]"):
        PickBatch(turned, 1, 0, TEN_SECONDS)


def test_hands_are_fast_enough_to_be_a_problem(cell: Cell) -> None:
    speeds = hand_speeds(PickBatch(cell, 1, 11, TEN_SECONDS), n_scripts=60)
    assert speeds["hand_speed_median_m_s"] >= 0.4
    assert speeds["hand_speed_p99_m_s"] >= 1.5


def test_read_only_integer_and_strided_inputs_compile_nothing_again(cell: Cell) -> None:
    arm, people = arm_of(cell), people_of(cell)
    person = human.rest_posture(*cell.human.home)
    q, zero = arm.home.copy(), np.zeros(6)
    goals = np.array([station.position for station in cell.stations])
    observer = CandidateObserver(cell)

    def use() -> None:
        pick.step_robot(arm, q, zero, zero, zero[:5])
        contact(arm, people, JointPath(q, zero, zero, zero), (person[None], person[None]))
        seen = person[None], np.zeros((1, 18)), people.bodies
        observer.observe((q, zero), seen, goals[::2], 10)
        pick.tool_state(arm, q, zero, goals[0])
        human.capsules(person, cell.body, cell.floor_z)

    use()
    kernels = (observe_candidates, contact_kernel.sweep, actions.advance)
    before = [len(compiled.signatures) for compiled in kernels]
    zero, goals = np.zeros(6, dtype=np.int64), goals[:, :]
    for array in (q, person, goals):
        array.setflags(write=False)
    use()
    assert [len(compiled.signatures) for compiled in kernels] == before
