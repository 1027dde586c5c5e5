"""Inverse kinematics from joint centres to the 18 angles, in closed form.

Yaw from the hip line (shoulder line without legs); abdomen from the torso's frame after yaw,
relative to the rest pose; clavicles from azimuth and elevation of neck -> shoulder in that
frame; shoulders from the upper arm and the plane of the elbow; elbows from their bend. The
plane of the elbow is interpolated where the bend is below 5 degrees and low-passed at 6 Hz; it
is the only source of error for the recorded body size. The pelvis is placed so that the neck
position is exact: the bend of a recorded spine displaces the pelvis, not the hands.

Joint orientations in a file are not used, except for the rest pose, so that skeletons with
other conventions of axes give the same angles.

Source: docs/method.md 3.4.
"""

import numpy as np
import scipy  # loads a subpackage where it is first used: scipy.signal takes a second

from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.human.anthropometry import BodySize
from app.sim.human.kernels import joint_angles
from app.sim.human.model import Q_MAX, Q_MIN
from app.sim.mocap.bvh import axis_turns
from app.sim.mocap.joint_centres import (
    NECK,
    PELVIS,
    SHOULDER_L,
    SHOULDER_R,
    BodyTrack,
    trunk_frame,
    unit,
)

MIN_BEND = np.radians(5.0)
"""Least bend of the elbow at which its plane is used [rad]."""
CUTOFF_HZ = 6.0
"""Cut-off frequency of the elbow's plane, usual for arm movements in biomechanics."""
_TURN_WEIGHT = 5.0
"""Weight of rotation relative to excess over limits in the choice of shoulder triples."""


def body_angles(track: BodyTrack, size: BodySize) -> tuple[Vec, Vec]:
    """Return joint positions and the height of the pelvis.

    Args:
        track: Joint centres of one clean run, at least two frames.
        size: The person's lengths.

    Returns:
        Joint positions [m, rad], shape (n, 18), continuous and not clipped to joint limits;
        and the pelvis's height in the track's frame [m], shape (n,).
    """
    q = np.zeros((len(track.times), 18))
    across = track.points[:, SHOULDER_L] - track.points[:, SHOULDER_R]
    q[:, 2] = _heading(across if track.hips is None else track.hips)
    points = track.points
    torso = trunk_frame(points[:, PELVIS], points[:, NECK], across) @ track.upright.T
    q[:, 3:6] = euler_angles(axis_turns(2, -q[:, 2]) @ torso)
    pelvis = points[:, NECK] - size.trunk * torso[:, :, 2]
    q[:, :2] = pelvis[:, :2]
    rate_hz = 1.0 / float(np.median(np.diff(track.times)))
    for side, shoulder, clavicle, arm in ((-1.0, SHOULDER_R, 6, 10), (1.0, SHOULDER_L, 8, 14)):
        inside = np.einsum("nji,nkj->nki", torso, _segments(points, shoulder))
        protract = np.empty((len(q), 2))
        joint_angles.clavicles_to_angles(as_kernel_array(inside[:, 0]), side, protract)
        q[:, clavicle : clavicle + 2] = protract
        q[:, arm : arm + 4] = _arm(inside[:, 1], inside[:, 2], side, rate_hz, arm)
    return q, pelvis[:, 2]


def euler_angles(turns: Vec) -> Vec:
    """Return a, b, c [rad] of ``Ry(a) Rx(b) Rz(c)``, shape (n, 3), ``|b| <= pi/2``."""
    angles = np.empty((len(turns), 3))
    joint_angles.turns_to_angles(as_kernel_array(turns), angles)
    angles[:, ::2] = np.unwrap(angles[:, ::2], axis=0)
    return angles


def _heading(across: Vec) -> Vec:
    """Return the yaw [rad] of a line to the left; interpolated where it is nearly vertical."""
    level = np.linalg.norm(across[:, :2], axis=1)
    good = level > 0.2 * np.linalg.norm(across, axis=1)
    if not good.any():
        good[:] = True
    yaw = np.unwrap(joint_angles.headings(across[good]))
    yaw -= 2.0 * np.pi * np.round(yaw[0] / (2.0 * np.pi))
    frames = np.arange(len(across))
    return np.asarray(np.interp(frames, frames[good], yaw))


