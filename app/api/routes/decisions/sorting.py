"""Sorting decisions: the next move of a sorting task (thesis chapter 3).

Source: docs/method.md 1.
"""

from functools import partial

import numpy as np
from fastapi import APIRouter
from starlette.concurrency import run_in_threadpool

from app.api.description import MISMATCH
from app.api.registry import SORTING_ALIASES
from app.api.schemas.sorting import SortingAnswer, SortingRequest, outside_of
from app.api.services import Services, ServicesDep
from app.errors import InvalidInput
from app.sim.core.arrays import Vec
from app.sim.sorting.batch import fail_of
from app.sim.sorting.decision import decide, is_slow_decision
from app.sim.sorting.names import SortingNames, names_of, plain_names
from app.sim.sorting.sorting_values import SortingValues

router = APIRouter(prefix="/v1/sorting", tags=["deciding"])


@router.post("", summary="Choose the next move of a sorting task", responses=MISMATCH)
async def choose_sorting_move(request: SortingRequest, services: ServicesDep) -> SortingAnswer:
    """Return the next move with its reason, and every valid move with its value.

    Calls are independent: goal and objects may change at any time. A caller that returns
    `monitor` with the next request lets the exact planner replace a policy that repeats moves.
    """
    # A policy decides in less than a millisecond, on the event loop.
    services.readiness.require()
    names, own = await _task_of(request, services)
    state = request.to_domain(names, own)
    policy = await _policy_of(request, services)
    choose = partial(
        decide,
        policy,
        state,
        names.shape,
        None if request.monitor is None else request.monitor.to_domain(),
        ask_planner=request.decider == "planner",
    )
    long = is_slow_decision(names.shape)
    decision = await run_in_threadpool(choose) if long else choose()
    outside = outside_of(decision, state, names, policy, own)
    services.metrics.count_outside(router.prefix, outside)
    return SortingAnswer.from_domain(decision, state, request, names, outside)


async def _task_of(request: SortingRequest, services: Services) -> tuple[SortingNames, Vec]:
    """Return the names of a request's task, and its failure probabilities."""
    layout = request.layout
    if (request.cell is None) == (layout is None):
        rule = "must be given where `layout` is not, and only there"
        raise InvalidInput("cell", request.cell, rule)
    if layout is not None:
        names = plain_names(layout.n_slots, layout.colours, layout.sizes)
        return names, np.zeros(layout.n_slots)
    assert request.cell is not None
    cell = await services.known_cell(request.cell)
    return names_of(cell), fail_of(cell)


async def _policy_of(request: SortingRequest, services: Services) -> SortingValues | None:
    """Return a policy by name, by default the cell's shipped one; None for the planner.

    Raises:
        InvalidInput: No checkpoint has that name.
        CheckpointMismatch: It is no sorting policy.
    """
    name = request.checkpoint
    if name is None and request.cell in SORTING_ALIASES:
        name = request.cell if request.cell in services.checkpoints.aliases else None
    if name is None or request.decider == "planner":
        return None
    return await services.sorting_policies.get(name)
