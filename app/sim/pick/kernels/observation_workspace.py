"""Query and work space of the observations of the pick scenario (compiled)."""

from typing import Any, NamedTuple

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.capsules import new_capsules, padded_size
from app.sim.human.kernels import kinematics as body
from app.sim.people.kernels.people import MAX_PEOPLE
from app.sim.prediction.kernels.worker import WorkerPredictor, predict_worker
from app.sim.scenario.kernels.person_observation import (
    HORIZONS,
    PersonWorkspace,
    new_person_workspace,
    place_person,
    place_predicted,
)

STANDARD_TOOL = (0.12, 0.04)
"""Length from flange to tcp and radius of the tool of the last coarse capsule below [m]."""
UPPER_ARM, FOREARM, WRIST_1, WRIST_2, WRIST_3 = 0.612, 0.57, 0.115, 0.116, 0.17
"""Lengths of the segments of the coarse capsules of the UR10 [m]: ``LinkLengths`` (0.612,
0.5723, 0.1149, 0.1157; wrist 3: flange 0.0922, and tool less its radius 0.08), rounded.

They are inputs of trained policies, therefore constants of their own; a test compares them with
the model of the robot."""
UPPER_ARM_Y = -0.045
"""Lateral offset of the axis of the upper arm's tube [m], as in ``ur10_capsules.json``."""
COARSE_LINK = np.array([2, 3, 4, 5, 6], dtype=np.int64)
"""Link of each coarse capsule: the robot from the upper arm to the tool, simplified for
features. Contacts use the capsules of ``robot/data/ur10_capsules.json``."""
COARSE_P0 = np.array(
    [
        [0.0, UPPER_ARM_Y, 0.0],
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0],
    ]
)
"""First end of each segment in the link's frame [m], shape (N_COARSE, 3)."""
COARSE_SPAN = np.array(
    [
        [0.0, 0.0, UPPER_ARM],
        [0.0, 0.0, FOREARM],
        [0.0, WRIST_1, 0.0],
        [0.0, 0.0, WRIST_2],
        [0.0, WRIST_3, 0.0],
    ]
)
"""Second end minus first end in that frame [m], for the standard tool, shape (N_COARSE, 3)."""
COARSE_RADIUS = np.array([0.09, 0.075, 0.066, 0.066, 0.045])
"""Radius of each [m], for the standard tool, shape (N_COARSE,): between the least and the
greatest radius of the link's capsules in ``ur10_capsules.json``, or within 1 mm of it."""
COARSE_FIRST = (0, 1, 2, 4, 5)
"""First coarse capsule of each of four groups of links (upper arm, forearm, wrists 1 and 2,
wrist 3 with the tool), and the number of capsules."""
N_COARSE = 5
AT_GOAL, ALONG_BASE, STILL = 0, N_COARSE, 2 * N_COARSE
"""First lane of three robot configurations that are evaluated together: at the goal, along the
base motion, now. A lane is one coarse capsule in one configuration."""
N_LANES = padded_size(3 * N_COARSE)
"""Number of lanes, padded to whole vectors."""
GOAL_LANES = 8
"""Number of lanes that covers the first of them in whole vectors."""
FIRST_PART, LAST_PART = body.C_ABDOMEN, body.C_HAND_L
"""First and last human capsule used by the features: those above the table."""


class PickQuery(NamedTuple):
    """A state of robot, people and target; or n states, with a leading axis of n."""

    q: Vec
    """Joint positions [rad], shape (6,)."""
    qd: Vec
    """Joint speeds [rad/s], shape (6,)."""
    human_q: Vec
    """Joint positions of P people, the nearest first [m, rad], shape (P, 18)."""
    human_qd: Vec
    """Their joint speeds [m/s, rad/s], shape (P, 18)."""
    size: Vec
    """Their body dimensions [m], shape (P, body.N_SIZE)."""
    goal: Vec
    """Target of the tcp in this phase [m], shape (3,)."""
    q_goal: Vec
    """Vertical-tool configuration at the target [rad], shape (6,)."""
    q_grasp: Vec
    """The same at the object [rad], shape (6,); that at the target where nothing is grasped."""
    phase: Any
    """Phase of the pick (``grasp.py``), 0 where nothing is grasped."""
    closing: Any
    """Share of the closing time that has passed, 0 to 1."""


@kernel(inline="always")
def query_at(states: PickQuery, i: int) -> PickQuery:
    """Return state ``i`` of n states."""
    return PickQuery(
        states.q[i],
        states.qd[i],
        states.human_q[i],
        states.human_qd[i],
        states.size[i],
        states.goal[i],
        states.q_goal[i],
        states.q_grasp[i],
        states.phase[i],
        states.closing[i],
    )


