"""Clearances and speeds of a state that a client sends, before a motion decision (compiled)."""

from app.sim.collision.kernels.contact import clearances
from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.capsules import copy_rows
from app.sim.people.kernels.people import person_clearance, place_people
from app.sim.people.kernels.speeds import capsule_speeds
from app.sim.reach.kernels.episode import ReachCell
from app.sim.reach.kernels.observation_workspace import ReachObservationWorkspace
from app.sim.reach.kernels.queries import place
from app.sim.scenario.kernels.episode import EpisodeState


@kernel(nogil=True)
def load_state(
    world: ReachCell,
    state: EpisodeState,
    work: ReachObservationWorkspace,
    distances: Vec,
    speeds: Vec,
) -> None:
    """Place robot and people of environment 0; write clearances and speeds of people.

    Args:
        state: Environments; ``clear`` is filled.
        work: Work space; robot and people are placed.
        distances: Filled with the distance of the robot to each person [m]: workers first, then
            pedestrians, shape (n_people,).
        speeds: Filled with the speeds of the workers' capsules [m/s], shape (n,).
    """
    place(world, state, 0, work)
    people, geometry, capsules = state.people, work.geometry, state.people.capsules[0]
    copy_rows(geometry.capsules, capsules)
    capsule_speeds(world.people, people.q[0], people.qd[0], capsules, geometry, speeds)
    place_people(world.people, people, 0, geometry)
    clear = clearances(world.arm, world.people, work.robot, work.geometry)
    state.clear[0, 0], state.clear[0, 1], state.clear[0, 2] = clear
    for p in range(distances.shape[0]):
        distances[p] = person_clearance(world.people, work.robot.capsules, work.geometry, p)
