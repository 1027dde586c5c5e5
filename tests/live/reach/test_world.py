from collections.abc import Callable

import numpy as np
import pytest

from app.errors import InvalidInput
from app.live import commands
from app.live.command_checks import Command
from app.live.commands import SetSafety
from app.live.reach.commands import MoveGoal, NewGoal, SetGoalMode, SetInferenceMode
from app.live.reach.world import LONG_LIMIT_S, LiveReachWorld
from app.live.snapshot import WorldSnapshot
from app.sim.cells.cell import load_cell

CELL = load_cell("shared-workspace")
FAR_CORNER = (-2.0, 2.0, 0.0)
MIDDLE = (0.0, 0.8, 0.3)


def empty_world() -> LiveReachWorld:
    """A cell that everybody has left."""
    world = LiveReachWorld(CELL, None, seed=3)
    world.apply(commands.RemovePerson(person=0))
    return world


def standing_at(world: LiveReachWorld, x: float, y: float) -> None:
    """Let the first person stand somewhere, the clock being stopped meanwhile."""
    world.apply(commands.PauseClock())
    world.apply(commands.MovePerson(pelvis=(x, y, 0.0)))
    for _ in range(250):
        world.step()
    world.apply(commands.ResumeClock())


def until(
    world: LiveReachWorld, holds: Callable[[WorldSnapshot], bool], seconds: float = 30.0
) -> WorldSnapshot:
    for _ in range(round(seconds / CELL.robot.dt)):
        world.step()
        if holds(now := world.snapshot()):
            return now
    raise AssertionError(f"it never happened: {now.message}")


def test_robot_without_a_policy_goes_from_goal_to_goal_and_says_so() -> None:
    world = empty_world()
    first = world.snapshot()
    assert "No reach policy is active" in first.message
    reached = until(world, lambda now: now.status == "reached")
    assert float(np.linalg.norm(reached.tcp - first.reach.goal)) < reached.reach.tolerance
    then = until(world, lambda now: now.counters.reached == 2)
    assert not np.array_equal(then.reach.goal, first.reach.goal)
    assert (then.counters.contacts, then.counters.timeouts) == (0, 0)
    assert then.reach.counters.reaching_s == pytest.approx(then.safety.moving_s)


def test_goal_that_follows_stays_until_it_is_dragged_away() -> None:
    world = empty_world()
    world.apply(SetGoalMode(mode="follow"))
    world.apply(MoveGoal(position=MIDDLE))
    until(world, lambda now: now.status == "reached")
    for _ in range(60):
        world.step()
    rests = world.snapshot()
    assert rests.status == "reached"
    assert np.allclose(rests.robot_qd, 0.0, atol=1e-6)
    world.apply(MoveGoal(position=(0.4, 0.8, 0.3)))
    assert world.snapshot().status == "moving"
    assert until(world, lambda now: now.counters.reached == 2).reach.goal[0] == 0.4


def test_goal_can_be_drawn_again_while_the_robot_moves() -> None:
    world = empty_world()
    for _ in range(20):
        world.step()
    before = world.snapshot()
    world.apply(NewGoal())
    after = world.snapshot()
    assert float(np.linalg.norm(after.reach.goal - before.reach.goal)) > 0.2
    assert after.time_left_s == LONG_LIMIT_S


def test_person_beside_the_robot_slows_it_down_and_the_message_says_by_how_much() -> None:
    world = LiveReachWorld(CELL, None, seed=3)
    standing_at(world, -0.35, 1.5)
    slow = until(world, lambda now: 0.0 < now.safety.override < 0.9)
    safety = slow.safety
    assert slow.message.startswith(f"Slowed to {100 * safety.override:.0f} %")
    assert f"{safety.separation:.2f} m from the" in slow.message
    total = safety.person_distance + safety.robot_distance + safety.margin
    assert safety.required == pytest.approx(total)
    assert (safety.person, safety.on) == (0, True)


def test_robot_stops_before_a_standing_person_and_continues_afterwards() -> None:
    world = LiveReachWorld(CELL, None, seed=3)
    standing_at(world, 0.0, 0.9)
    stopped = until(world, lambda now: now.safety.override == 0.0)
    assert stopped.message.startswith("Stopped:")
    world.apply(commands.MovePerson(pelvis=FAR_CORNER))
    end = until(world, lambda now: now.counters.reached == 1)
    assert end.counters.contacts == 0
    assert end.safety.stopped_s > 0.0


def test_person_who_walks_into_the_standing_robot_is_no_contact() -> None:
    world = LiveReachWorld(CELL, None, seed=3)
    standing_at(world, 0.0, 1.2)
    until(world, lambda now: now.safety.override == 0.0)
    x, y, _ = world.snapshot().tcp
    world.apply(commands.MovePerson(pelvis=(float(x), float(y), 0.0)))
    hit = until(world, lambda now: now.counters.contacts_at_rest == 1)
    assert np.allclose(hit.robot_qd, 0.0, atol=1e-3)
    for _ in range(50):
        world.step()
    after = world.snapshot()
    assert (after.counters.contacts, after.counters.contacts_at_rest) == (0, 1)
    assert "stands still" in after.message


