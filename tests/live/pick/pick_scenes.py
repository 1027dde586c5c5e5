"""Steps of live pick cells."""

from app.live.pick.world import LivePickWorld
from app.live.snapshot import WorldSnapshot


def run(world: LivePickWorld, ticks: int) -> WorldSnapshot:
    """Step; return the snapshot of then."""
    for _ in range(ticks):
        world.step()
    return world.snapshot()


def until(world: LivePickWorld, status: str, limit: int = 400) -> WorldSnapshot:
    """Step until a status; return the snapshot of then."""
    for _ in range(limit):
        world.step()
        if world.snapshot().status == status:
            return world.snapshot()
    raise AssertionError(f"never {status}: {world.snapshot().message}")
