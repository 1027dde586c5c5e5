"""Everybody in the cell as a set, for networks that take one, compiled.

Behind an observation stand MAX_PEOPLE blocks of equal form, one for each person, in no order
that means anything; a block of nobody is zero. A network looks at each block by the same
weights and pools what it finds (``app/policies/networks/actor_critic.py``).

Source: Zaheer et al., *Deep sets* (2017), for the form; the thesis sees one person (4.30).
"""

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.observation_layout import slices_of
from app.sim.geometry.cylinder import cylinder_clearance
from app.sim.people.kernels.people import MAX_PEOPLE
from app.sim.reach.kernels.observation import Obs
from app.sim.reach.kernels.option_features import Ways
from app.sim.robot.kernels.arm import RobotPose

LOOKS = (3, 6, 12, 24)
"""When it is said where somebody will be, in steps of the forecast."""
SCALE = 0.5
"""Clearances are given in units of this and cut at three units [m]."""
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
"""Names and sizes of what a block says: positions [m] relative to tcp, elbow and goal, speed
[m/s], radius [m], distance to the robot; then for each time ahead position relative to the tcp
and radius."""
BLOCK = slices_of(FORM)
"""Slice of each in a block."""
N_BLOCK = sum(size for _, size in FORM)
"""Length of a block."""
SIZES = (("crowd", MAX_PEOPLE * N_BLOCK),)
"""Name and size of the group of features."""
N_CROWD = MAX_PEOPLE * N_BLOCK
_AHEAD = BLOCK["ahead"].start


@kernel()
def put_crowd(top_z: float, goal: Vec, robot: RobotPose, ways: Ways, k: int, out: Obs) -> None:
    """Write all blocks from ``out[k]`` on; people are foreseen already.

    Args:
        top_z: Height of people's tops [m].
        goal: Where the tcp shall be [m], shape (3,).
        robot: The robot, placed.
        ways: Who counts, where they are and where they will be.
        k: Where to begin.
        out: Filled, shape (>= k + N_CROWD,).
    """
    tcp, elbow = robot.tcp, robot.pos[3]
    for i in range(k, k + N_CROWD):
        out[i] = 0.0
    for p in range(ways.number[0]):
        seen, b = ways.now[p], k + p * N_BLOCK
        out[b] = 1.0
        for i in range(2):
            out[b + 1 + i] = seen[i] - tcp[i]
            out[b + 3 + i] = seen[i] - elbow[i]
            out[b + 5 + i] = seen[i] - goal[i]
            out[b + 7 + i] = seen[2 + i]
        out[b + 9] = seen[4]
        d, _ = cylinder_clearance(robot.columns, 0, seen[0], seen[1], seen[4], top_z)
        out[b + 10] = min(3.0, d / SCALE)
        for i in range(len(LOOKS)):
            step, c = LOOKS[i] - 1, b + _AHEAD + 3 * i
            out[c] = ways.ahead[step, p, 0] - tcp[0]
            out[c + 1] = ways.ahead[step, p, 1] - tcp[1]
            out[c + 2] = ways.ahead[step, p, 2]
