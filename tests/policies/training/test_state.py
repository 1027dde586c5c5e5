"""States of trainings that earlier versions have stored."""

from collections.abc import Callable

import pytest

from app.policies.training.state import present_name
from app.sim.cells.cell import load_cell
from app.sim.pick.batch import PickSettings
from app.sim.pick.monitored_batch import AMONG_HANDS, MonitoredPickBatch
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.scenario.monitoring import MonitoringSettings
from app.sim.sorting.batch import batch_in
from app.state_dict import Stateful

RENAMED = {
    "env.batch.rows.clutter": "env.batch.envs.clutter",
    "env.batch._sight.gap": "env.batch._observation_work.clearance",
    "env.batch._sight.clearances": "env.batch._observation_work.clearances_ahead",
    "env.batch.parts.0._work.robot.columns": "env.batch.parts.0._work.robot.capsules",
    "env.batch._monitor.trial.columns0": "env.batch._monitor.trial.capsules0",
    "env.batch.state.people.walkers.rows": "env.batch.state.people.walkers.rows",
    "networks.actor.rows": "networks.actor.rows",
}


BATCHES: dict[str, Callable[[], Stateful]] = {
    "sorting": lambda: batch_in(load_cell("sorting-e0"), 2, 0),
    "pick": lambda: MonitoredPickBatch(
        load_cell("pick-and-place"), 2, 0, PickSettings(), AMONG_HANDS, MonitoringSettings()
    ),
    "reach": lambda: ReachBatch(load_cell("shared-workspace"), 2, 0, ReachSettings()),
}


@pytest.mark.parametrize("name", RENAMED)
def test_entries_of_earlier_versions_are_read_by_their_present_names(name: str) -> None:
    assert present_name(name) == RENAMED[name]


@pytest.mark.parametrize("scenario", BATCHES)
def test_present_names_stay_as_they_are(scenario: str) -> None:
    names = [f"env.batch.{name}" for name in BATCHES[scenario]().state_dict()]
    assert len(names) > 10
    assert [present_name(name) for name in names] == names