def _segments(points: Vec, shoulder: int) -> Vec:
    """Return directions of clavicle, upper arm and forearm, shape (n, 3, 3)."""
    chain = points[:, [NECK, shoulder, shoulder + 1, shoulder + 2]]
    return unit(np.diff(chain, axis=1))


def _arm(upper: Vec, fore: Vec, side: float, rate_hz: float, first: int) -> Vec:
    """Return flexion, abduction, rotation and bend [rad], shape (n, 4).

    Args:
        upper: Direction of the upper arm in the torso, shape (n, 3).
        fore: Direction of the forearm in the torso, shape (n, 3).
        side: -1 right, 1 left.
        rate_hz: Frames per second.
        first: Index of the flexion among the 18 joints.
    """
    bend = np.arctan2(
        np.linalg.norm(np.cross(upper, fore), axis=1), np.einsum("ni,ni->n", upper, fore)
    )
    toward = np.cross(_elbow_normal(upper, fore, bend, rate_hz), upper)
    shoulder = np.empty((len(bend), 3))
    joint_angles.arms_to_angles(as_kernel_array(upper), as_kernel_array(toward), side, shoulder)
    return np.column_stack([one_branch(shoulder, first), bend])


def _elbow_normal(upper: Vec, fore: Vec, bend: Vec, rate_hz: float) -> Vec:
    """Return the normal of the elbow's plane, shape (n, 3), interpolated and low-passed.

    ``upper x fore`` has the length sin(bend), so frames with a better known plane weigh more.
    """
    normal = np.cross(upper, fore)
    sure = np.sin(bend) >= np.sin(MIN_BEND)
    if not sure.any():
        # Straight arm in all frames: elbow axis of an arm hanging at the side.
        return np.cross(upper, np.cross(np.array([0.0, -1.0, 0.0]), upper))
    frames = np.arange(len(normal))
    directions = unit(normal[sure])
    for axis in range(3):
        held = np.interp(frames, frames[sure], directions[:, axis]) * np.sin(MIN_BEND)
        normal[~sure, axis] = held[~sure]
    if rate_hz > 2.5 * CUTOFF_HZ and len(normal) > 12:
        low_pass = scipy.signal.butter(2, CUTOFF_HZ, fs=rate_hz, output="sos")
        normal = scipy.signal.sosfiltfilt(
            low_pass, normal, axis=0, padlen=min(9, len(normal) - 1)
        )
    return normal


def one_branch(angles: Vec, first: int) -> Vec:
    """Return the same shoulder orientations, shape (n, 3), as continuous angles.

    (flex, abduct, rotate) and (flex + pi, pi - abduct, rotate + pi) are one orientation.
    Dynamic programming finds the path of least rotation and least excess over the limits.
    """
    low, high = Q_MIN[first : first + 3], Q_MAX[first : first + 3]
    other = wrapped(angles * np.array([1.0, -1.0, 1.0]) + np.pi)
    both = np.stack([wrapped(angles), other], axis=1)
    excess = (np.maximum(low - both, 0.0) + np.maximum(both - high, 0.0)).sum(axis=2)
    turn = np.abs(wrapped(both[1:, None, :, :] - both[:-1, :, None, :])).sum(axis=3)
    chosen = _cheapest(excess.tolist(), (_TURN_WEIGHT * turn).tolist())
    path = np.unwrap(both[np.arange(len(both)), chosen], axis=0)
    rounds = np.round(np.median(path - (low + high) / 2.0, axis=0) / (2.0 * np.pi))
    return np.asarray(path - 2.0 * np.pi * rounds)


def _cheapest(nodes: list[list[float]], edges: list[list[list[float]]]) -> list[int]:
    """Return the cheapest path through two states (Viterbi).

    Args:
        nodes: Cost of each state at each frame, n times 2.
        edges: Cost from state i to state j between frames, n - 1 times 2 times 2.
    """
    a, b = nodes[0]
    back: list[tuple[bool, bool]] = []
    for (cost_a, cost_b), ((aa, ab), (ba, bb)) in zip(nodes[1:], edges, strict=True):
        from_b = (b + ba < a + aa, b + bb < a + ab)
        back.append(from_b)
        a, b = cost_a + min(a + aa, b + ba), cost_b + min(a + ab, b + bb)
    state = int(b < a)
    states = [state]
    for from_b in reversed(back):
        state = int(from_b[state])
        states.append(state)
    return states[::-1]


def wrapped(angle: Vec) -> Vec:
    """Return angles [rad] in [-pi, pi)."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)
