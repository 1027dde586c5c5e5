"""The second person of an observation of the pick scenario (compiled)."""

import math

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.human.kernels import kinematics as body
from app.sim.pick.kernels.observation_layout import (
    PELVIS,
    PELVIS_Y,
    PRESENT_WITHIN,
    SECOND_ARMS,
)
from app.sim.pick.kernels.observation_workspace import PickObservationWorkspace, PickQuery
from app.sim.scenario.kernels.person_observation import (
    TICK,
    Obs,
    PersonWorkspace,
    place_person,
)


@kernel(inline="always")
def place_second(floor_z: float, state: PickQuery, work: PickObservationWorkspace) -> int:
    """Place the second person; return the number of that person, 0 where there is none.

    Of the people after the first it is the one with a hand or the pelvis nearest to the target.
    """
    second, goal, person = 0, state.goal, work.second
    best, placed = PRESENT_WITHIN, 0
    for w in range(1, state.human_q.shape[0]):
        x, y = state.human_q[w, 0], state.human_q[w, 1]
        if math.hypot(x, y) >= PRESENT_WITHIN:
            continue
        place_person(floor_z, state.human_q[w], state.human_qd[w], state.size[w], person)
        placed = w
        distance = math.hypot(x - goal[0], y - goal[1])
        for point in (body.HAND_R, body.HAND_L):
            dx = person.points[point, 0] - goal[0]
            dy = person.points[point, 1] - goal[1]
            distance = min(distance, math.hypot(dx, dy))
        if second == 0 or distance < best:
            best, second = distance, w
    if second != placed:
        q, qd = state.human_q[second], state.human_qd[second]
        place_person(floor_z, q, qd, state.size[second], person)
    return second


@kernel(inline="always")
def write_second(q: Vec, goal: Vec, tcp: Vec, person: PersonWorkspace, out: Obs) -> None:
    """Write position, arms and hand velocities of the second person."""
    k = SECOND_ARMS
    out[PELVIS], out[PELVIS + 1] = q[0], q[1] - PELVIS_Y
    out[PELVIS + 2] = (q[2] + 1.5 * math.pi) % (2.0 * math.pi) - math.pi
    for point in (body.HAND_R, body.HAND_L, body.ELBOW_R, body.ELBOW_L):
        for i in range(3):
            out[k + i] = person.points[point, i] - tcp[i]
            out[k + 3 + i] = person.points[point, i] - goal[i]
        k += 6
    for point in (body.HAND_R, body.HAND_L):
        for i in range(3):
            out[k + i] = (person.points_later[point, i] - person.points[point, i]) / TICK
        k += 3
