from dataclasses import replace

import numpy as np
import pytest

from app.errors import InvalidInput
from app.live import commands
from app.live.command_checks import Command
from app.live.snapshot import WorldSnapshot
from app.live.sorting.commands import (
    AddBlock,
    MoveBlock,
    RemoveBlock,
    SetGoal,
    SetOrder,
    SetSortingPolicy,
    StartTest,
    ToggleGoal,
)
from app.live.sorting.snapshot import Order
from app.live.sorting.world import LiveSortingWorld
from app.policies.checkpoints import pretrained
from app.policies.inference.task_selection import TaskChooser
from app.sim.cells.cell import load_cell
from app.sim.sorting.state import Move, SortingShape
from tests.sim.sorting.sorting_scenes import empty_world, lay, solved, towers, until
from tests.support.sorting_values import FixedValues
from tests.support.straight_policy import StraightPolicy


def phase(name: str):
    return lambda snapshot: snapshot.sorting.phase == name


def test_shipped_policy_and_planner_reach_a_goal_beside_a_person_who_stands_back() -> None:
    world = empty_world(TaskChooser(pretrained.load("pick")))
    lay(world, {"slot5": "red-small", "slot9": "red-large"}, {"red": ("large", "small")})
    end = until(world, solved)
    assert towers(end) == {"red": ["red-large", "red-small"], "blue": []}
    counters = end.sorting.counters
    assert (counters.moves, counters.attempts, counters.failures) == (2, 2, 0)
    assert end.sorting.solved
    assert end.counters.contacts == 0


def test_block_that_is_added_while_the_robot_works_reaches_the_longer_goal() -> None:
    world = empty_world()
    lay(world, {"slot5": "red-small", "slot9": "red-medium"}, {"red": ("medium", "small")})
    carrying = until(world, phase("carry"))
    world.apply(AddBlock(colour="red", size="large", at="slot6"))
    world.apply(SetGoal(towers={"red": ("large", "medium", "small")}))
    end = until(world, solved)
    assert end.t_s > carrying.t_s
    assert towers(end)["red"] == ["red-large", "red-medium", "red-small"]


def test_robot_takes_another_block_when_the_one_it_goes_for_is_removed() -> None:
    world = empty_world()
    lay(world, {"slot5": "red-large", "slot6": "red-large"}, {"red": ("large",)})
    going = until(world, phase("approach")).sorting.move
    assert going.pick == "slot5"
    world.apply(RemoveBlock(id=going.block))
    assert world.snapshot().sorting.move.pick == "slot6"
    assert towers(until(world, solved))["red"] == ["red-large"]


def test_block_at_the_magnet_that_is_removed_leaves_the_robot_with_a_smaller_goal() -> None:
    world = empty_world()
    lay(world, {"slot5": "red-large", "slot9": "blue-small"}, {"red": ("large",)})
    held = until(world, phase("carry")).sorting.move.block
    world.apply(RemoveBlock(id=held))
    after = world.snapshot()
    assert [one.id for one in after.sorting.blocks if one.held] == []
    assert after.sorting.goal == ()
    assert after.status == "no candidates"
    assert "also from the goal" in after.message


def test_held_block_goes_back_when_the_goal_does_not_ask_for_it_any_more() -> None:
    world = empty_world()
    lay(world, {"slot5": "red-large", "slot9": "blue-small"}, {"red": ("large",)})
    until(world, phase("carry"))
    world.apply(SetGoal(towers={"blue": ("small",)}))
    end = until(world, solved)
    assert towers(end) == {"red": [], "blue": ["blue-small"]}
    assert {one.place for one in end.sorting.blocks} == {"slot5", "blue"}


def test_held_block_whose_cell_was_taken_is_put_into_another() -> None:
    world = empty_world()
    ids = lay(world, {"slot5": "red-large", "slot9": "blue-small"}, {"red": ("large",)})
    until(world, phase("carry"))
    world.apply(MoveBlock(id=ids["slot9"], to="slot5"))
    world.apply(SetGoal(towers={}))
    end = until(world, lambda now: now.status == "no candidates")
    assert sorted(one.place for one in end.sorting.blocks) == ["slot0", "slot5"]


