"""Write ``promp_reference.npz``: what the package movement_primitives makes of our primitive.

Run by hand, where that package (0.9.1, built from source, so no dependency of the tests) is
installed: ``PYTHONPATH=. python -m tests.sim.make_promp_reference``. The peer gets our fitted
weights: its own fit takes half a minute. Phases, the width of the bases and the via points are
those of ``test_promp.py``.
"""

import math
from pathlib import Path

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.primitives.promp import ProMP, fit, moments
from tests.sim.demonstrations import reaches

FILE = Path(__file__).with_name("promp_reference.npz")
Z = np.linspace(0.0, 1.0, 6)
"""Phases compared."""
VARIANCES = (1e-6, 1e-4, 1e-2)
"""How exactly via points are asked for [rad^2]."""
N_BASIS = 12
WIDTH = math.sqrt(-1.0 / (8.0 * N_BASIS**2 * math.log(0.7)))
"""The package's width: neighbouring bases overlap by 0.7."""


def primitive() -> ProMP:
    """The primitive that both look at."""
    return fit(*reaches(), width=WIDTH)


def via_points(promp: ProMP) -> list[tuple[float, Vec]]:
    """Phases and joint positions asked for, one after the other."""
    rng = np.random.default_rng(5)
    means = moments(promp, np.array([0.0, 0.45, 1.0]))[0]
    return [
        (z, q + rng.normal(0.0, 0.1, 18)) for z, q in zip((0.0, 0.45, 1.0), means, strict=True)
    ]


def _blocks(cov: Vec) -> Vec:
    """Covariance at each phase, out of the package's matrix over joints and phases."""
    return np.einsum("jtkt->tjk", cov.reshape(18, len(Z), 18, len(Z)))


def main() -> None:
    """Ask the package and write the file."""
    from movement_primitives.promp import ProMP as Oracle  # noqa: PLC0415

    promp = primitive()
    weights = promp.mean.ravel().copy(), promp.cov.copy()
    peer = Oracle(18, N_BASIS).from_weight_distribution(*weights)
    found = {
        "mean": peer.mean_trajectory(Z.copy()),
        "cov": _blocks(peer.cov_trajectory(Z.copy())),
        "mean_speed": peer.mean_velocities(Z.copy()),
        "cov_speed": _blocks(peer.cov_velocities(Z.copy())),
    }
    for k, variance in enumerate(VARIANCES):
        oracle = Oracle(18, N_BASIS).from_weight_distribution(*weights)
        for phase, target in via_points(promp):
            oracle = oracle.condition_position(target, y_cov=variance * np.eye(18), t=phase)
        found[f"mean_{k}"] = oracle.mean_trajectory(Z.copy())
        found[f"cov_{k}"] = _blocks(oracle.cov_trajectory(Z.copy()))
    np.savez_compressed(FILE, **found)


if __name__ == "__main__":
    main()
