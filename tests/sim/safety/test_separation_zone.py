import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.collision.checker import Shapes, no_people
from app.sim.geometry.capsules import RADIUS, UX, UY, X, Y
from app.sim.robot.kernels import arm as arm_kernel
from app.sim.robot.ur10 import LINK_NAMES
from app.sim.safety.layer import SafetyLayer, safety_settings
from app.sim.safety.separation_zone import required_distances, separation_zone
from app.sim.scene.scene import arm_of

CELL = load_cell("shared-workspace")
ARM, SETTINGS = arm_of(CELL), safety_settings(CELL)


def states(n: int) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(8)
    return [(ARM.home + rng.normal(0, 0.4, 6), rng.uniform(-1, 1, 6)) for _ in range(n)]


def test_standing_robot_asks_for_what_a_person_covers_in_the_reaction_time() -> None:
    at_rest = required_distances(ARM, SETTINGS, np.zeros(6))
    assert at_rest == pytest.approx(1.6 * (0.02 + 0.1) + 0.3)


def test_every_capsule_asks_for_what_the_safety_layer_tells_of_it() -> None:
    layer, rest, rng = SafetyLayer(ARM, SETTINGS), np.zeros(6), np.random.default_rng(3)
    of_capsule, asked = np.array(LINK_NAMES)[ARM.link], set[str]()
    for q, qd in states(60):
        place = [*rng.uniform((-1.2, -1.0), (1.2, 1.6)), 0.1, rng.uniform(0.1, 1.8)]
        people = Shapes(capsules=no_people().capsules, cylinders=np.array([place]))
        decision = layer.decide(q, qd, rest, rest, people)
        _, terms = layer.terms(decision, qd, people)
        same = required_distances(ARM, SETTINGS, qd)[of_capsule == terms.link]
        np.testing.assert_allclose(same, terms.required, rtol=0.0, atol=1e-12)
        asked.add(terms.link)
    assert len(asked) >= 5


def reserves(q: np.ndarray, qd: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Horizontal distance of each place to each capsule, less what it asks for, (n, m)."""
    robot = arm_kernel.new_robot_pose(ARM)
    arm_kernel.place_robot(ARM, q, robot)
    capsules = robot.capsules[:, : len(ARM.link)]
    start, along = capsules[[X, Y]].T, capsules[[UX, UY]].T
    away = places[:, None] - start
    part = (away * along).sum(axis=2) / np.maximum((along**2).sum(axis=1), 1e-12)
    away -= np.clip(part, 0.0, 1.0)[..., None] * along
    distance = np.linalg.norm(away, axis=2) - capsules[RADIUS]
    return np.asarray(distance - required_distances(ARM, SETTINGS, qd))


def test_person_outside_the_zone_is_farther_away_than_any_capsule_asks_for() -> None:
    rng, n_outside = np.random.default_rng(2), 0
    for q, qd in states(20):
        outline = separation_zone(ARM, SETTINGS, q, qd)
        edge = np.roll(outline, -1, axis=0) - outline
        places = rng.uniform((-3.0, -3.0), (3.0, 3.0), (40, 2))
        (x, y), (ex, ey) = (places[:, None] - outline).transpose(2, 0, 1), edge.T
        outside = places[(ex * y - ey * x < 0.0).any(axis=1)]
        assert (reserves(q, qd, outside) > -0.01).all()  # edges cut off some millimetres
        n_outside += len(outside)
    assert 200 < n_outside < 700


def test_zone_reaches_as_far_as_the_capsules_ask_for() -> None:
    for q, qd in states(20):
        corners = reserves(q, qd, separation_zone(ARM, SETTINGS, q, qd))
        np.testing.assert_allclose(corners.min(axis=1), 0.0, atol=1e-9)


def test_zone_grows_with_the_robot_s_speed() -> None:
    slow = separation_zone(ARM, SETTINGS, ARM.home, np.zeros(6))
    fast = separation_zone(ARM, SETTINGS, ARM.home, np.ones(6))
    assert (np.linalg.norm(fast - slow, axis=1) > 0.2).all()
