"""Tests of policies that observe people through a tracker."""

from functools import cache

import numpy as np

from app.policies.evaluation.reach.tracker import ROWS, CylinderObserver, CylinderSensorRow
from app.sim.cells.cell import load_cell
from app.sim.people.kernels.pedestrian import VX, VY, R, X, Y
from app.sim.perception.cylinder_sensor_model import CylinderSensorSettings
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.scenario.kernels.episode import TIMEOUT
from tests.policies.straight_controller import Straight

N = 8


class Watching(Straight):
    """Controller that records what it observes."""

    def __init__(self) -> None:
        super().__init__()
        self.shown: list[np.ndarray] = []
        self.clear: list[np.ndarray] = []
        self.obs: list[np.ndarray] = []

    def acts(self, batch: ReachBatch) -> np.ndarray:
        self.shown.append(batch.state.people.walkers.rows[:, 0][:, [X, Y, VX, VY, R]].copy())
        self.clear.append(batch.state.clear[:, 0].copy())
        self.obs.append(batch.observe().copy())
        return super().acts(batch)


@cache
def watched(
    row: CylinderSensorRow | None, steps: int = 40
) -> tuple[Watching, np.ndarray, ReachBatch]:
    """Run some steps, once per row; return the controller, the true people and the batch."""
    batch = ReachBatch(load_cell("shared-workspace"), N, 5, ReachSettings())
    batch.reset()
    watching, true = Watching(), []
    controller = watching if row is None else CylinderObserver(watching, row, 5)
    for _ in range(steps):
        true.append(batch.state.people.walkers.rows[:, 0][:, [X, Y, VX, VY, R]].copy())
        act = controller.acts(batch)
        now = batch.state.people.walkers.rows[:, 0][:, [X, Y, VX, VY, R]]
        np.testing.assert_array_equal(now, true[-1])
        np.testing.assert_array_equal(batch.state.people.cylinders[:, 0], now[:, [0, 1, 4]])
        batch.step(act, auto_reset=False)
    return watching, np.array(true), batch


def off(watching: Watching, true: np.ndarray) -> float:
    return float(
        np.linalg.norm(np.array(watching.shown)[:, :, :2] - true[:, :, :2], axis=2).mean()
    )


def test_fast_and_clean_frames_show_people_where_they_are() -> None:
    perfect = CylinderSensorRow(
        tracker=CylinderSensorSettings(rate_hz=50.0, latency_s=0.0, noise=0.0)
    )
    watching, true, _ = watched(perfect)
    assert off(watching, true) < 5e-3


def test_people_are_farther_off_the_later_and_noisier_frames_are() -> None:
    names = ("30hz", "100ms", "100ms-noise", "200ms-noise")
    errors = [off(*watched(ROWS[name])[:2]) for name in names]
    assert errors == sorted(errors) and errors[0] > 0.0
    assert errors[-1] < 0.2


def test_prediction_beats_the_newest_frame() -> None:
    assert off(*watched(ROWS["100ms"])[:2]) < off(*watched(ROWS["100ms-not-predicted"])[:2])


def test_clearances_are_those_to_the_observed_people() -> None:
    watching, _, _ = watched(ROWS["200ms-noise"])
    exact, _, _ = watched(None)
    assert not np.allclose(watching.clear[-1], exact.clear[-1], atol=1e-3)
    assert not np.array_equal(watching.obs[0], exact.obs[0])


def test_a_controller_without_observation_moves_as_without_tracker() -> None:
    _, _, seen = watched(ROWS["200ms-noise"])
    _, _, alone = watched(None)
    np.testing.assert_array_equal(seen.state.q, alone.state.q)
    np.testing.assert_array_equal(seen.state.outcome, alone.state.outcome)


def test_the_first_look_already_knows_the_person() -> None:
    watching, true, _ = watched(ROWS["100ms"], 1)
    assert off(watching, true) < 1e-6


def test_errors_of_environments_whose_episodes_have_ended_do_not_count() -> None:
    cell = load_cell("shared-workspace")
    batch = ReachBatch(cell, N, 5, ReachSettings())
    batch.reset()
    batch.state.outcome[: N - 1] = TIMEOUT
    observer = CylinderObserver(Straight(), ROWS["100ms-noise"], 5)
    observer.acts(batch)
    assert [len(errors) for errors in observer.errors] == [1]
