"""Images of environments show table, robot, people and the task; videos can be made of them."""

import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.wrappers import AddRenderObservation
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.sim.cells.cell import Cell, load_cell
from app.sim.cells.colours import FAILURES, GLOVE, TABLE_TOP, TOOL, VESTS, blend
from app.sim.cells.parts import Obstacle
from app.sim.envs import IDS
from app.sim.envs.rendering import (
    HEIGHT,
    STATION,
    WIDTH,
    _static_solids,
    block_solids,
)
from app.sim.envs.solids import Box
from app.sim.sorting.batch import batch_in
from app.sim.sorting.state import NULL

SHAPE = (HEIGHT, WIDTH, 3)
Image = NDArray[np.uint8]


def rendered(env_id: str, **keywords: Any) -> gymnasium.Env[Any, Any]:
    env = gymnasium.make(env_id, render_mode="rgb_array", **keywords)
    env.reset(seed=4)
    return env


def image(env: gymnasium.Env[Any, Any]) -> Image:
    frame = env.render()
    assert isinstance(frame, np.ndarray)
    return frame


def share_of(frame: Image, colour: tuple[int, int, int]) -> float:
    """Share of the pixels whose hue is that of a colour, light or dark."""
    pixels = frame.reshape(-1, 3) / np.linalg.norm(frame.reshape(-1, 3) + 1.0, axis=1)[:, None]
    wanted = np.array(colour) / np.linalg.norm(np.array(colour) + 1.0)
    return float((np.abs(pixels - wanted).max(axis=1) < 0.05).mean())


@pytest.mark.parametrize("env_id", IDS)
def test_every_environment_gives_images(env_id: str) -> None:
    env = rendered(env_id)
    frame = image(env)
    assert frame.shape == SHAPE and frame.dtype == np.uint8
    assert share_of(frame, TABLE_TOP) > 0.1 and share_of(frame, TOOL) > 2e-4
    assert np.array_equal(frame, image(env))  # rendering changes nothing


@pytest.mark.parametrize(
    ("env_id", "rate"),
    [("tandem/Pick-v0", 20), ("tandem/Reach-v0", 50), ("tandem/SortingE1-v0", 4)],
)
def test_frames_per_second_are_the_control_rate(env_id: str, rate: int) -> None:
    assert gymnasium.make(env_id).metadata["render_fps"] == rate
    many = gymnasium.make_vec(env_id, 2, render_mode="rgb_array")
    assert many.metadata["render_fps"] == rate
    assert many.metadata["render_modes"] == ["rgb_array"]


def test_people_are_seen_where_there_are_some() -> None:
    alone, worker, walker = (
        image(rendered("tandem/Reach-v0", people=people))
        for people in ((), ("worker",), ("walker",))
    )
    assert share_of(worker, GLOVE) > 3 * share_of(alone, GLOVE) + 1e-4
    assert share_of(walker, VESTS[0]) > share_of(alone, VESTS[0]) + 0.01


def teal(frame: Image) -> float:
    """Share of the pixels that have the colour of a target."""
    red, green, blue = np.moveaxis(frame.astype(int), 2, 0)
    return float(((green > red + 25) & (blue > red + 20) & (green >= blue)).mean())


def test_target_is_seen_and_goes_where_the_episode_wants_it() -> None:
    env = rendered("tandem/Reach-v0", people=())
    frames = []
    for episode in range(3):
        env.reset(seed=2, options={"episode": episode})
        frames.append(image(env))
    assert all(teal(frame) > 5e-5 for frame in frames)
    moved = (frames[0] != frames[1]).any(axis=2).mean()
    assert 1e-3 < moved < 0.1


def test_the_arm_moves_and_the_table_does_not() -> None:
    env = rendered("tandem/Reach-v0", people=())
    first = image(env)
    for _ in range(25):
        env.step(np.ones(6, np.float32))
    changed = (image(env) != first).any(axis=2)
    assert 0.01 < changed.mean() < 0.4


def test_blocks_are_seen_where_they_lie() -> None:
    env = rendered("tandem/SortingE0-v0")
    task = env.unwrapped.batch  # type: ignore[attr-defined]
    before = image(env)
    task.envs.clutter[:], task.envs.goal[:] = 0, 0
    empty = image(env)
    assert (before != empty).any(axis=2).mean() > 1e-3
    red = (205, 58, 62)
    assert share_of(before, red) > share_of(empty, red)


