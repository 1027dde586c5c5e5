import numpy as np
import pytest

from app.errors import InvalidInput
from app.live import commands
from app.live.command_checks import Command
from app.live.people.workers import LiveWorkers, place_of
from app.live.pick.world import LivePickWorld
from app.live.playback import Recording
from app.live.snapshot import PersonSnapshot, WorldSnapshot
from app.sim.cells.cell import Cell
from app.sim.collision.contact import clearance
from app.sim.human import model as human
from app.sim.human.anthropometry import percentile_body
from app.sim.human.kernels.kinematics import PELVIS_Z, new_body_capsules
from app.sim.primitives.primitive_library import motion_library
from app.sim.scene.scene import NO_CYLINDERS, arm_of, people_of
from tests.live.pick.pick_scenes import run
from tests.sim.recorded_motion import recorded
from tests.support.straight_policy import StraightPolicy

DT = 0.05


@pytest.fixture
def world(cell: Cell) -> LivePickWorld:
    return LivePickWorld(cell, StraightPolicy(cell), seed=3)


def play(world: LivePickWorld, person: int = 0, **how: float) -> WorldSnapshot:
    """Play a recording and wait until the person has come to its beginning."""
    world.apply(
        commands.SetMotion(name="made-up", person=person).with_loaded(
            Recording(recorded(**how), "made-up")
        )
    )
    for _ in range(200):
        world.step()
        if not world.snapshot().people[person].joining:
            return world.snapshot()
    raise AssertionError("the person never begins")


def palms(person: PersonSnapshot) -> np.ndarray:
    points = human.joint_points(person.q, person.size)
    return np.stack([points["hand_r"], points["hand_l"]])


def gap(first: PersonSnapshot, second: PersonSnapshot, floor_z: float) -> float:
    """Least distance of two people's capsules, by sampling their axes [m]."""
    shares = np.linspace(0.0, 1.0, 9)[:, None]
    lines = []
    for one in (first, second):
        ends = human.capsules(one.q, one.size, floor_z)
        lines.append(np.array([a + shares * (b - a) for a, b in ends]))
    radii = human.CAPSULE_RADII
    away = np.linalg.norm(lines[0][:, None, :, None] - lines[1][None, :, None], axis=-1)
    return float((away.min(axis=(2, 3)) - radii[:, None] - radii).min())


def test_a_person_who_is_added_works_beside_the_first(world: LivePickWorld, cell: Cell) -> None:
    world.apply(commands.AddPerson())
    first, second = world.snapshot().people
    assert (first.id, second.id) == (0, 1)
    assert gap(first, second, cell.floor_z) > 0.0
    after = run(world, 200)
    assert [one.mode for one in after.people] == ["auto", "auto"]
    assert not any(one.joining for one in after.people)
    assert not np.allclose(after.people[0].q[3:], after.people[1].q[3:], atol=0.1)
    assert after.people[0].q[0] < 0.0 < after.people[1].q[0]


@pytest.mark.parametrize("n", [2, 3, 4])
def test_people_stand_apart_at_the_start(world: LivePickWorld, cell: Cell, n: int) -> None:
    for _ in range(n - 1):
        world.apply(commands.AddPerson())
    world.apply(commands.Reset())
    people = world.snapshot().people
    gaps = [gap(a, b, cell.floor_z) for i, a in enumerate(people) for b in people[:i]]
    assert len(people) == n
    assert min(gaps) > 0.0


def test_people_have_stations_of_both_kinds_and_all_stations_are_assigned(cell: Cell) -> None:
    for n in (1, 2, 3, 4):
        places = [place_of(cell, k, n) for k in range(n)]
        assert all(one.stations_of("cube") and one.stations_of("dock") for one in places)
        assert {s.id for one in places for s in one.stations} == set(cell.station_ids)


