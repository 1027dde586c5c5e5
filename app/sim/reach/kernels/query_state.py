"""Distances of a state that somebody tells, before a decision, compiled."""

from app.sim.collision.kernels.contact import clearances
from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.capsules import capsule_clearances
from app.sim.people.kernels.people import person_clearance, place_people
from app.sim.reach.kernels.episode import ReachState, ReachWorld, Work
from app.sim.robot.kernels.arm import place_robot


@kernel(nogil=True)
def take_in(world: ReachWorld, state: ReachState, work: Work, apart: Vec) -> None:
    """Place robot and people of row 0 and write its distances.

    Args:
        world: Shared data.
        state: Rows; q and people are given, ``clear`` is filled.
        work: Work space; placed.
        apart: Filled with the distance of the robot to each person [m]: workers first, then
            walkers, shape (n_people,).
    """
    place_robot(world.arm, state.q[0], work.robot)
    place_people(world.people, state.people, 0, work.crowd)
    clear = clearances(world.arm, world.people, work.robot, work.crowd)
    state.clear[0, 0], state.clear[0, 1], state.clear[0, 2] = clear
    if state.people.q.shape[1] > 0:
        capsule_clearances(work.robot.columns, work.crowd.columns, work.crowd.gap)
    for who in range(apart.shape[0]):
        apart[who] = person_clearance(world.people, work.robot.columns, work.crowd, who)
