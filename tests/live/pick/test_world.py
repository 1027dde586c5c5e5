import numpy as np
import pytest
from pydantic import ValidationError

from app.errors import InvalidInput
from app.live import commands
from app.live.base_world import TIME_LIMIT_S
from app.live.command_checks import Command
from app.live.pick.world import LivePickWorld
from app.live.snapshot import PICK_PHASES, WorldSnapshot
from app.sim.cells.cell import Cell
from app.sim.human import model as human
from app.sim.human.person import Person
from app.sim.pick.kernels.grasp import REACH_ONLY
from app.sim.pick.task_policy import Candidate, PickProgress
from app.sim.robot.actions import ActionSettings
from tests.live.pick.pick_scenes import run, until
from tests.support.straight_policy import StraightPolicy


@pytest.fixture
def world(cell: Cell) -> LivePickWorld:
    """A world whose person stands back, so that nothing is in the robot's way."""
    world = LivePickWorld(cell, StraightPolicy(cell), seed=3)
    world.apply(commands.MovePerson(pelvis=(0.0, 2.4, -1.57)))
    run(world, 40)
    world.apply(commands.Reset())
    return world


def palm(snapshot: WorldSnapshot, cell: Cell, hand: str) -> np.ndarray:
    return human.joint_points(snapshot.people[0].q, cell.body)[f"hand_{hand}"]


def test_robot_reaches_a_candidate_and_the_next_episode_offers_the_others(
    world: LivePickWorld,
) -> None:
    world.apply(commands.SetCandidates(ids=("cube1", "cube4")))
    first = until(world, "picking")
    assert first.counters.reached == 0
    after = until(world, "moving")
    assert after.counters.reached == 1
    assert [c.id for c in after.candidates] == [
        n for n in ("cube1", "cube4") if n != first.chosen
    ]


def test_tool_goes_down_to_the_cube_and_closes_before_the_next_episode(
    world: LivePickWorld,
) -> None:
    until(world, "picking")
    heights, closed = [], False
    while world.snapshot().status == "picking":
        heights.append(world.snapshot().tcp[2])
        closed = closed or world.snapshot().gripping
        world.step()
    assert min(heights) < 0.08
    assert closed


def test_a_hand_over_the_cube_breaks_the_pick_off_and_it_stays_a_candidate(
    world: LivePickWorld, cell: Cell
) -> None:
    world.apply(commands.SetCandidates(ids=("cube2",)))
    until(world, "picking")
    x, y, z = cell.station("cube2").position
    world.apply(commands.MovePerson(pelvis=(x, 1.15, -1.57), right=(x, y + 0.14, z + 0.1)))
    after = until(world, "moving")
    assert after.counters.broken_off == 1
    assert after.counters.reached == 0
    assert [one.id for one in after.candidates] == ["cube2"]


def test_a_descent_that_is_left_for_another_cube_counts_as_broken_off(
    world: LivePickWorld, cell: Cell
) -> None:
    world.apply(commands.SetCandidates(ids=("cube2", "cube4")))
    first = until(world, "picking").chosen
    x, y, z = cell.station(first).position
    world.apply(commands.MovePerson(pelvis=(x, 1.15, -1.57), right=(x, y + 0.18, z + 0.1)))
    after = until(world, "moving")
    assert after.chosen != first
    assert (after.counters.switches, after.counters.broken_off) == (1, 1)


def test_contacts_are_counted_apart_while_the_robot_is_at_rest(world: LivePickWorld) -> None:
    world.apply(commands.SetCandidates(ids=()))
    x, y, z = world.snapshot().tcp
    world.apply(commands.MovePerson(pelvis=(x, 1.15, -1.57), right=(x, y, z)))
    for _ in range(400):
        world.step()
        hit = world.snapshot()
        if hit.counters.contacts_at_rest:
            break
    assert (hit.counters.contacts, hit.counters.contacts_at_rest) == (0, 1)
    assert hit.clearance_m <= 0.0
    stays = run(world, 40)
    assert stays.counters == hit.counters
    assert np.array_equal(stays.robot_q, hit.robot_q)


