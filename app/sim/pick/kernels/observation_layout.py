"""Layout of the observations of the pick scenario: groups of features, and where each begins.

``app/sim/envs/pick.py`` describes the features and their units. Joints of the robot are the
first five: the sixth, which turns the tool about its axis, is at rest.
"""

from app.sim.core.observation_layout import slices_of
from app.sim.human.kernels import kinematics as body

TIME_SCALE = 10.0
"""Unit of the time left [s]."""
DISTANCE_SCALE = 0.5
"""Unit of distances [m]; they are clipped at three units."""
FARTHEST = 3.0 * DISTANCE_SCALE
"""Distance at which clearances are clipped [m]."""
PELVIS_Y = 1.25
"""Subtracted from the y of a pelvis [m]."""

SIZES = (
    ("q", 5),
    ("qd", 5),
    ("sin_q", 5),
    ("cos_q", 5),
    ("human_q", 18),
    ("human_qd", 18),
    ("tcp", 3),
    ("goal_minus_tcp", 3),
    ("tcp_velocity", 3),
    ("tool_axis", 3),
    ("hands_and_elbows", 36),
    ("hand_velocities", 6),
    ("goal_posture_minus_q", 5),
    ("base", 5),
    ("distance_tilt_clearance_time", 4),
    ("nearest_by_group", 16),
    ("look_ahead_still", 3),
    ("look_ahead_base", 3),
    ("goal_clearance", 4),
)

LAYOUT = slices_of(SIZES)
"""Slice of each group of features in the observation."""
N_FEATURES = sum(size for _, size in SIZES)
"""Length of the observation."""
BODY_SIZES = (*SIZES, ("body", body.N_SIZE))
"""Groups of the observation that includes the person's body dimensions."""
N_WITH_BODY = N_FEATURES + body.N_SIZE
"""Length of that observation."""
PHASE_SIZES = (*SIZES, ("phase", 3), ("closing", 1), ("near_clearance", 1))
"""Groups of the observation of a pick beside one person."""
N_WITH_PHASE = sum(size for _, size in PHASE_SIZES)
"""Length of that observation."""
PICK_SIZES = (
    *PHASE_SIZES,
    ("second_pelvis", 3),
    ("second_hands_and_elbows", 24),
    ("second_hand_velocities", 6),
    ("second_clearance", 1),
    ("second_look_ahead_still", 3),
    ("second_look_ahead_base", 3),
    ("second_goal_clearance", 4),
)
"""Groups of the observation of a pick beside several people."""
N_PICK = sum(size for _, size in PICK_SIZES)
"""Length of that observation."""
(PHASE, CLOSING, NEAR_CLEARANCE) = (
    slices_of(PHASE_SIZES)[name].start for name in ("phase", "closing", "near_clearance")
)
"""First index of each group of a pick."""
(PELVIS, SECOND_ARMS, SECOND_CLEARANCE) = (
    slices_of(PICK_SIZES)[name].start
    for name in ("second_pelvis", "second_hands_and_elbows", "second_clearance")
)
"""First index of each group of the second person."""
CLOSE_SCALE = 0.1
"""Unit of ``near_clearance`` [m], which is clipped at one unit."""
PRESENT_WITHIN = 4.0
"""Distance from the robot's base from which on nobody is observed as a second person [m]."""
BASE_START = LAYOUT["base"].start
"""First index of the base motion, for the residual action."""
(Q, QD, SIN_Q, COS_Q, HUMAN_Q, HUMAN_QD, TCP, TO_GOAL, TCP_VELOCITY, TOOL_AXIS) = (
    LAYOUT[name].start
    for name in (
        "q",
        "qd",
        "sin_q",
        "cos_q",
        "human_q",
        "human_qd",
        "tcp",
        "goal_minus_tcp",
        "tcp_velocity",
        "tool_axis",
    )
)
"""First index of each group of joints and tool."""
(ARMS, MOTION, SCALARS, NEAREST, STILL_AHEAD, AT_GOAL_AHEAD) = (
    LAYOUT[name].start
    for name in (
        "hands_and_elbows",
        "goal_posture_minus_q",
        "distance_tilt_clearance_time",
        "nearest_by_group",
        "look_ahead_still",
        "goal_clearance",
    )
)
"""First index of each other group."""
