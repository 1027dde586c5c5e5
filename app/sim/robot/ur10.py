"""The UR10 on Pinocchio: the model from which the compiled kernels take their lengths.

The model is example-robot-data's ``ur10_robot.urdf`` with a tool along ``tool0``'s z axis; the
tcp is its tip. Create one :class:`Robot` per thread: Pinocchio's data objects are not shared.
"""

import math
from pathlib import Path

import numpy as np
import pinocchio as pin

from app.sim.core.arrays import Vec
from app.sim.robot.kernels import kinematics
from app.sim.robot.kernels.joints import JointLimits

LINK_NAMES = (
    "base_link",
    "shoulder_link",
    "upper_arm_link",
    "forearm_link",
    "wrist_1_link",
    "wrist_2_link",
    "wrist_3_link",
)
JOINT_NAMES = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")


def package_dir() -> Path:
    """Return the folder that ``package://example-robot-data`` paths are relative to.

    Raises:
        FileNotFoundError: example-robot-data is not installed beside Pinocchio.
    """
    for parent in Path(pin.__file__).resolve().parents:
        share = parent / "share"
        if (share / "example-robot-data").is_dir():
            return share
    raise FileNotFoundError(
        f"no share/example-robot-data above {pin.__file__}: pip install example-robot-data"
    )


def urdf_path() -> Path:
    """Return the UR10's URDF."""
    return package_dir() / "example-robot-data/robots/ur_description/urdf/ur10_robot.urdf"


def reach_of(lengths: kinematics.LinkLengths) -> tuple[Vec, float]:
    """Return centre [m], shape (3,), and radius [m] of the sphere that the tcp can reach.

    The tcp lies on it where the elbow is straight and the line from wrist 2 to the tcp points
    away from the shoulder; joint limits and collisions are not considered.
    """
    lateral = lengths.shoulder_offset + lengths.elbow_offset + lengths.wrist_1_offset
    arm = math.hypot(lengths.upper_arm + lengths.forearm, lateral)
    hand = math.hypot(lengths.wrist_2_length, lengths.flange + lengths.tool)
    return np.array([0.0, 0.0, lengths.base_height]), arm + hand


class Robot:
    """Kinematics of the UR10 with a tool, by Pinocchio; not thread-safe.

    Args:
        tool_length: From flange to tcp [m].
    """

    def __init__(self, tool_length: float = 0.12) -> None:
        self.tool_length = tool_length
        self.model = pin.buildModelFromUrdf(str(urdf_path()))
        tool0 = self.model.frames[self.model.getFrameId("tool0")]
        placement = tool0.placement * pin.SE3(np.eye(3), np.array([0.0, 0.0, tool_length]))
        self._tcp = self.model.addFrame(
            pin.Frame("tcp", tool0.parentJoint, placement, pin.FrameType.OP_FRAME)
        )
        self._links = [self.model.getFrameId(name) for name in LINK_NAMES]
        self.data = self.model.createData()

    def lengths(self) -> kinematics.LinkLengths:
        """Return the lengths of links and tool that the kernels need, from the model.

        Raises:
            ValueError: The model is not a robot of the UR family.
        """
        names = [joint.shortname().removeprefix("JointModel") for joint in self.model.joints]
        at = [placement.translation for placement in self.model.jointPlacements]
        tool0 = self.model.frames[self.model.getFrameId("tool0")].placement.translation
        used = ((2,), (1,), (1, 2), (2,), (1,), (2,), (1,))
        rest = [np.delete(one, axes) for one, axes in zip([*at[1:], tool0], used, strict=True)]
        if names[1:] != ["RZ", "RY", "RY", "RY", "RZ", "RY"] or np.concatenate(rest).any():
            raise ValueError(f"{self.model.name} must have the joints of the UR family")
        return kinematics.LinkLengths(
            base_height=float(at[1][2]),
            shoulder_offset=float(at[2][1]),
            elbow_offset=float(at[3][1]),
            upper_arm=float(at[3][2]),
            forearm=float(at[4][2]),
            wrist_1_offset=float(at[5][1]),
            wrist_2_length=float(at[6][2]),
            flange=float(tool0[1]),
            tool=float(self.tool_length),
        )

    def link_poses(self, q: Vec) -> Vec:
        """Return T_world_link of base and six links, shape (7, 4, 4)."""
        pin.framesForwardKinematics(self.model, self.data, q)
        return np.stack([self.data.oMf[frame].homogeneous for frame in self._links])

    def tcp_pose(self, q: Vec) -> Vec:
        """Return T_world_tcp, shape (4, 4); its z axis is the tool's direction."""
        pin.framesForwardKinematics(self.model, self.data, q)
        return np.array(self.data.oMf[self._tcp].homogeneous)

    def jacobian(self, q: Vec) -> Vec:
        """Return the tcp's Jacobian in world axes, rows v (3) then omega (3), shape (6, 6)."""
        pin.computeJointJacobians(self.model, self.data, q)
        pin.updateFramePlacements(self.model, self.data)
        return np.array(
            pin.getFrameJacobian(
                self.model, self.data, self._tcp, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            )
        )

    def ik_vertical(self, position: Vec, q_min: Vec, q_max: Vec) -> Vec | None:
        """Return the configuration with the tool pointing down at ``position``.

        Args:
            position: Position of the tcp [m], shape (3,).
            q_min: Lower joint limits [rad], shape (6,).
            q_max: Upper joint limits [rad], shape (6,).

        Returns:
            Joint positions [rad], shape (6,); None where no such configuration exists.
        """
        q, unlimited = np.empty(6), np.full(6, np.inf)
        # Copies: kernels are compiled again for read-only arrays.
        target, low, high = (np.array(x, dtype=np.float64) for x in (position, q_min, q_max))
        limits = JointLimits(low, high, unlimited, unlimited, unlimited)
        reached = kinematics.ik_vertical(self.lengths(), limits, target, q)
        return q if reached else None