def test_layer_stops_the_robot_before_a_person_and_says_why(world: LivePickWorld) -> None:
    world.apply(commands.SetCandidates(ids=("cube2",)))
    world.apply(commands.MovePerson(pelvis=(0.0, 1.15, -1.57), right=(-0.1, 0.62, 0.2)))
    overrides = []
    for _ in range(300):
        now = run(world, 1)
        overrides.append(now.safety.override)
        assert now.safety.override == now.safety.advised
    assert 0.0 < sum(0.0 < one < 1.0 for one in overrides)
    assert (now.safety.override, now.counters.contacts) == (0.0, 0)
    assert now.message.startswith("Stopped: the person is")
    assert now.safety.separation == pytest.approx(now.clearance_m, abs=0.02)
    total = now.safety.person_distance + now.safety.robot_distance + now.safety.margin
    assert now.safety.required == pytest.approx(total)
    assert now.safety.moving_s > now.safety.slowed_s > now.safety.stopped_s > 0.0
    world.apply(commands.MovePerson(pelvis=(0.0, 2.4, -1.57)))
    assert until(world, "picking").safety.override == 1.0


def test_parts_that_move_faster_than_assumed_count_at_their_speed(world: LivePickWorld) -> None:
    """T_r of the robot at rest is 0.15 s; people turn at up to 2.5 rad/s."""
    world.apply(commands.SetCandidates(ids=()))
    world.apply(commands.SetSafety(on=True, human_speed=0.2))
    still = run(world, 40).safety
    assert still.person_distance == pytest.approx(0.2 * 0.15)
    world.apply(commands.MovePerson(pelvis=(0.0, 2.4, 1.0)))
    turning = run(world, 3).safety
    assert 0.4 * 0.15 < turning.person_distance < 2.5 * 0.5 * 0.15
    assert run(world, 60).safety.person_distance == pytest.approx(0.2 * 0.15)


def test_robot_does_not_set_off_into_a_person_after_a_pick(
    world: LivePickWorld, cell: Cell
) -> None:
    world.apply(commands.SetCandidates(ids=("cube2", "cube4")))
    first = until(world, "picking").chosen
    until(world, "moving")
    x, y, z = cell.station(first).position
    world.apply(commands.MovePerson(pelvis=(x, 1.15, -1.57), right=(x + 0.1, y, z + 0.2)))
    after = run(world, 200)
    assert after.counters.reached == 1
    assert after.counters.contacts == 0
    assert after.safety.stopped_s > 1.0


def block_home(world: LivePickWorld) -> None:
    """Put a hand where the robot starts, and start again."""
    world.apply(commands.PauseClock())
    x, y, z = world.snapshot().tcp
    world.apply(commands.MovePerson(pelvis=(x, 1.15, -1.57), right=(x, y, z)))
    run(world, 100)
    world.apply(commands.ResumeClock())
    world.apply(commands.Reset())


def test_person_at_home_keeps_the_robot_there(world: LivePickWorld, cell: Cell) -> None:
    block_home(world)
    inside = run(world, 60)
    assert inside.status == "blocked"
    assert np.allclose(inside.robot_q, cell.robot.home_q)
    assert inside.counters.contacts == 0
    world.apply(commands.MovePerson(pelvis=(0.0, 2.4, -1.57)))
    assert until(world, "picking").counters.contacts == 0


def test_commands_change_the_decision_while_a_person_blocks_the_robot(
    world: LivePickWorld,
) -> None:
    block_home(world)
    assert len(world.snapshot().candidates) > 1
    world.apply(commands.SetCandidates(ids=("dock0",)))
    one = world.snapshot()
    assert (one.status, one.chosen) == ("blocked", "dock0")
    assert [candidate.id for candidate in one.candidates] == ["dock0"]
    world.apply(commands.SetPolicy(checkpoint=None))
    assert (world.snapshot().status, world.snapshot().chosen) == ("blocked", None)


def test_decision_in_a_snapshot_is_the_one_for_its_own_state(
    world: LivePickWorld, cell: Cell
) -> None:
    snapshot = run(world, 25)
    again = StraightPolicy(cell).decide(
        snapshot.robot_q,
        snapshot.robot_qd,
        [Person(q=one.q, qd=one.qd, size=one.size) for one in snapshot.people],
        [Candidate(id=c.id, position=c.position) for c in snapshot.candidates],
        previous=snapshot.previous,
        progress=PickProgress(
            phase=PICK_PHASES.index(snapshot.phase), closing_s=snapshot.closing_s
        ),
        time_left_s=snapshot.time_left_s,
    )
    assert again.chosen == snapshot.chosen
    assert again.values == tuple(snapshot.values.values())


