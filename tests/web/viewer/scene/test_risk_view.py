"""Risk map in the scene: its colours, and where robot and person touch."""

import numpy as np

from app.live.pick.risk_worker import GRID, PersonRisk
from app.sim.pick.task_policy import RiskMap
from tests.web.conftest import node
from web.viewer.scene.risk_view import COLOURS, NODE, NOTHING, RiskView, colours_of
from web.viewer.server import ViewerServer

N = len(GRID.x) * len(GRID.y)


def risk(contact: np.ndarray | None, clearance: np.ndarray, person: int = 0) -> PersonRisk:
    found = RiskMap(
        chosen=np.zeros(N, dtype=np.int64),
        value=np.zeros(N),
        success=contact,
        contact=contact,
        clearance_m=clearance,
        outside=np.zeros(N, dtype=np.bool_),
        elapsed_ms=1.0,
    )
    return PersonRisk(person=person, map=found)


def test_colours_go_from_one_end_of_the_scale_to_the_other() -> None:
    found = colours_of(np.array([0.0, 0.2, 0.4, 0.9]))[:, :3]
    np.testing.assert_array_equal(found, COLOURS[[0, 1, 2, 2]])


def test_rows_of_the_picture_run_along_y(server: ViewerServer) -> None:
    view = RiskView(server)
    image = node(server, f"{NODE}/map")
    contact, clearance = np.zeros(GRID.shape), np.ones(GRID.shape)
    contact[0, -1], clearance[-1, 0] = 0.4, -0.01
    view.draw(risk(contact.ravel(), clearance.ravel()))
    picture = image.image
    assert tuple(picture[0, -1, :3]) == tuple(COLOURS[-1])
    assert tuple(picture[-1, 0]) == NOTHING
    assert (picture[1:, 1:, :3] == COLOURS[0]).all()
    view.draw(None)
    assert not image.image.any()


def test_without_probabilities_nothing_is_drawn(server: ViewerServer) -> None:
    view = RiskView(server)
    view.draw(risk(None, np.ones(N)))
    assert not node(server, f"{NODE}/map").image.any()


def test_legend_names_the_person_of_the_map(server: ViewerServer) -> None:
    view = RiskView(server)
    for person in (0, 2):
        view.draw(risk(np.zeros(N), np.ones(N), person))
        text = node(server, f"{NODE}/scale/0.5").text
        assert text == f"P(contact), person {person + 1} there"