def test_without_the_layer_the_robot_hits_an_unobserved_person() -> None:
    world = LiveReachWorld(CELL, None, seed=3)
    world.apply(SetSafety(on=False))
    world.apply(SetGoalMode(mode="follow"))
    world.apply(MoveGoal(position=(-0.5, 0.8, 0.3)))
    standing_at(world, -0.3, 1.0)
    assert world.snapshot().safety.override == 1.0
    hit = until(world, lambda now: now.status == "contact")
    assert (hit.counters.contacts, hit.contact.kind, hit.contact.person) == (1, "human", 0)
    assert hit.safety.advised < 1.0
    again = until(world, lambda now: now.status != "contact")
    assert np.allclose(again.robot_q, CELL.robot.home_q, atol=0.02)


def test_who_stands_near_does_not_hold_the_robot_where_velocities_are_measured() -> None:
    world = LiveReachWorld(CELL, None, seed=3)
    x, y, _ = world.snapshot().tcp
    standing_at(world, float(x), float(y) + 0.75)
    assumed = world.snapshot().safety
    world.apply(SetSafety(on=True, use_measured_velocity=True))
    measured = world.snapshot().safety
    assert assumed.advised < measured.advised == 1.0
    assert (assumed.use_measured_velocity, measured.use_measured_velocity) == (False, True)
    assert (assumed.human_speed, measured.human_speed) == (1.6, pytest.approx(0.1))
    assert measured.required < assumed.required
    assert np.ptp(measured.zone, axis=0).max() < np.ptp(assumed.zone, axis=0).max() - 0.3
    world.apply(SetSafety(on=False))
    assert world.snapshot().safety.use_measured_velocity


def test_goal_that_is_not_reached_in_time_counts_and_is_tried_again() -> None:
    world = LiveReachWorld(CELL, None, seed=3)
    standing_at(world, 0.0, 0.8)
    world.apply(MoveGoal(position=MIDDLE))
    late = until(world, lambda now: now.counters.timeouts == 1)
    assert late.status == "moving"
    assert np.array_equal(late.reach.goal, MIDDLE)
    assert late.time_left_s == LONG_LIMIT_S


def test_paused_cell_answers_to_a_person_who_is_dragged() -> None:
    world = LiveReachWorld(CELL, None, seed=3)
    world.apply(commands.PauseClock())
    before = world.snapshot()
    standing_at(world, 0.3, 1.0)
    after = world.snapshot()
    assert np.array_equal(after.robot_q, before.robot_q)
    assert after.safety.separation != before.safety.separation
    assert after.people[0].mode == "manual"


def test_same_seed_gives_the_same_run() -> None:
    ends = []
    for _ in range(2):
        world = LiveReachWorld(CELL, None, seed=5)
        for _ in range(150):
            world.step()
        ends.append(world.snapshot())
    assert np.array_equal(ends[0].robot_q, ends[1].robot_q)
    assert ends[0].people[0].cylinder == ends[1].people[0].cylinder


def test_reset_sets_time_and_counters_to_zero() -> None:
    world = empty_world()
    until(world, lambda now: now.counters.reached == 1)
    world.apply(commands.Reset())
    fresh = world.snapshot()
    assert (fresh.t_s, fresh.counters.reached, fresh.safety.moving_s) == (0.0, 0, 0.0)
    assert np.array_equal(fresh.robot_q, CELL.robot.home_q)


@pytest.mark.parametrize(
    ("command", "field"),
    [
        (MoveGoal(position=(0.0, 1.3, 0.3)), "position.y"),
        (SetInferenceMode(inference_mode="direct"), "inference_mode"),
        (commands.SetAnthropometry(stature=50.0), "tag"),
        (commands.MovePerson(right=(0.0, 0.0, 0.0)), "right"),
        (commands.ToggleCandidate(id="cube1"), "tag"),
        (commands.SetMode(mode="still", person=3), "person"),
    ],
)
def test_what_the_cell_cannot_do_is_refused_by_name(command: Command, field: str) -> None:
    world = LiveReachWorld(CELL, None, seed=3)
    before = world.snapshot()
    with pytest.raises(InvalidInput) as refused:
        world.apply(command)
    assert refused.value.field == field
    assert np.array_equal(world.snapshot().reach.goal, before.reach.goal)


def test_goal_outside_says_which_axis_and_by_how_much() -> None:
    with pytest.raises(InvalidInput, match=r"position.y.*0\.6, 1\] m: 0\.3 m outside"):
        LiveReachWorld(CELL, None, seed=3).apply(MoveGoal(position=(0.0, 1.3, 0.3)))