def test_ids_are_constant_and_reused_after_removal(cell: Cell) -> None:
    people = LiveWorkers(cell, seed=1)
    for _ in range(2):
        people.change(commands.AddPerson())
    people.change(commands.RemovePerson(person=1))
    assert people.ids == (0, 2)
    people.change(commands.AddPerson())
    assert people.ids == (0, 1, 2)


def test_work_of_people_who_come_again_is_not_computed_again(cell: Cell) -> None:
    people, computed = LiveWorkers(cell, seed=3), []
    for _ in range(2):
        for _ in range(3):
            people.change(commands.AddPerson())
        for person in (3, 2, 1):
            people.change(commands.RemovePerson(person=person))
        computed.append(motion_library.cache_info().misses)
    assert computed[0] == computed[1]


def test_people_move_continuously_when_one_comes_or_leaves(world: LivePickWorld) -> None:
    run(world, 60)
    for command in (
        commands.AddPerson(),
        commands.AddPerson(),
        commands.RemovePerson(person=1),
    ):
        world.apply(command)
        last = {one.id: one.q for one in world.snapshot().people}
        for _ in range(60):
            now = {one.id: one.q for one in run(world, 1).people}
            assert all(np.abs(now[id] - last[id]).max() < 0.5 for id in now)
            last = now


def test_empty_cell_has_no_clearance_and_the_robot_works(world: LivePickWorld) -> None:
    world.apply(commands.RemovePerson(person=0))
    after = run(world, 100)
    assert after.people == ()
    assert (after.clearance_m, after.mode) == (None, None)
    assert after.chosen is not None
    world.apply(commands.AddPerson())
    assert run(world, 1).clearance_m is not None


def test_nearest_person_is_named_and_distances_are_those_of_each_alone(
    world: LivePickWorld, cell: Cell
) -> None:
    world.apply(commands.AddPerson())
    world.apply(commands.MovePerson(person=0, pelvis=(0.0, 2.4, -1.57)))
    snapshot = run(world, 60)
    assert [one.id for one in snapshot.people if one.nearest] == [1]
    away = [one.clearance_m for one in snapshot.people]
    assert away[1] < away[0]
    for one in snapshot.people:
        people = people_of(cell)._replace(capsules=new_body_capsules(1))
        alone = clearance(
            arm_of(cell), people, snapshot.robot_q, one.q[None], NO_CYLINDERS, one.size[None]
        )
        assert alone.people_m == pytest.approx(one.clearance_m)


def test_contact_names_the_person_who_was_touched(world: LivePickWorld) -> None:
    world.apply(commands.SetSafety(on=False))
    world.apply(commands.AddPerson())
    world.apply(commands.MovePerson(person=0, pelvis=(-0.6, 2.4, -1.57)))
    world.apply(commands.SetCandidates(ids=("cube2",)))
    world.apply(
        commands.MovePerson(person=1, pelvis=(0.0, 1.15, -1.57), right=(-0.1, 0.62, 0.2))
    )
    for _ in range(400):
        world.step()
        if (found := world.snapshot().contact) is not None:
            break
    assert found is not None
    assert (found.kind, found.person) == ("human", 1)


def test_size_glides_to_what_was_asked_for(world: LivePickWorld, cell: Cell) -> None:
    world.apply(commands.SetAnthropometry(stature=95.0, arms=90.0, shoulders=10.0))
    wanted = percentile_body(95.0, 90.0, 10.0).vector(cell.floor_z)
    sizes = [world.snapshot().people[0].size]
    for _ in range(12):
        sizes.append(run(world, 1).people[0].size)
    steps = np.abs(np.diff(sizes, axis=0)).max(axis=0)
    assert np.allclose(sizes[-1], wanted)
    assert (steps <= 0.11 * np.abs(wanted - sizes[0]) + 1e-12).all()
    body = world.snapshot().people[0].anthropometry
    assert (body.stature, body.recorded) == (95.0, False)
    assert body.stature_m == pytest.approx(1.87, abs=0.01)


