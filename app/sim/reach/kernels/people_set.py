"""People of the cell as a set, for networks that take a set (compiled).

``MAX_PEOPLE`` blocks of equal form follow the observation, one for each person, in arbitrary
order; the block of an absent person is zero. A network evaluates each block with the same
weights and pools the results (``app/policies/networks/actor_critic.py``).

Source: Zaheer et al., *Deep sets* (2017); the thesis observes one person (4.30).
"""

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.observation_layout import slices_of
from app.sim.geometry.cylinder import cylinder_clearance
from app.sim.people.kernels.people import MAX_PEOPLE
from app.sim.reach.kernels.observation_workspace import ReachObservationWorkspace
from app.sim.scenario.kernels.person_observation import Obs

LOOKS = (3, 6, 12, 24)
"""Times of the predicted positions, in steps of the prediction."""
SCALE = 0.5
"""Unit of clearances [m]; they are clipped at three units."""
FORM = (
    ("present", 1),
    ("minus_tcp", 2),
    ("minus_elbow", 2),
    ("minus_goal", 2),
    ("velocity", 2),
    ("radius", 1),
    ("clearance", 1),
    ("ahead", 3 * len(LOOKS)),
)
"""Names and sizes of the entries of a block: positions relative to tcp, elbow and goal [m],
velocity [m/s], radius [m], clearance; and for each time position relative to the tcp and radius
[m]."""
BLOCK = slices_of(FORM)
"""Slice of each entry in a block."""
N_BLOCK = sum(size for _, size in FORM)
"""Length of a block."""
N_PEOPLE_SET = MAX_PEOPLE * N_BLOCK
SIZES = (("people_set", N_PEOPLE_SET),)
"""Name and size of the group of features."""
_AHEAD = BLOCK["ahead"].start


@kernel()
def write_people_set(
    top_z: float, goal: Vec, work: ReachObservationWorkspace, k: int, out: Obs
) -> None:
    """Write all blocks from ``out[k]`` on.

    Args:
        top_z: Height of people's tops [m].
        goal: Goal of the tcp [m], shape (3,).
        work: Holds the placed robot and the predicted people.
        k: Index of the first feature.
        out: Filled, shape (>= k + N_PEOPLE_SET,).
    """
    robot, predicted = work.robot, work.predicted
    tcp, elbow = robot.tcp, robot.pos[3]
    for i in range(k, k + N_PEOPLE_SET):
        out[i] = 0.0
    for p in range(work.n[0]):
        person, b = work.people[p], k + p * N_BLOCK
        out[b] = 1.0
        for i in range(2):
            out[b + 1 + i] = person[i] - tcp[i]
            out[b + 3 + i] = person[i] - elbow[i]
            out[b + 5 + i] = person[i] - goal[i]
            out[b + 7 + i] = person[2 + i]
        out[b + 9] = person[4]
        d, _ = cylinder_clearance(robot.capsules, 0, person[0], person[1], person[4], top_z)
        out[b + 10] = min(3.0, d / SCALE)
        for i in range(len(LOOKS)):
            step, c = LOOKS[i] - 1, b + _AHEAD + 3 * i
            out[c] = predicted[step, p, 0] - tcp[0]
            out[c + 1] = predicted[step, p, 1] - tcp[1]
            out[c + 2] = predicted[step, p, 2]
