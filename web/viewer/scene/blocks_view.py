"""Blocks in the scene: created once, moved afterwards, clickable."""

from collections.abc import Callable

import numpy as np
import viser

from app.live.sorting.commands import ToggleGoal
from app.live.sorting.snapshot import BlockSnapshot
from app.sim.cells.colours import BLOCKS
from app.sim.core.arrays import Vec
from web.viewer.scene.sorting_bodies import block_body

MIN_SHIFT_M = 2e-4
"""Shortest displacement that is sent to browsers [m]."""


class BlocksView:
    """Draws all blocks; used by the live cell's thread only.

    A click on a block adds it to the goal, or removes it.
    """

    def __init__(
        self, server: viser.ViserServer, submit: Callable[[ToggleGoal], object]
    ) -> None:
        self._scene, self._submit = server.scene, submit
        self._drawn: dict[str, tuple[viser.GlbHandle, Vec]] = {}

    def draw(self, blocks: tuple[BlockSnapshot, ...]) -> None:
        """Show the blocks at their positions."""
        here = {block.id for block in blocks}
        for id in self._drawn.keys() - here:
            self._drawn.pop(id)[0].remove()
        for block in blocks:
            if block.id not in self._drawn:
                self._drawn[block.id] = self._add(block), block.position
                continue
            handle, before = self._drawn[block.id]
            if np.abs(block.position - before).max() > MIN_SHIFT_M:
                handle.position = block.position
                self._drawn[block.id] = handle, block.position

    def _add(self, block: BlockSnapshot) -> viser.GlbHandle:
        x, y, z = block.half_size.tolist()
        body = self._scene.add_glb(
            f"/blocks/{block.id}",
            block_body(BLOCKS[block.colour], (x, y, z)),
            position=block.position,
        )
        name = block.id

        async def toggle(_: object) -> None:
            self._submit(ToggleGoal(id=name))

        body.on_click(toggle)
        return body