def on_shelf(cell: Cell, number: int, height: float) -> Cell:
    """A cell with one station over a shelf of a height [m]."""
    x, y, z = cell.stations[number].position
    raised = cell.stations[number].model_copy(update={"position": (x, y, z + height)})
    size = (0.1, 0.1, 0.5 * height)
    shelf = Obstacle(id="shelf", label="Shelf", center=(x, y, size[2]), half_size=size)
    stations = (*cell.stations[:number], raised, *cell.stations[number + 1 :])
    return cell.model_copy(update={"obstacles": (shelf,), "stations": stations})


def test_objects_stand_on_what_is_below_their_station() -> None:
    cell = on_shelf(load_cell("pick-and-place"), 0, 0.2)
    boxes = [one for one in _static_solids(cell) if isinstance(one, Box)]
    x, y, _ = cell.stations[0].position
    (cube,) = (one for one in boxes if one.colour == STATION and one.center[:2] == (x, y))
    assert cube.center[2] - cube.half_size[2] == pytest.approx(0.2)


def test_blocks_stand_on_what_is_below_their_slot() -> None:
    plain = load_cell("sorting-e0")
    task = batch_in(plain, 1, 4)
    task.reset()
    state = task.state_of(0)
    before, after = (
        block_solids(cell, task.shape, state) for cell in (plain, on_shelf(plain, 0, 0.1))
    )
    moved = [
        b.center[2] - a.center[2]
        for a, b in zip(before, after, strict=True)
        if isinstance(a, Box) and isinstance(b, Box) and a.center != b.center
    ]
    assert moved == pytest.approx([0.1] * (1 + (state.clutter[0] != NULL)))


def test_clutter_slots_have_the_colours_of_the_scene() -> None:
    cell = load_cell("sorting-e0")
    task = batch_in(cell, 1, seed=0)
    task.reset()
    colours = {solid.colour for solid in block_solids(cell, task.shape, task.state_of(0))}
    rates = [station.failure_probability for station in cell.stations_of("clutter")]
    assert {blend(FAILURES, rate) for rate in rates if rate is not None} <= colours


@pytest.mark.parametrize("env_id", ["tandem/Pick-v0", "tandem/Reach-v0", "tandem/SortingE0-v0"])
def test_batches_give_an_image_of_every_row(env_id: str) -> None:
    many = gymnasium.make_vec(env_id, 2, render_mode="rgb_array")
    many.reset(seed=4)
    frames = many.render()
    assert isinstance(frames, tuple) and [frame.shape for frame in frames] == [SHAPE] * 2
    one = gymnasium.make(env_id, render_mode="rgb_array", first_env=1)
    one.reset(seed=4)
    np.testing.assert_array_equal(one.render(), frames[1])


@pytest.mark.parametrize("env_id", ["tandem/Pick-v0", "tandem/Reach-v0", "tandem/SortingE0-v0"])
def test_other_modes_are_refused_with_the_choices(env_id: str) -> None:
    for make in (gymnasium.make, gymnasium.make_vec):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Gymnasium's own, before
            with pytest.raises(InvalidInput, match="rgb_array"):
                make(env_id, render_mode="ansi")


def test_images_need_a_mode_and_a_reset() -> None:
    bare = gymnasium.make("tandem/Reach-v0").unwrapped
    bare.reset(seed=1)
    with pytest.warns(UserWarning, match="render_mode"):
        assert bare.render() is None
    with pytest.raises(ResetNeeded, match="reset"):
        gymnasium.make("tandem/Reach-v0", render_mode="rgb_array").unwrapped.render()
    many = gymnasium.make_vec("tandem/Reach-v0", 2, render_mode="rgb_array")
    with pytest.raises(ResetNeeded, match="reset"):
        many.render()


def test_gymnasiums_wrappers_take_the_images() -> None:
    frames = gymnasium.make("tandem/Pick-v0", render_mode="rgb_array_list")
    frames.reset(seed=1)
    frames.step(frames.action_space.sample())
    assert [frame.shape for frame in frames.render()] == [SHAPE] * 2
    seen = AddRenderObservation(rendered("tandem/Pick-v0"), render_only=True)
    obs, _ = seen.reset(seed=1)
    assert obs.shape == SHAPE