def test_joint_limits_hold_over_a_minute_of_work(cell: Cell) -> None:
    world = LivePickWorld(cell, StraightPolicy(cell), seed=5)
    for _ in range(1200):
        world.step()
        snapshot = world.snapshot()
        assert (np.abs(snapshot.robot_qd) <= np.array(cell.robot.qd_max) + 1e-9).all()
        assert (snapshot.robot_q >= cell.robot.q_min).all()
        assert (snapshot.robot_q <= cell.robot.q_max).all()


def test_hand_on_the_chosen_cube_changes_the_choice_and_counts_a_switch(
    world: LivePickWorld, cell: Cell
) -> None:
    world.apply(commands.SetCandidates(ids=("cube1", "cube4")))
    world.apply(commands.MovePerson(pelvis=(0.0, 1.2, -1.57)))
    run(world, 5)
    world.apply(commands.PauseClock())
    before = world.snapshot().chosen
    assert before is not None
    x, y, z = cell.station(before).position
    world.apply(commands.MovePerson(right=(x, y, z), left=(x, y, z)))
    after = run(world, 60)
    assert after.chosen != before
    assert after.counters.switches >= 1
    assert "Switched to" in after.message


def test_dragged_hand_arrives_with_bounded_speed(world: LivePickWorld, cell: Cell) -> None:
    world.apply(commands.MovePerson(pelvis=(0.0, 1.2, -1.57)))
    run(world, 60)
    world.apply(commands.MovePerson(right=(-0.2, 0.8, 0.2)))
    speeds, last = [], palm(world.snapshot(), cell, "r")
    for _ in range(60):
        now = palm(run(world, 1), cell, "r")
        speeds.append(np.linalg.norm(now - last) / cell.robot.dt)
        last = now
    assert np.linalg.norm(last - [-0.2, 0.8, 0.2]) < 0.02
    assert 0.3 < max(speeds) < 4.0


def test_speed_given_to_the_policy_is_the_speed_of_the_movement(world: LivePickWorld) -> None:
    world.apply(commands.MovePerson(pelvis=(0.3, 1.6, -1.2)))
    before = run(world, 3)
    after = run(world, 1)
    assert np.allclose(after.people[0].qd, (after.people[0].q - before.people[0].q) / 0.05)


def test_paused_clock_stands_while_the_dragged_person_moves(world: LivePickWorld) -> None:
    world.apply(commands.PauseClock())
    before = world.snapshot()
    world.apply(commands.MovePerson(pelvis=(0.5, 1.8, -1.0)))
    after = run(world, 30)
    assert (after.tick, after.t_s) == (before.tick, before.t_s)
    assert np.array_equal(after.robot_q, before.robot_q)
    assert abs(after.people[0].q[0] - 0.5) < 0.05
    assert not after.people[0].qd.any()


def test_step_once_advances_by_one_period_and_stays_paused(world: LivePickWorld) -> None:
    before = world.snapshot()
    world.apply(commands.StepOnce())
    after = run(world, 5)
    assert after.tick == before.tick + 1
    assert after.paused


def test_person_does_not_jump_when_it_goes_back_to_work(world: LivePickWorld) -> None:
    world.apply(commands.SetMode(mode="auto"))
    q = world.snapshot().people[0].q
    for _ in range(200):
        after = run(world, 1).people[0].q
        assert np.abs(after - q).max() < 0.5
        q = after


def test_without_policy_or_candidates_the_robot_rests_and_says_why(cell: Cell) -> None:
    world = LivePickWorld(cell, None, seed=1)
    assert run(world, 20).status == "no policy"
    world.apply(commands.SetPolicy(checkpoint="straight").with_loaded(StraightPolicy(cell)))
    world.apply(commands.SetCandidates(ids=()))
    after = run(world, 20)
    assert after.status == "no candidates"
    assert np.allclose(after.robot_q, cell.robot.home_q)


@pytest.mark.parametrize(
    ("command", "status"),
    [
        (commands.SetPolicy(checkpoint=None), "no policy"),
        (commands.SetCandidates(ids=()), "no candidates"),
    ],
)
def test_pick_ends_when_its_policy_or_all_candidates_are_removed(
    world: LivePickWorld, command: Command, status: str
) -> None:
    until(world, "picking")
    world.apply(command)
    after = run(world, 20)
    assert after.status == status
    assert (after.chosen, after.counters.reached) == (None, 0)
    assert (after.previous, after.phase) == (None, "approach")
    assert np.abs(after.robot_qd).max() < 1e-9


