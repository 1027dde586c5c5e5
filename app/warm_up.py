"""Compiling everything the simulator compiles, once, into the cache on disk.

Done by set-up and by the image, so that later starts of the server, of training jobs and of
evaluations only read what is there.
"""

import time

import numpy as np

from app.policies import pretrained
from app.policies.checkpoint import REACHING, SORTING, purpose_of
from app.policies.motion_decision import MotionDecider
from app.policies.reach_pilot import ReachPilot
from app.policies.reach_policy import ReachPolicy
from app.policies.task_choice import TaskChooser
from app.policies.trained_cell import cell_of
from app.sim import sorting_decision
from app.sim.cells import load_cell
from app.sim.commands import MoveHuman
from app.sim.kernels.arm import CONTROLLED
from app.sim.live_world import new_world
from app.sim.pick import PickBatch, PickSettings
from app.sim.reach_world import ReachWorld
from app.sim.sorting import batch_in
from app.sim.world import World

N_ENVS = 8
SORTING_CELL, REACH_CELL = "sorting-e0", "shared-workspace"


def warm_up() -> float:
    """Use every kernel once; returns the time that took [s]."""
    started = time.monotonic()
    for alias in pretrained.ALIASES:
        checkpoint = pretrained.load(alias)
        if purpose_of(checkpoint.manifest) == SORTING:
            continue
        if purpose_of(checkpoint.manifest) == REACHING:
            reacher, cell = ReachPolicy(checkpoint), cell_of(checkpoint.manifest)
            MotionDecider(reacher, cell).warm_up()
            ReachWorld(cell, ReachPilot(reacher), seed=0).step()
            continue
        policy = TaskChooser(checkpoint)
        cell = load_cell(policy.cell)
        world = World(cell, policy, seed=0)
        world.step()
        x, y, z = cell.stations[0].position
        world.apply(MoveHuman(right=(x, y, z + 0.1)))
        world.step()
        batch = PickBatch(cell, N_ENVS, seed=0, settings=PickSettings())
        batch.reset()
        batch.step(np.zeros((N_ENVS, CONTROLLED), dtype=np.float32))
        new_world(load_cell(SORTING_CELL), policy, seed=0).step()
    new_world(load_cell(REACH_CELL), None, seed=0).step()
    tasks = batch_in(load_cell(SORTING_CELL), N_ENVS, seed=0)
    tasks.reset()
    tasks.masks()
    tasks.step(np.zeros(N_ENVS, dtype=np.int64))
    sorting_decision.warm_up()
    return time.monotonic() - started
