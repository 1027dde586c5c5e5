"""Base motion of a pick policy, to which the actor adds its residual (compiled).

Source: ours; the nominal controller of a residual policy (Johannink et al. 2019).
"""

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.robot.kernels.arm import CONTROLLED, Arm
from app.sim.scenario.kernels.person_observation import BASE_GAIN


@kernel(inline="always")
def base_motion(arm: Arm, q: Vec, q_goal: Vec, out: Vec) -> None:
    """Write the straight joint move toward a configuration as normalised speeds in [-1, 1].

    All controlled joints arrive together, whatever their speed limits; the speed falls with
    the remaining difference.

    Args:
        q: Joint positions [rad], shape (>= 5,).
        q_goal: Configuration to move to [rad], shape (>= 5,).
        out: Filled with speeds relative to the limits of the joints, shape (>= 5,).
    """
    limit, widest = arm.limits.qd_max, 0.0
    for j in range(CONTROLLED):
        out[j] = (q_goal[j] - q[j]) * (limit[0] / limit[j])
        widest = max(widest, abs(out[j]))
    pace = 0.0
    if widest >= 1e-9:
        pace = min(1.0, BASE_GAIN * widest / limit[0]) / widest
    for j in range(CONTROLLED):
        out[j] *= pace


@kernel()
def base_motions(arm: Arm, q: Vec, q_goal: Vec, out: Vec) -> None:
    """Apply :func:`base_motion` to n configurations, arrays of shape (n, >= 5)."""
    for i in range(q.shape[0]):
        base_motion(arm, q[i], q_goal[i], out[i])