def test_place_occupied_during_placement_is_not_used_twice() -> None:
    world = empty_world()
    lay(world, {"slot5": "red-large", "slot9": "red-small"}, {"red": ("large",)})
    until(world, phase("place"))
    world.apply(AddBlock(colour="red", size="medium", at="red"))
    end = until(world, solved)
    assert towers(end)["red"] == ["red-large"]
    places = [(one.place, one.level) for one in end.sorting.blocks]
    assert len(set(places)) == len(places) == 3


def test_goal_that_changes_while_the_tool_rises_with_a_block_is_followed() -> None:
    world = empty_world()
    ids = lay(world, {"slot5": "red-large", "slot9": "blue-small"}, {"red": ("large",)})
    until(world, lambda now: any(one.held for one in now.sorting.blocks))
    assert world.snapshot().sorting.phase == "grasp"
    world.apply(MoveBlock(id=ids["slot9"], to="red"))
    world.apply(SetGoal(towers={"blue": ("small",), "red": ("large",)}))
    end = until(world, solved)
    assert towers(end) == {"red": ["red-large"], "blue": ["blue-small"]}


def test_grasps_fail_as_often_as_the_cell_says() -> None:
    attempts = failures = 0
    for seed in range(3):
        world = empty_world(seed=seed)
        kinds = {f"slot{k}": "red-small" for k in (1, 2, 3)}
        lay(world, kinds, {"red": ("small",) * 3})
        counters = until(world, solved, 6000).sorting.counters
        attempts, failures = attempts + counters.attempts, failures + counters.failures
    assert attempts - failures == 9
    spread = 3.0 * np.sqrt(0.37 * 0.63 / attempts)
    assert abs(failures / attempts - 0.37) < spread


def test_joint_limits_hold_along_the_whole_motion() -> None:
    world = empty_world()
    robot = world.cell.robot
    lay(world, {"slot2": "red-large", "slot9": "blue-small"}, {"red": ("large",)})
    before, lowest = world.snapshot(), 1.0
    for _ in range(500):
        world.step()
        now = world.snapshot()
        assert (np.abs(now.robot_qd) <= np.array(robot.qd_max) + 1e-9).all()
        jump = np.abs(now.robot_qd - before.robot_qd) / robot.dt
        assert (jump <= np.array(robot.qdd_max) + 1e-6).all()
        before, lowest = now, min(lowest, now.tcp[2])
    assert 0.045 < lowest < 0.055


def test_same_seed_and_commands_give_the_same_snapshots() -> None:
    def run() -> list[WorldSnapshot]:
        cell = load_cell("sorting-e0")
        world = LiveSortingWorld(cell, StraightPolicy(cell), seed=4)
        seen = []
        for tick in range(150):
            if tick == 40:
                world.apply(StartTest(id="test-1"))
            world.step()
            seen.append(replace(world.snapshot(), people=()))
        return seen

    for one, other in zip(run(), run(), strict=True):
        np.testing.assert_array_equal(one.robot_q, other.robot_q)
        assert (one.message, one.status, one.t_s) == (other.message, other.status, other.t_s)
        for a, b in zip(one.sorting.blocks, other.sorting.blocks, strict=True):
            assert (a.id, a.place, a.level, a.in_goal) == (b.id, b.place, b.level, b.in_goal)


def test_reset_draws_another_task_with_a_goal() -> None:
    cell = load_cell("sorting-e0")
    world = LiveSortingWorld(cell, None, seed=1)
    first = world.snapshot().sorting
    world.apply(commands.Reset())
    second = world.snapshot().sorting
    for view in (first, second):
        assert len(view.blocks) == 6
        assert view.moves_to_go > 0
    assert [one.place for one in first.blocks] != [one.place for one in second.blocks]


def test_critic_may_take_any_duplicate_that_fails_as_rarely() -> None:
    world = empty_world()
    ids = lay(world, {"slot5": "red-large", "slot9": "red-large"}, {"red": ("large",)})
    going = until(world, phase("approach"))
    assert set(going.sorting.duplicates) == set(ids.values())
    assert {one.id for one in going.candidates} == set(ids.values())
    taken = until(world, phase("grasp")).sorting.move
    assert taken.block == going.chosen
    assert until(world, solved).sorting.counters.moves == 1


