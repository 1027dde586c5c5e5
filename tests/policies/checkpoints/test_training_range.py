"""What a checkpoint says of the states it met."""

from app.policies.checkpoints.training_range import TrainingRange
from app.policies.training.pick import visited_states
from app.sim.cells.cell import load_cell
from app.sim.people.human_motion_config import HumanMotionConfig
from app.sim.pick.batch import PickBatch, PickSettings


def test_people_who_are_not_there_widen_no_range() -> None:
    ranges, work = TrainingRange(), HumanMotionConfig(absent=0.5)
    batch = PickBatch(load_cell(), 64, 1, PickSettings(work=work))
    batch.reset()
    ranges.extend(visited_states(batch))
    known = ranges.as_json()
    assert known["human_q"]["high"][1] < 2.5 < batch.state.people.q[:, 0, 1].max()
    assert set(known) == {"q", "qd", "goal", "human_q", "human_qd"}


def test_a_cell_without_people_has_no_range_of_people() -> None:
    ranges, work = TrainingRange(), HumanMotionConfig(absent=1.0)
    batch = PickBatch(load_cell(), 8, 1, PickSettings(work=work))
    batch.reset()
    ranges.extend(visited_states(batch))
    assert set(ranges.as_json()) == {"q", "qd", "goal"}