def test_hands_do_not_jump_while_a_working_person_grows(world: LivePickWorld) -> None:
    run(world, 30)
    world.apply(commands.SetAnthropometry(stature=5.0))
    last = palms(world.snapshot().people[0])
    for _ in range(80):
        now = palms(run(world, 1).people[0])
        assert np.linalg.norm(now - last, axis=1).max() < 4.0 * DT
        last = now


def test_dragged_hand_stays_where_it_was_put_while_the_person_grows(
    world: LivePickWorld,
) -> None:
    target = np.array([-0.2, 0.9, 0.2])
    world.apply(commands.MovePerson(pelvis=(0.0, 1.2, -1.57), right=(-0.2, 0.9, 0.2)))
    run(world, 60)
    world.apply(commands.SetAnthropometry(stature=95.0, arms=80.0))
    assert np.linalg.norm(palms(run(world, 40).people[0])[0] - target) < 0.02


def test_size_changes_while_the_clock_stands(world: LivePickWorld) -> None:
    world.apply(commands.PauseClock())
    world.apply(commands.SetAnthropometry(stature=95.0))
    before = world.snapshot()
    after = run(world, 15)
    assert after.tick == before.tick
    assert after.people[0].size[PELVIS_Z] > before.people[0].size[PELVIS_Z] + 0.05


def test_recorded_motion_is_played_at_the_table_at_its_own_pace_and_size_of_path(
    world: LivePickWorld, cell: Cell
) -> None:
    start = play(world).people[0]
    places, yaws, times = [start.q[:2]], [], []
    while not (now := run(world, 1).people[0]).joining:
        assert now.motion is not None
        places.append(now.q[:2])
        yaws.append(now.q[2])
        times.append(now.motion.t_s)
    distances = np.linalg.norm(np.array(places) - places[0], axis=1)
    assert distances.max() == pytest.approx(0.3, abs=0.01)
    x, _, yaw = cell.human.home
    assert np.median(places, axis=0)[0] == pytest.approx(x, abs=0.02)
    assert np.min(places, axis=0)[1] == pytest.approx(cell.human.y_min, abs=0.02)
    assert np.median(yaws) == pytest.approx(yaw, abs=0.05)
    assert np.allclose(np.diff(times), DT)


def test_recorded_motion_carries_pelvis_and_lengths(world: LivePickWorld, cell: Cell) -> None:
    play(world)
    recorded_size = recorded().size.vector(cell.floor_z)
    heights = []
    for _ in range(36):
        size = run(world, 1).people[0].size
        heights.append(size[PELVIS_Z] - recorded_size[PELVIS_Z])
        assert np.allclose(size[1:], recorded_size[1:])
    assert min(heights) == pytest.approx(-0.1, abs=0.005)
    world.apply(commands.SetAnthropometry(stature=50.0))
    body = run(world, 15).people[0].anthropometry
    assert not body.recorded
    assert world.snapshot().people[0].mode == "recorded"


def test_recorded_motion_loops_without_a_jump(world: LivePickWorld) -> None:
    last = play(world, turn=5.0).people[0]
    begun = 0
    for _ in range(300):
        now = run(world, 1).people[0]
        assert np.linalg.norm(palms(now) - palms(last), axis=1).max() < 4.0 * DT
        begun += last.joining and not now.joining
        last = now
    assert begun >= 2


def test_recorded_path_that_leaves_the_area_is_reported(world: LivePickWorld) -> None:
    play(world, walk=1.0)
    seen = [run(world, 1).people[0] for _ in range(39)]
    assert seen[0].motion is not None
    assert seen[0].outside_area
    assert not seen[20].outside_area
    assert 0.2 < seen[0].motion.outside_share < 0.8


