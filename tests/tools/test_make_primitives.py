"""The script that makes the shipped primitives makes them again."""

from pathlib import Path

import numpy as np

from app.sim.cells.cell import load_cell
from app.sim.human import anthropometry as body_size
from app.sim.human.kernels import kinematics as body
from app.sim.primitives.library_file import load_primitives, read_header
from tools.make_primitives import (
    N_DEMONSTRATIONS,
    SEED,
    VERSION,
    draw_people,
    make_primitive,
    write_primitives,
)


def test_a_segment_made_again_is_the_shipped_one() -> None:
    header, shipped = read_header(), load_primitives()[21]
    assert (header["seed"], header["version"]) == (SEED, VERSION)
    assert header["demonstrations"] == len(shipped.weights) == N_DEMONSTRATIONS
    made = make_primitive(load_cell(shipped.cell), shipped.segment)
    np.testing.assert_allclose(made.weights, shipped.weights, atol=1e-5)
    np.testing.assert_allclose(made.durations, shipped.durations, rtol=1e-5)
    np.testing.assert_allclose(made.residual, shipped.residual, atol=1e-5)


def test_people_are_spread_over_the_percentiles() -> None:
    cell = load_cell()
    people = np.array(draw_people(cell, 40, np.random.default_rng(1)))
    low, high = (
        body_size.percentile_body(percent, pelvis=cell.human.pelvis_height).trunk
        for percent in (5.0, 95.0)
    )
    trunks = np.sort(people[:, body.TRUNK])
    assert low <= trunks[0] and trunks[-1] <= high
    assert trunks[0] < low + 0.1 * (high - low) and trunks[-1] > high - 0.1 * (high - low)


def test_elbow_spread_varies_the_working_arm_only() -> None:
    shipped = load_primitives()[21]
    cell, n = load_cell(shipped.cell), 2
    plain, varied = (make_primitive(cell, shipped.segment, n, spread) for spread in (0.0, 0.4))
    arm = slice(10, 14) if shipped.segment.hand == "r" else slice(14, 18)
    changed = np.abs(varied.weights[0] - plain.weights[0]).max(axis=1) > 1e-6
    assert changed[arm].any() and not np.delete(changed, np.r_[arm]).any()


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    path, made = tmp_path / "some.npz", load_primitives()[:3]
    write_primitives(path, made, {"seed": 1})
    assert read_header(path)["seed"] == 1
    for before, after in zip(made, load_primitives(path), strict=True):
        assert before.segment == after.segment
        np.testing.assert_array_equal(before.weights, after.weights)
        np.testing.assert_array_equal(before.durations, after.durations)