def test_robot_without_a_target_stops_whatever_the_actions_of_its_policy_mean(
    world: LivePickWorld, cell: Cell
) -> None:
    policy = StraightPolicy(cell)
    policy.action = ActionSettings(meaning="coefficient")
    world.apply(commands.SetPolicy(checkpoint="other").with_loaded(policy))
    assert np.abs(run(world, 10).robot_qd).max() > 0.1
    world.apply(commands.SetCandidates(ids=()))
    after = run(world, 20)
    assert (after.status, after.counters.contacts) == ("no candidates", 0)
    assert np.abs(after.robot_qd).max() < 1e-9


def test_policy_with_another_grasp_begins_a_new_motion_in_the_middle_of_a_pick(
    world: LivePickWorld, cell: Cell
) -> None:
    until(world, "picking")
    policy = StraightPolicy(cell)
    policy.grasp = REACH_ONLY
    world.apply(commands.SetPolicy(checkpoint="reach").with_loaded(policy))
    begun = world.snapshot()
    assert (begun.status, begun.phase, begun.time_left_s) == (
        "moving",
        "approach",
        TIME_LIMIT_S,
    )
    after = run(world, 60)
    assert (after.status, after.counters.timeouts) == ("moving", 0)
    assert after.counters.reached >= 1


def test_other_goals_and_another_policy_have_the_whole_time_limit(
    world: LivePickWorld, cell: Cell
) -> None:
    world.apply(commands.SetCandidates(ids=("cube1",)))
    left = run(world, 5).time_left_s
    assert left < TIME_LIMIT_S
    world.apply(commands.SetCandidates(ids=("cube1", "cube4")))
    same = world.snapshot()
    assert (same.chosen, same.time_left_s) == ("cube1", left)
    world.apply(commands.SetCandidates(ids=("cube4",)))
    assert world.snapshot().time_left_s == TIME_LIMIT_S
    assert run(world, 5).time_left_s < TIME_LIMIT_S
    world.apply(commands.SetPolicy(checkpoint="other").with_loaded(StraightPolicy(cell)))
    assert world.snapshot().time_left_s == TIME_LIMIT_S


def test_target_removed_in_its_pick_is_left_at_once(world: LivePickWorld) -> None:
    chosen = until(world, "picking").chosen
    assert chosen is not None
    world.apply(commands.PauseClock())
    world.apply(commands.ToggleCandidate(id=chosen))
    after = world.snapshot()
    assert after.status == "moving"
    assert after.chosen != chosen
    assert after.phase == "approach"


def test_toggling_adds_and_removes_a_candidate_in_the_cells_order(world: LivePickWorld) -> None:
    world.apply(commands.SetCandidates(ids=("cube4",)))
    world.apply(commands.ToggleCandidate(id="cube1"))
    assert world.snapshot().selected == ("cube1", "cube4")
    world.apply(commands.ToggleCandidate(id="cube4"))
    assert world.snapshot().selected == ("cube1",)


def test_commands_that_do_not_fit_are_refused_and_change_nothing(world: LivePickWorld) -> None:
    before = world.snapshot()
    with pytest.raises(InvalidInput, match="cube9"):
        world.apply(commands.ToggleCandidate(id="cube9"))
    with pytest.raises(InvalidInput, match="use_measured_velocity"):
        world.apply(commands.SetSafety(on=True, use_measured_velocity=True))
    with pytest.raises(InvalidInput, match="case-9"):
        world.apply(commands.StartCase(id="case-9"))
    assert world.snapshot().selected == before.selected
    assert world.snapshot().mode == before.mode


def test_snapshots_cannot_be_written(world: LivePickWorld) -> None:
    with pytest.raises(ValueError, match="read-only"):
        world.snapshot().robot_q[0] = 1.0


@pytest.mark.parametrize("point", [(1e308, 1e308, 0.0), (0.0, -1e155, 0.0), (0.0, 0.0, 600.0)])
@pytest.mark.parametrize("part", ["pelvis", "right", "left"])
def test_a_place_that_is_in_no_hall_is_refused(
    world: LivePickWorld, part: str, point: tuple[float, float, float]
) -> None:
    with pytest.raises(ValidationError, match=part):
        world.apply(commands.MovePerson(**{part: point}))
    assert np.isfinite(run(world, 5).people[0].q).all()


@pytest.mark.parametrize("far", [60.0, -99.9])
def test_a_place_far_away_in_the_hall_is_reached_for(world: LivePickWorld, far: float) -> None:
    world.apply(commands.MovePerson(pelvis=(far, far, far), right=(far, far, far)))
    world.apply(commands.MovePerson(left=(-far, far, -far)))
    assert np.isfinite(run(world, 80).people[0].q).all()
