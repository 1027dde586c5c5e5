"""Compilation of all kernels into the cache on disk.

Set-up and the image run it, so that servers, training jobs and evaluations start quickly. The
parts share few kernels; each is compiled in its own process, one per core at a time.
"""

import gc
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from multiprocessing import get_context

import numpy as np

from app.live.commands import AddPerson, MovePerson, SetMode
from app.live.factory import new_world
from app.live.pick.world import LivePickWorld
from app.live.reach.commands import SetInferenceMode
from app.live.reach.world import LiveReachWorld
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.checkpoint import CHOOSING, REACHING, Checkpoint, purpose_of
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.inference.live_reach_policy import TrainedReachPolicy
from app.policies.inference.motion_decision import MotionDecider
from app.policies.inference.reach_policy import ReachPolicy
from app.policies.inference.task_selection import TaskChooser
from app.sim.cells.cell import load_cell
from app.sim.pick.batch import PickBatch, PickSettings
from app.sim.pick.resting_people import REST_S
from app.sim.robot.kernels.arm import CONTROLLED
from app.sim.sorting import decision as sorting_decision
from app.sim.sorting.batch import batch_in

N_ENVS = 8
SORTING_CELL, REACH_CELL = "sorting-e0", "shared-workspace"
TOUCHING = ((1, 0.0), (2, 2.8))
"""Joints, each with a position [rad] at which the robot touches the table, then itself."""


def _shipped(purpose: str) -> list[Checkpoint]:
    """Return the shipped checkpoints for a purpose."""
    shipped = [pretrained.load(alias) for alias in pretrained.ALIASES]
    return [one for one in shipped if purpose_of(one.manifest) == purpose]


def _moving() -> None:
    """Decide motion without people, beside a body and a cylinder; step live reach cells."""
    for checkpoint in _shipped(REACHING):
        policy, cell = ReachPolicy(checkpoint), cell_of(checkpoint.manifest)
        MotionDecider(policy, cell).warm_up()
        live = TrainedReachPolicy(policy)
        world = LiveReachWorld(cell, live, seed=0)
        world.step()
        world.apply(AddPerson())
        for mode in live.inference_modes:  # each command plans again, beside two people
            world.apply(SetInferenceMode(inference_mode=mode))
    new_world(load_cell(REACH_CELL), None, seed=0).step()


def _choosing() -> None:
    """Step the live pick and sorting cells, and a batch of environments."""
    for checkpoint in _shipped(CHOOSING):
        policy = TaskChooser(checkpoint)
        cell = load_cell(policy.cell)
        world = LivePickWorld(cell, policy, seed=0)
        world.step()
        x, y, z = cell.stations[0].position
        world.apply(MovePerson(right=(x, y, z + 0.1)))
        world.step()
        query = world.risk_query()
        assert query is not None  # there is a policy, and a person
        replace(query, people=[*query.people, *query.people]).answer()
        batch = PickBatch(cell, N_ENVS, seed=0, settings=PickSettings())
        batch.reset()
        batch.step(np.zeros((N_ENVS, CONTROLLED), dtype=np.float32))
        new_world(load_cell(SORTING_CELL), policy, seed=0).step()
    world.apply(SetMode(mode="still"))
    for _ in range(round(REST_S / world.robot.dt) + 5):  # a planner acts at the end
        world.step()
    for joint, position in TOUCHING:
        q = world.robot.home
        q[joint] = position
        world.robot.place(q)
        world.in_contact()


def _sorting() -> None:
    """Step a batch of sorting environments; run the exact planner."""
    tasks = batch_in(load_cell(SORTING_CELL), N_ENVS, seed=0)
    tasks.reset()
    tasks.masks()
    tasks.step(np.zeros(N_ENVS, dtype=np.int64))
    sorting_decision.warm_up()


PARTS: dict[str, Callable[[], None]] = {
    "moving": _moving,
    "choosing": _choosing,
    "sorting": _sorting,
}
"""Parts to compile, the longest first."""


def compile_part(name: str) -> float:
    """Run every kernel of a part once; return the CPU time [s]."""
    gc.set_threshold(500_000)  # most objects stay: a twelfth of the time was garbage collection
    started = time.process_time()
    PARTS[name]()
    return time.process_time() - started


def compile_all(n_processes: int) -> Iterator[tuple[str, float]]:
    """Compile each part in its own process.

    Yields:
        Name and CPU time [s] of each compiled part.
    """
    with ProcessPoolExecutor(n_processes, mp_context=get_context("spawn")) as pool:
        begun = {pool.submit(compile_part, name): name for name in PARTS}
        for done in as_completed(begun):
            yield begun[done], done.result()
