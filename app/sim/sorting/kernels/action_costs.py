"""Expected attempts of the exact planner per first move (compiled).

A first move costs ``1 / (1 - p)`` attempts, with the failure probability ``p`` of its pick, and
the attempts of a plan by the rules from the resulting state.
"""

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.sorting.kernels.planner import Objects, PlannerWork, Task, plan_by_rules
from app.sim.sorting.kernels.shortest_paths import Ints, lay_out


@kernel()
def _shift(source: int, target: int, objects: Objects) -> None:
    """Move an object; positions below K are clutter slots, those from K on tops of towers."""
    n_slots = len(objects.clutter)
    if source < n_slots:
        code = objects.clutter[source]
        objects.clutter[source] = 0
    else:
        c = source - n_slots
        objects.heights[c] -= 1
        code = objects.towers[c, objects.heights[c]]
        objects.towers[c, objects.heights[c]] = 0
    if target < n_slots:
        objects.clutter[target] = code
    else:
        c = target - n_slots
        objects.towers[c, objects.heights[c]] = code
        objects.heights[c] += 1


@kernel(nogil=True)
def attempts_by_move(
    objects: Objects, task: Task, moves: Ints, most: int, work: PlannerWork, attempts: Vec
) -> bool:
    """Write the expected attempts to the goal per first move.

    Args:
        objects: Positions of the objects; restored at the end.
        task: Goal and failure probabilities.
        moves: Valid moves as positions to pick and to place, shape (n, 2).
        most: Largest number of states times moves that is planned; nothing is written beyond.
        work: Work space of the shape.
        attempts: Expected attempts by move, shape (n,), written.

    Returns:
        Whether they were written.
    """
    size = lay_out(
        objects.clutter,
        objects.towers,
        objects.heights,
        task.goal,
        task.goal_heights,
        work.paths,
    )
    if size * len(moves) > most:
        return False
    for i in range(len(moves)):
        pick, place = moves[i, 0], moves[i, 1]
        _shift(pick, place, objects)
        _, after = plan_by_rules(objects, task, work)
        _shift(place, pick, objects)
        risk = task.fail[pick] if pick < len(task.fail) else 0.0
        attempts[i] = after + 1.0 / (1.0 - risk)
    return True