@pytest.mark.parametrize(
    ("order", "text"),
    [
        ("critic", "2 moves are equal; chosen by value "),
        ("planner", "2 moves are equal; this one comes first."),
        ("nearest", "2 moves are equal; chosen because it was the nearest."),
    ],
)
def test_order_of_equal_moves_is_followed_and_named(order: Order, text: str) -> None:
    world = empty_world()
    lay(world, {"slot5": "red-large", "slot9": "red-large"}, {"red": ("large",)})
    world.apply(SetOrder(order=order))
    going = until(world, phase("approach"))
    assert going.sorting.order == order
    assert len(going.sorting.duplicates) == (2 if order == "critic" else 1)
    assert text in going.message
    assert until(world, solved).sorting.counters.moves == 1


def test_duplicate_in_a_riskier_slot_is_left_and_the_message_says_so() -> None:
    world = empty_world()
    ids = lay(world, {"slot2": "red-large", "slot9": "red-large"}, {"red": ("large",)})
    going = until(world, phase("approach"))
    assert going.sorting.duplicates == (ids["slot9"],)
    assert going.message == (
        "Moving to the large red block in slot 9, to be placed on the red tower: 1 move to go. "
        "Its duplicate in slot 2 fails more often (40 %)."
    )


def test_planner_replaces_a_policy_that_cycles() -> None:
    shape = SortingShape(n_slots=10, n_colours=2)
    to_blue = [Move(k, 11) for k in range(10)]
    back = [Move(11, k) for k in range(10)]
    world = empty_world(sorting_policy=FixedValues(shape, [*to_blue, *back]))
    lay(world, {"slot5": "red-large", "slot9": "red-small"}, {"red": ("large", "small")})
    assert until(world, phase("approach")).sorting.decided_by == "policy"
    end = until(world, solved, 6000)
    assert end.sorting.counters.planner_fallbacks == 1
    assert towers(end)["red"] == ["red-large", "red-small"]


def test_setting_the_same_goal_again_is_no_repeated_state() -> None:
    shape = SortingShape(n_slots=10, n_colours=2)
    world = empty_world(sorting_policy=FixedValues(shape, [Move(5, 10)]))
    lay(world, {"slot5": "red-large"}, {"red": ("large",)})
    for _ in range(3):
        world.apply(SetGoal(towers={"red": ("large",)}))
        world.step()
    now = world.snapshot().sorting
    assert (now.decided_by, now.counters.planner_fallbacks) == ("policy", 0)
    world.apply(SetSortingPolicy(checkpoint=None))
    assert world.snapshot().sorting.decided_by == "planner"


def test_person_of_a_test_adds_a_larger_block_at_the_goal() -> None:
    world = empty_world()
    world.apply(StartTest(id="test-4"))
    world.apply(commands.MovePerson(pelvis=(0.0, 2.4, -1.57)))
    first = until(world, solved, 6000)
    assert len(first.sorting.blocks) == 5
    more = until(world, lambda now: len(now.sorting.blocks) == 6)
    assert more.message == "A person adds a larger block, and the goal asks for it."
    end = until(world, solved, 6000)
    assert end.sorting.test == "test-4"
    assert end.sorting.counters.moves > 6
    assert more.verdict.as_expected is None
    assert end.verdict.as_expected is True
    assert end.verdict.observed.startswith("2 of 2 goals reached")
    assert end.counters.contacts == 0


def test_contact_lets_a_held_block_fall_back_where_it_came_from() -> None:
    world = empty_world()
    lay(world, {"slot7": "red-large"}, {"red": ("large",)})
    world.apply(commands.MovePerson(pelvis=(-0.7, 1.12, -1.57)))
    until(world, phase("carry"))
    world.apply(commands.SetSafety(on=False))
    world.apply(commands.MovePerson(right=(-0.5, 0.5, 0.2), left=(-0.6, 0.6, 0.2)))
    until(world, lambda now: now.status == "contact")
    after = until(world, lambda now: now.status in ("moving", "blocked"))
    assert [one.place for one in after.sorting.blocks] == ["slot7"]
    assert after.sorting.counters.moves == 0


