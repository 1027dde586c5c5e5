"""The first reaches: postures of any body at the stations, and the random streams."""

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.core.kernels import rng as random
from app.sim.human import model as human
from app.sim.human.anthropometry import MEDIAN, percentile_body
from app.sim.people.reach_script import build_reach_library


@pytest.mark.parametrize("stature", [5.0, 50.0, 95.0])
def test_library_reaches_the_stations_inside_the_limits(stature: float) -> None:
    cell = load_cell()
    library = build_reach_library(cell, 0, (MEDIAN, percentile_body(stature)))
    assert (library.postures >= human.Q_MIN).all() and (library.postures <= human.Q_MAX).all()
    misses = []
    for place, station in enumerate(cell.stations):
        for column in range(2):
            first, count = library.of_station[1, place, column]
            palms = library.hands[first : first + count, column]
            misses.extend(np.linalg.norm(palms - station.position, axis=1))
    assert np.median(misses) < 0.08
    assert np.mean(np.array(misses) < 0.15) > 0.85


def test_postures_stay_in_a_shallow_walking_area() -> None:
    worker = load_cell().human
    worker = worker.model_copy(update={"y_max": worker.y_min + 0.05})
    shallow = load_cell().model_copy(update={"people": (worker,)})
    assert build_reach_library(shallow, 0, variants=8).postures[:, 1].max() <= worker.y_max


def test_library_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        build_reach_library(load_cell(), 0).postures[0] = 0.0


def draw(seed: int, env: int, episode: int, n: int = 5) -> list[float]:
    state = np.zeros(1, dtype=np.uint64)
    random.start_stream(seed, env, episode, state)
    return [random.uniform(state) for _ in range(n)]


def test_streams_are_fixed_by_their_key_and_differ_between_keys() -> None:
    keys = [(s, e, k) for s in range(4) for e in range(4) for k in range(4)]
    streams = {tuple(draw(*key)) for key in keys}
    assert len(streams) == len(keys)
    assert draw(1, 2, 3) == draw(1, 2, 3)


def test_first_draws_of_neighbouring_episodes_look_uniform_and_unrelated() -> None:
    first = np.array([draw(11, env, 0, 1)[0] for env in range(4000)])
    counts = np.histogram(first, bins=20, range=(0, 1))[0]
    assert ((counts - 200) ** 2 / 200).sum() < 43.8  # chi-squared, 19 degrees, 0.1 %
    assert abs(np.corrcoef(first[:-1], first[1:])[0, 1]) < 0.06


def test_normal_draws_have_mean_zero_and_variance_one() -> None:
    state = np.zeros(1, dtype=np.uint64)
    random.start_stream(1, 2, 3, state)
    values = np.array([random.normal(state) for _ in range(20000)])
    assert abs(values.mean()) < 0.03 and abs(values.std() - 1) < 0.03
