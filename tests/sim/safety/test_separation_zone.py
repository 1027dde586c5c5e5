import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.collision.checker import Shapes, no_people
from app.sim.collision.contact import pedestrian_distances
from app.sim.safety.layer import SafetyLayer, safety_settings
from app.sim.safety.separation_zone import required_distances, separation_zone
from app.sim.scene.scene import arm_of, people_of

CELL = load_cell("shared-workspace")
ARM, SETTINGS = arm_of(CELL), safety_settings(CELL)


def states(n: int) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(8)
    return [(ARM.home + rng.normal(0, 0.4, 6), rng.uniform(-1, 1, 6)) for _ in range(n)]


def test_standing_robot_asks_for_what_a_person_covers_in_the_reaction_time() -> None:
    at_rest = required_distances(ARM, SETTINGS, np.zeros(6))
    assert at_rest == pytest.approx(1.6 * (0.02 + 0.1) + 0.3)


def test_every_capsule_asks_for_what_the_safety_layer_tells_of_it() -> None:
    layer, rest = SafetyLayer(ARM, SETTINGS), np.zeros(6)
    for q, qd in states(12):
        people = Shapes(columns=no_people().columns, cylinders=np.array([[0.2, 1.6, 0.3, 1.3]]))
        decision = layer.decide(q, qd, rest, rest, people)
        _, terms = layer.terms(decision, qd, people)
        assert np.abs(required_distances(ARM, SETTINGS, qd) - terms.required).min() < 1e-12


def test_person_outside_the_zone_is_farther_away_than_any_capsule_asks_for() -> None:
    shared, rng = people_of(CELL), np.random.default_rng(2)
    for q, qd in states(20):
        outline = separation_zone(ARM, SETTINGS, q, qd)
        least = required_distances(ARM, SETTINGS, qd).min()
        for place in rng.uniform((-2.0, -0.5), (2.0, 2.5), (20, 2)):
            outward = np.roll(outline, -1, axis=0) - outline
            side = outward[:, 0] * (place[1] - outline[:, 1]) - outward[:, 1] * (
                place[0] - outline[:, 0]
            )
            if (side >= 0.0).all():
                continue
            gap = pedestrian_distances(ARM, shared, q, np.array([[*place, 1e-3]]))[0]
            assert gap > least - 5e-3


def test_zone_grows_with_the_robot_s_speed() -> None:
    slow = separation_zone(ARM, SETTINGS, ARM.home, np.zeros(6))
    fast = separation_zone(ARM, SETTINGS, ARM.home, np.ones(6))
    assert (np.linalg.norm(fast - slow, axis=1) > 0.2).all()