class PickObservationWorkspace(NamedTuple):
    """Work space of one observation."""

    person: PersonWorkspace
    """The first person, now and extrapolated."""
    second: PersonWorkspace
    """The second person, likewise."""
    far: PersonWorkspace
    """The person far away who is observed where there is no second one."""
    span: Vec
    """Second end minus first end of each coarse capsule in the link's frame [m], shape
    (N_COARSE, 3)."""
    lanes: Vec
    """Coarse capsules of the robot in three configurations, shape (9, N_LANES)."""
    clearance: Vec
    """Clearance of the person to the coarse capsule of each lane [m], shape (N_LANES,)."""
    part: Vec
    """Number of the person's capsule nearest to each lane, shape (N_LANES,)."""
    rot: Vec
    """R_world_link of another configuration, shape (7, 3, 3)."""
    pos: Vec
    """Origins of its links [m], shape (7, 3)."""
    q: Vec
    """Its joints [rad], shape (6,)."""
    base: Vec
    """The base motion as speeds relative to the joints' limits, in [-1, 1], shape (6,)."""
    to_person: Vec
    """Vector from the axis of a coarse capsule to that of a human capsule [m], shape (3,)."""
    human_q: Vec
    """Joint positions of the people [m, rad], shape (MAX_PEOPLE, 18)."""
    human_qd: Vec
    """Their joint speeds [m/s, rad/s], shape (MAX_PEOPLE, 18)."""
    human_size: Vec
    """Their body dimensions [m], shape (MAX_PEOPLE, body.N_SIZE)."""
    point: Vec
    """Target of the tcp in the present phase [m], shape (3,)."""
    predictor: WorkerPredictor
    """Predicts the motion of the observed people in picks."""
    predicted: Vec
    """Predicted joint positions of one person at ``HORIZONS`` [m, rad], shape (3, 18)."""
    ahead: Vec
    """Predicted capsules of both people at ``HORIZONS``, the first one first, (2, 3, 9, 16)."""
    known: Vec
    """Joints [m, rad], joint speeds [m/s, rad/s] and body dimensions [m] to which ``ahead``
    belongs, shape (2, 36 + body.N_SIZE)."""


def coarse_capsules(tool_length: float, tool_radius: float) -> tuple[Vec, Vec]:
    """Return spans [m], shape (N_COARSE, 3), and radii [m], shape (N_COARSE,), with a tool.

    The last capsule ends as far beyond the tool's segment as for the standard tool, and is as
    much wider than the tool.

    Args:
        tool_length: Distance from flange to tcp [m].
        tool_radius: Radius of the tool [m].
    """
    length, radius = STANDARD_TOOL
    span, radii = COARSE_SPAN.copy(), COARSE_RADIUS.copy()
    span[-1, 1] += max(tool_length - tool_radius, 0.0) - (length - radius)
    radii[-1] += tool_radius - radius
    return span, radii


def new_pick_observation_workspace(
    floor_z: float,
    far_q: Vec,
    far_size: Vec,
    predictor: WorkerPredictor,
    tool: tuple[float, float],
) -> PickObservationWorkspace:
    """Return work space for one observation at a time.

    Args:
        floor_z: Height of the floor [m].
        far_q: Joint positions of the person far away [m, rad], shape (18,).
        far_size: Body dimensions of that person [m], shape (body.N_SIZE,).
        predictor: Motion predictor; its work space becomes part of this one.
        tool: Length from flange to tcp and radius of the tool [m].
    """
    span, radius = coarse_capsules(*tool)
    far = new_person_workspace()
    place_person(floor_z, far_q, np.zeros(18), far_size, far)
    return PickObservationWorkspace(
        person=new_person_workspace(),
        second=new_person_workspace(),
        far=far,
        span=span,
        lanes=new_capsules(N_LANES, np.tile(radius, 3), np.tile((span**2).sum(axis=1), 3)),
        clearance=np.zeros(N_LANES),
        part=np.zeros(N_LANES),
        rot=np.zeros((7, 3, 3)),
        pos=np.zeros((7, 3)),
        q=np.zeros(6),
        base=np.zeros(6),
        to_person=np.zeros(3),
        human_q=np.zeros((MAX_PEOPLE, 18)),
        human_qd=np.zeros((MAX_PEOPLE, 18)),
        human_size=np.zeros((MAX_PEOPLE, body.N_SIZE)),
        point=np.zeros(3),
        predictor=predictor,
        predicted=np.zeros((len(HORIZONS), 18)),
        ahead=np.tile(body.new_body_capsules(1), (2, len(HORIZONS), 1, 1)),
        known=np.full((2, 36 + body.N_SIZE), np.nan),
    )


@kernel()
def predict_person(
    floor_z: float, q: Vec, qd: Vec, size: Vec, who: int, work: PickObservationWorkspace
) -> None:
    """Place the capsules of a person predicted at ``HORIZONS``, unless the last call did.

    Args:
        floor_z: Height of the floor [m].
        q: The person's joint positions [m, rad], shape (18,).
        qd: The person's joint speeds [m/s, rad/s], shape (18,).
        size: The person's body dimensions [m], shape (body.N_SIZE,).
        who: 0 for the first person, 1 for the second.
        work: ``ahead[who]`` is written; the points of ``second`` are overwritten, those of
            ``person`` are needed for all candidates.
    """
    known, same = work.known[who], True
    for j in range(18):
        same = same and known[j] == q[j] and known[18 + j] == qd[j]
    for j in range(body.N_SIZE):
        same = same and known[36 + j] == size[j]
    if same:
        return
    for j in range(18):
        known[j], known[18 + j] = q[j], qd[j]
    for j in range(body.N_SIZE):
        known[36 + j] = size[j]
    predict_worker(work.predictor, q, qd, work.predicted)
    for i in range(3):
        place_predicted(floor_z, work.predicted[i], size, work.second, work.ahead[who, i])
