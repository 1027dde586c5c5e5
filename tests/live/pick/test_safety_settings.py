from app.live import commands
from app.live.pick.world import LivePickWorld
from tests.live.pick.test_world import run, world

__all__ = ["world"]


def test_layer_starts_with_the_settings_of_the_cell_and_takes_others(
    world: LivePickWorld,
) -> None:
    world.apply(commands.MovePerson(pelvis=(0.3, 1.6, -1.57)))
    before = run(world, 60).safety
    assert (before.on, before.pfl, before.protective_distance) == (True, False, 0.0)
    world.apply(commands.PauseClock())
    world.apply(
        commands.SetSafety(
            on=True, protective_distance=0.3, human_speed=2.0, reaction_time=0.2, pfl=True
        )
    )
    after = world.snapshot().safety
    assert (after.protective_distance, after.margin) == (0.3, 0.3)
    assert (after.human_speed, after.reaction_time, after.pfl) == (2.0, 0.2, True)
    assert after.required > before.required + 0.3
    world.apply(commands.SetSafety(on=False))
    world.apply(commands.SetSafety(protective_distance=0.2))
    off = world.snapshot().safety
    assert (off.on, off.override, off.protective_distance) == (False, 1.0, 0.2)


def test_settings_that_change_in_a_case_study_do_not_disable_the_layer(
    world: LivePickWorld,
) -> None:
    world.apply(commands.StartCase(id="case-1"))
    assert not world.snapshot().safety.on
    world.apply(commands.SetSafety(protective_distance=0.3))
    assert not world.snapshot().safety.on
    world.apply(commands.SetCandidates(ids=("cube1",)))
    safety = world.snapshot().safety
    assert (safety.on, safety.protective_distance) == (True, 0.3)
