"""Training targets and the cells between them: coverage, weights, continuity, refusals."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from app.errors import GoalOutside, InvalidInput
from app.sim.cells.cell import load_cell
from app.sim.cells.parts import GoalRegion
from app.sim.reach.batch import ReachBatch, ReachSettings, stated_rules
from app.sim.reach.goal_sets import (
    MOST_HALTON,
    N_HALTON,
    DelaunayInterpolation,
    GridInterpolation,
    TargetInterpolation,
    halton_targets,
    interpolation_of,
)

REGION = load_cell("shared-workspace").goal_region
HALF = 0.5 * np.array(REGION.size)
LOW, HIGH = REGION.center - HALF, REGION.center + HALF


def both() -> list[TargetInterpolation]:
    return [GridInterpolation(REGION.targets()), DelaunayInterpolation(halton_targets(REGION))]


def inside(n: int, seed: int = 3) -> np.ndarray:
    return np.random.default_rng(seed).uniform(LOW, HIGH, (n, 3))


def mean_of(cells: TargetInterpolation, values: np.ndarray, goals: np.ndarray) -> np.ndarray:
    mix = cells.weights_at(goals)
    return np.einsum("nk,nkd->nd", mix.weights, values[mix.which])


@pytest.mark.parametrize("n", [8, 9, 54, 200])
def test_halton_targets_are_distinct_and_their_hull_is_the_box(n: int) -> None:
    targets = halton_targets(REGION, n)
    assert targets.shape == (n, 3) and len(np.unique(targets, axis=0)) == n
    np.testing.assert_array_equal(targets.min(axis=0), LOW)
    np.testing.assert_array_equal(targets.max(axis=0), HIGH)
    assert (((targets == LOW) | (targets == HIGH)).all(axis=1)).sum() == 8


def test_more_halton_targets_begin_with_the_fewer() -> None:
    np.testing.assert_array_equal(halton_targets(REGION, 80)[:54], halton_targets(REGION, 54))


def test_halton_targets_are_spread_as_evenly_as_the_grid() -> None:
    goals, targets = inside(4000), halton_targets(REGION)
    assert len(targets) == N_HALTON == len(REGION.targets())

    def mean_distance(points: np.ndarray) -> float:
        return float(np.linalg.norm(goals[:, None] - points, axis=-1).min(axis=1).mean())

    assert mean_distance(targets) < 1.05 * mean_distance(REGION.targets())


@pytest.mark.parametrize("n", [7, 0, -1, MOST_HALTON + 1])
def test_too_few_or_too_many_halton_targets_are_refused(n: int) -> None:
    with pytest.raises(InvalidInput, match="n_halton"):
        ReachBatch(
            load_cell("shared-workspace"), 1, 0, ReachSettings(goals="halton", n_halton=n)
        )


@pytest.mark.parametrize("size", [(1.0, 0.4, 0.0), (1e-7, 1e-7, 1e-7), (1e-12, 0.4, 0.4)])
def test_a_flat_box_has_no_halton_targets(size: tuple[float, float, float]) -> None:
    flat = GoalRegion(center=(0.0, 0.8, 0.3), size=size, spacing=0.2)
    with pytest.raises(InvalidInput, match="volume .* every side at least spacing = 0.2 m"):
        halton_targets(flat)


@pytest.mark.parametrize("cells", both())
def test_weights_sum_to_one_and_give_the_goal_back(cells: TargetInterpolation) -> None:
    goals = inside(3000)
    mix = cells.weights_at(goals)
    assert mix.weights.min() >= 0.0
    np.testing.assert_allclose(mix.weights.sum(axis=1), 1.0, atol=1e-14)
    np.testing.assert_allclose(mean_of(cells, cells.targets, goals), goals, atol=1e-12)


@pytest.mark.parametrize("cells", both())
def test_at_a_target_it_has_all_the_weight(cells: TargetInterpolation) -> None:
    mix = cells.weights_at(cells.targets)
    best = mix.weights.argmax(axis=1)
    rows = np.arange(len(cells.targets))
    np.testing.assert_array_equal(mix.which[rows, best], rows)
    np.testing.assert_array_equal(mix.weights[rows, best], 1.0)
    assert (np.sort(mix.weights, axis=1)[:, :-1] == 0.0).all()


@pytest.mark.parametrize("cells", both())
def test_the_mean_is_continuous_across_the_box(cells: TargetInterpolation) -> None:
    values = np.random.default_rng(5).uniform(-1, 1, (len(cells.targets), 6))
    for start, end in zip(inside(20, 7), inside(20, 8), strict=True):
        line = start + np.linspace(0, 1, 20_001)[:, None] * (end - start)
        jumps = np.abs(np.diff(mean_of(cells, values, line), axis=0))
        # Steps are at most 1.2 m / 20000; the thinnest cell is about 1 cm across.
        assert jumps.max() < 0.03


def test_on_a_border_of_grid_cells_only_the_border_has_weight() -> None:
    cells = GridInterpolation(REGION.targets())
    goals = inside(200)
    goals[:, 0] = np.unique(cells.targets[:, 0])[2]
    mix = cells.weights_at(goals)
    used = mix.weights > 0.0
    assert (cells.targets[mix.which[used], 0] == goals[0, 0]).all()


def test_trilinear_weights_are_those_of_the_equation() -> None:
    cells = GridInterpolation(REGION.targets())
    goal = np.array([[-0.5 + 0.2 * 1.25, 0.6 + 0.2 * 0.5, 0.1 + 0.2 * 1.75]])
    mix = cells.weights_at(goal)
    expected = {
        (i, j, k): (0.25, 0.75)[i == 1] * 0.5 * (0.75, 0.25)[k == 1]
        for i in (1, 2)
        for j in (0, 1)
        for k in (1, 2)
    }
    for corner, weight in zip(mix.which[0], mix.weights[0], strict=True):
        place = np.unravel_index(corner, (6, 3, 3))
        assert weight == pytest.approx(expected[tuple(map(int, place))])


def test_tetrahedra_are_those_of_delaunay_and_fill_the_box() -> None:
    cells = DelaunayInterpolation(halton_targets(REGION))
    known, goals = Delaunay(cells.targets), inside(2000)
    found = cells.weights_at(goals)
    home = known.simplices[known.find_simplex(goals)]
    np.testing.assert_array_equal(np.sort(found.which, axis=1), np.sort(home, axis=1))
    corners = cells.targets[cells.corners]
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / 6
    assert volume == pytest.approx(np.prod(HIGH - LOW))


@pytest.mark.parametrize("cells", both())
def test_goals_outside_are_refused_with_axis_and_distance(cells: TargetInterpolation) -> None:
    with pytest.raises(GoalOutside) as caught:
        cells.weights_at(np.array([[0.0, 0.7, 0.3], [0.62, 0.7, 0.05]]))
    found = caught.value.problem()["outside"]
    assert [one["axis"] for one in found] == ["x", "z"]
    assert [one["by_m"] for one in found] == pytest.approx([0.12, 0.05])
    assert "0.12 m outside along x, which must lie in [-0.5, 0.5] m" in str(caught.value)


@pytest.mark.parametrize("cells", both())
def test_goals_outside_by_rounding_are_taken(cells: TargetInterpolation) -> None:
    np.testing.assert_allclose(cells.weights_at(HIGH[None] + 1e-12).weights.max(), 1.0)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("cells", both())
def test_goals_that_are_no_numbers_are_refused(cells: TargetInterpolation, bad: float) -> None:
    with pytest.raises(InvalidInput, match="must be finite"):
        cells.weights_at(np.array([[0.0, bad, 0.3]]))


def test_a_flat_grid_has_cells_too() -> None:
    flat = GridInterpolation(
        GoalRegion(center=(0, 0.8, 0.3), size=(1.0, 0.4, 0.0), spacing=0.2).targets()
    )
    goals = inside(100)
    goals[:, 2] = 0.3
    np.testing.assert_allclose(mean_of(flat, flat.targets, goals), goals, atol=1e-12)
    with pytest.raises(GoalOutside, match="along z"):
        flat.weights_at(inside(1))


def test_targets_that_are_no_grid_or_have_no_corners_are_refused() -> None:
    with pytest.raises(InvalidInput, match="grid"):
        GridInterpolation(halton_targets(REGION))
    with pytest.raises(InvalidInput, match="corners"):
        DelaunayInterpolation(inside(40))
    with pytest.raises(InvalidInput, match="interpolate"):
        interpolation_of(REGION.targets(), "box")


def test_halton_goals_are_drawn_uniformly_from_their_targets() -> None:
    cell = load_cell("shared-workspace")
    settings = ReachSettings(people=(), goals="halton", n_halton=20)
    batch = ReachBatch(cell, 10_000, 9, settings)
    batch.reset()
    counts = np.bincount(batch.state.target, minlength=20)
    assert len(counts) == 20
    np.testing.assert_allclose(counts / 10_000, 1 / 20, atol=0.01)
    np.testing.assert_array_equal(
        batch.state.goal, halton_targets(REGION, 20)[batch.state.target]
    )
    assert stated_rules(cell, settings)["n_halton"] == 20
