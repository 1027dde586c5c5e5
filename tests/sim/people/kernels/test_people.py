"""Several people of any kind in one cell: shapes, clearances, contacts, who is seen."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.cells.cell import load_cell, parse_definition
from app.sim.cells.people import ConstantWalker
from app.sim.collision.contact import clearance, contact
from app.sim.human import model as human
from app.sim.pick.batch import OUTCOMES, PickBatch, PickSettings
from app.sim.pick.kernels import episode as kernel
from app.sim.robot.kernels.joints import JointPath
from app.sim.scene import scene
from app.sim.scene.scene import HumanKind, arm_of, people_of, with_people

CELL = load_cell()
MIXES: tuple[tuple[HumanKind, ...], ...] = (
    (),
    ("worker",),
    ("worker", "worker"),
    ("walker",),
    ("worker", "walker", "constant", "fixed-speed"),
    ("worker",) * 4,
    ("fixed-speed", "worker"),
)


def acts(n: int, seed: int = 3) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.repeat(rng.uniform(-1, 1, (n // 20 + 1, 8, 5)), 20, axis=0)[:n].astype(np.float32)


def person_clearances(batch: PickBatch, e: int) -> list[float]:
    """Clearance of each person alone, workers first."""
    people, q = batch.state.people, batch.state.q[e]
    alone = [
        clearance(
            batch.arm, batch.world.people, q, row[None], np.zeros((0, 3)), size[None]
        ).people_m
        for row, size in zip(people.q[e], people.size[e], strict=True)
    ]
    return alone + [
        clearance(batch.arm, batch.world.people, q, np.zeros((0, 18)), row[None]).people_m
        for row in people.cylinders[e]
    ]


@pytest.mark.parametrize("kinds", MIXES)
def test_clearance_is_that_of_the_nearest_person(kinds: tuple[HumanKind, ...]) -> None:
    batch = PickBatch(CELL, 8, 4, PickSettings(people=kinds))
    batch.reset()
    for act in acts(30):
        batch.step(act, auto_reset=False)
    for e in np.flatnonzero(batch.state.outcome != OUTCOMES.index("collision")):
        expected = min(person_clearances(batch, e), default=1000.0)
        assert batch.state.clear[e, 0] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("kinds", MIXES)
def test_starts_keep_clear_of_all_people(kinds: tuple[HumanKind, ...]) -> None:
    batch = PickBatch(CELL, 100, 5, PickSettings(people=kinds))
    assert np.isfinite(batch.reset()).all()
    assert (batch.state.clear[:, 0] >= 0.05).all()


def test_uniform_starts_include_contact_which_ends_the_episode_at_once() -> None:
    batch = PickBatch(CELL, 300, 5, PickSettings(people=("walker",) * 4, start="uniform"))
    batch.reset()
    touching = batch.state.clear[:, 0] <= 0.0
    assert 0.02 < touching.mean() < 0.9
    ended = batch.step(np.zeros((300, 5), dtype=np.float32)).ended
    assert (ended[touching] == OUTCOMES.index("collision")).all()


def test_more_people_collide_more_often() -> None:
    shares = []
    for n in (0, 1, 3):
        batch = PickBatch(CELL, 200, 6, PickSettings(people=("worker",) * n, time_limit_s=5.0))
        batch.reset()
        still = np.zeros((200, 5), dtype=np.float32)
        for _ in range(100):
            batch.step(still, auto_reset=False, features=False)
        shares.append((batch.state.outcome == OUTCOMES.index("collision")).mean())
    assert shares[0] == 0.0 < shares[1] < shares[2]


def test_policy_sees_the_nearest_person_of_any_kind() -> None:
    batch = PickBatch(
        CELL, 40, 7, PickSettings(people=("worker", "worker", "walker"), observation="state")
    )
    obs = batch.reset()
    people, seen = batch.state.people, set()
    for e in range(40):
        nearest = int(np.argmin(person_clearances(batch, e)))
        seen.add(nearest)
        expected = people.q[e, nearest] if nearest < 2 else None
        if expected is None:
            x, y, _ = people.cylinders[e, 0]
            expected = human.rest_posture(x, y, np.arctan2(-y, -x))
        np.testing.assert_allclose(obs[e, 12:30], expected, atol=1e-6)
    assert seen == {0, 1, 2}


def test_an_empty_cell_is_seen_as_a_person_too_far_away_to_matter() -> None:
    batch = PickBatch(CELL, 2, 7, PickSettings(people=(), observation="state"))
    obs = batch.reset()
    np.testing.assert_allclose(obs[0, 12:30], human.rest_posture(*scene.FAR_AWAY), atol=1e-6)
    assert not obs[0, 30:48].any()


def test_contact_names_the_person_that_is_touched() -> None:
    cell = with_people(CELL, ("worker", "worker", "walker"))
    arm, people, zero = arm_of(cell), people_of(cell), np.zeros(6)
    away = human.rest_posture(0.0, 4.0, -1.57)
    q = PickBatch(CELL, 1, 0, PickSettings()).world.station_q[3]
    grip = np.array(cell.stations[3].position) + [0.0, 0.04, 0.06]
    near = human.reach("r", grip, human.rest_posture(*cell.human.home), cell.body).q
    far, by = np.array([[3.0, 3.0, 0.3]]), np.array([[0.1, 0.9, 0.3]])
    both = np.stack([away, near])
    found = contact(arm, people, JointPath(q, zero, zero, zero), (both, both), (far, far))
    assert (found.kind, found.part) in {("human", "hand_r"), ("human", "forearm_r")}
    gone = np.stack([away, away])
    found = contact(arm, people, JointPath(q, zero, zero, zero), (gone, gone), (by, by))
    assert (found.kind, found.part) == ("human", "walker")


def test_a_walker_that_passes_between_two_poses_is_a_contact() -> None:
    cell = with_people(CELL, ("walker",))
    arm, people, zero = arm_of(cell), people_of(cell), np.zeros(6)
    no_people = np.zeros((0, 18))
    before, after = np.array([[-1.5, 0.6, 0.2]]), np.array([[1.5, 0.6, 0.2]])
    q = PickBatch(CELL, 1, 0, PickSettings()).world.station_q[3]
    for cylinders in (before, after):
        assert clearance(arm, people, q, no_people, cylinders).people_m > 0.3
    found = contact(
        arm, people, JointPath(q, zero, zero, zero), (no_people, no_people), (before, after)
    )
    assert found.kind == "human"
    assert 0.0 < found.time_s < arm.dt


def test_unknown_kinds_and_crowds_are_refused_by_name() -> None:
    with pytest.raises(InvalidInput, match="robot.*worker, walker"):
        with_people(CELL, ("robot",))  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match="at most 4"):
        with_people(CELL, ("walker",) * 5)
    with pytest.raises(InvalidInput, match="no worker"):
        with_people(load_cell("shared-workspace"), ("worker",))


def pedestrian(height: float) -> ConstantWalker:
    area = {"x_min": -1.0, "x_max": 1.0, "y_min": 0.9, "y_max": 2.0}
    return ConstantWalker(kind="constant", height=height, **area)


def test_added_pedestrians_are_as_tall_as_those_of_the_cell() -> None:
    cell = load_cell("shared-workspace")
    cell = cell.model_copy(update={"people": (pedestrian(2.8),)})
    mixes: tuple[tuple[HumanKind, ...], ...] = (("walker",), ("fixed-speed", "constant"))
    for kinds in mixes:
        top = people_of(with_people(cell, kinds)).top_z
        assert top == pytest.approx(cell.floor_z + 2.8)


def test_a_short_pedestrian_does_not_lower_the_cylinders_of_workers() -> None:
    short = pedestrian(0.8)
    alone = CELL.model_copy(update={"people": (short,)})
    beside = CELL.model_copy(update={"people": (*CELL.workers, short)})
    assert people_of(alone).top_z == pytest.approx(CELL.floor_z + 0.8)
    assert people_of(beside).top_z == pytest.approx(CELL.floor_z + 2.0)


def test_rows_of_a_later_batch_are_those_of_a_wider_one() -> None:
    settings = PickSettings(people=("worker", "walker"))
    wide, late = PickBatch(CELL, 8, 9, settings), PickBatch(CELL, 3, 9, settings, first_env=5)
    np.testing.assert_array_equal(wide.reset()[5:], late.reset())
    for act in acts(120, seed=8):
        one, two = wide.step(act), late.step(act[5:])
        np.testing.assert_array_equal(one.obs[5:], two.obs)
        np.testing.assert_array_equal(one.ended[5:], two.ended)
    assert kernel.RUNNING == 0


def test_obstacles_of_a_cell_are_hit() -> None:
    box = {
        "id": "post",
        "label": "Post",
        "center": (0.0, 0.45, 0.2),
        "half_size": (0.4, 0.1, 0.2),
    }
    data = CELL.definition() | {"obstacles": [box]}
    cell = parse_definition(data)
    batch = PickBatch(cell, 4, 1, PickSettings(people=()))
    batch.reset()
    q = PickBatch(CELL, 1, 0, PickSettings()).world.station_q[2]
    found = clearance(batch.arm, batch.world.people, q, np.zeros((0, 18)), np.zeros((0, 3)))
    assert found.cell_m < 0.0