def test_layer_holds_the_block_before_a_person_and_the_robot_goes_on_afterwards() -> None:
    world = empty_world()
    lay(world, {"slot7": "red-large"}, {"red": ("large",)})
    world.apply(commands.MovePerson(pelvis=(-0.7, 1.12, -1.57)))
    until(world, phase("carry"))
    world.apply(commands.MovePerson(right=(-0.5, 0.5, 0.2), left=(-0.6, 0.6, 0.2)))
    held = until(world, lambda now: now.safety.override == 0.0)
    assert held.message.startswith("Stopped: the person is")
    for _ in range(200):
        world.step()
    assert world.snapshot().counters.contacts == 0
    world.apply(commands.MovePerson(pelvis=(0.0, 2.4, -1.57)))
    end = until(world, solved)
    assert towers(end)["red"] == ["red-large"]
    assert end.safety.stopped_s > 1.0


def test_nothing_is_grasped_while_a_hand_is_near() -> None:
    world = empty_world()
    lay(world, {"slot5": "red-large"}, {"red": ("large",)})
    world.apply(commands.MovePerson(pelvis=(-0.5, 1.12, -1.57)))
    world.apply(commands.MovePerson(right=(-0.55, 0.78, 0.1), left=(-0.5, 0.85, 0.1)))
    for _ in range(200):
        world.step()
    now = world.snapshot()
    assert now.clearance_m < 0.25
    assert now.sorting.counters.attempts == 0
    world.apply(commands.MovePerson(pelvis=(0.0, 2.4, -1.57)))
    assert towers(until(world, solved))["red"] == ["red-large"]


def test_critic_may_choose_which_tower_comes_first() -> None:
    world = empty_world()
    ids = lay(
        world,
        {"slot5": "red-large", "slot9": "blue-large"},
        {"red": ("large",), "blue": ("large",)},
    )
    going = until(world, phase("approach"))
    assert set(going.sorting.duplicates) == set(ids.values())
    end = until(world, solved)
    assert towers(end) == {"red": ["red-large"], "blue": ["blue-large"]}
    assert end.sorting.counters.moves == 2


def test_robot_goes_home_with_nothing_to_do() -> None:
    world = empty_world()
    lay(world, {"slot5": "red-large"}, {"red": ("large",)})
    until(world, solved)
    home = np.array(world.cell.robot.home_q)
    until(world, lambda now: np.abs(now.robot_q - home).max() < 0.02)


def test_robot_rests_without_a_policy() -> None:
    world = LiveSortingWorld(load_cell("sorting-e0"), None, seed=1)
    before = world.snapshot()
    for _ in range(20):
        world.step()
    after = world.snapshot()
    assert after.status == "no policy"
    np.testing.assert_array_equal(before.robot_q, after.robot_q)


@pytest.mark.parametrize(
    ("command", "field"),
    [
        (AddBlock(colour="green", size="small"), "colour"),
        (AddBlock(colour="red", size="huge"), "size"),
        (AddBlock(colour="red", size="small", at="slot5"), "at"),
        (MoveBlock(id="block99", to="slot0"), "id"),
        (RemoveBlock(id="block99"), "id"),
        (ToggleGoal(id="blue-small"), "id"),
        (SetGoal(towers={"red": ("large", "large")}), "towers"),
        (SetGoal(towers={"green": ()}), "towers"),
        (StartTest(id="test-7"), "id"),
        (commands.ToggleCandidate(id="slot0"), "tag"),
    ],
)
def test_command_that_does_not_fit_is_named_and_changes_nothing(
    command: Command, field: str
) -> None:
    world = empty_world()
    lay(world, {"slot5": "red-large"}, {})
    before = world.snapshot().sorting
    with pytest.raises(InvalidInput) as caught:
        world.apply(command)
    assert caught.value.field == field
    after = world.snapshot().sorting
    assert [one.id for one in after.blocks] == [one.id for one in before.blocks]
    assert after.goal == before.goal