def test_body_follows_the_recording_and_policies_observe_the_limits(
    world: LivePickWorld,
) -> None:
    start = play(world, shoulder=3.5).people[0]
    assert start.motion is not None
    assert 0.05 < start.motion.clipped_share < 0.5
    assert 0.1 < start.motion.clipped_m < 0.4
    beyond = 0.0
    for _ in range(39):
        person = run(world, 1).people[0]
        assert (person.q <= human.Q_MAX + 1e-9).all()
        beyond = max(beyond, float((person.posture - human.Q_MAX)[3:].max()))
    assert beyond > 0.3
    assert play(world).people[0].motion.clipped_share == 0.0  # type: ignore[union-attr]


def test_recorded_motion_stands_while_paused(world: LivePickWorld) -> None:
    play(world)
    world.apply(commands.PauseClock())
    before = run(world, 1).people[0]
    after = run(world, 20).people[0]
    assert np.array_equal(before.q, after.q)
    assert before.motion == after.motion


def test_person_of_mode_still_goes_home_and_stays(world: LivePickWorld, cell: Cell) -> None:
    run(world, 100)
    world.apply(commands.SetMode(mode="still"))
    rest = run(world, 150).people[0]
    assert rest.q == pytest.approx(human.rest_posture(*cell.human.home), abs=0.02)
    assert np.allclose(run(world, 20).people[0].q, rest.q, atol=0.01)


def turn_clockwise(world: LivePickWorld, quarters: int) -> float:
    """Drag the first person around quarter by quarter; return the direction asked for last."""
    yaw = float(world.snapshot().people[0].q[2])
    for _ in range(quarters):
        yaw = (yaw - 0.5 * np.pi + np.pi) % (2.0 * np.pi) - np.pi
        world.apply(commands.MovePerson(pelvis=(0.0, 1.6, yaw)))
        run(world, 40)
    return yaw


@pytest.mark.parametrize("quarters", [3, 5, 9])
def test_person_is_dragged_around_any_number_of_times(
    world: LivePickWorld, quarters: int
) -> None:
    asked = turn_clockwise(world, quarters)
    error = float(world.snapshot().people[0].posture[2]) - asked
    assert np.cos(error) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("mode", ["still", "auto"])
def test_person_turns_back_by_half_a_turn_at_most(
    world: LivePickWorld, mode: commands.PlainMode
) -> None:
    turn_clockwise(world, 3)
    world.apply(commands.SetMode(mode=mode))
    yaws = [world.snapshot().people[0].posture[2]]
    while world.snapshot().people[0].joining:
        world.step()
        yaws.append(world.snapshot().people[0].posture[2])
    assert np.abs(np.diff(yaws)).sum() < np.pi + 0.5


def test_case_study_keeps_one_person_of_the_cells_size(
    world: LivePickWorld, cell: Cell
) -> None:
    world.apply(commands.SetAnthropometry(stature=95.0))
    world.apply(commands.AddPerson())
    run(world, 5)
    world.apply(commands.StartCase(id="case-1"))
    (alone,) = run(world, 1).people
    assert np.allclose(alone.size, cell.body)


@pytest.mark.parametrize(
    ("command", "field"),
    [
        (commands.SetMode(mode="auto", person=2), "person"),
        (commands.RemovePerson(person=-1), "person"),
        (commands.SetAnthropometry(stature=50.0, person=3), "person"),
        (commands.MovePerson(left=(0.0, 1.0, 0.0), person=1), "person"),
    ],
)
def test_command_that_does_not_fit_the_people_is_refused(
    world: LivePickWorld, command: Command, field: str
) -> None:
    with pytest.raises(InvalidInput) as caught:
        world.apply(command)
    assert caught.value.field == field


def test_fifth_person_is_refused(world: LivePickWorld) -> None:
    for _ in range(3):
        world.apply(commands.AddPerson())
    with pytest.raises(InvalidInput, match="people = 5 must be at most 4"):
        world.apply(commands.AddPerson())


def test_people_commands_are_refused_in_an_empty_cell(world: LivePickWorld) -> None:
    world.apply(commands.RemovePerson(person=0))
    with pytest.raises(InvalidInput, match="empty"):
        world.apply(commands.SetMode(mode="manual"))
