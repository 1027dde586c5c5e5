"""The shipped primitives: complete, small, readable without pickle."""

import numpy as np

from app.sim.cells.cell import cell_names, load_cell
from app.sim.human import model as human
from app.sim.primitives import promp
from app.sim.primitives.keyframes import STYLES
from app.sim.primitives.library_file import (
    FILE,
    load_primitives,
    primitive_for,
    read_header,
    segments_of,
)
from tools.demonstrations import PHASES


def test_every_segment_of_every_shipped_cell_has_its_primitive() -> None:
    wanted = {
        (name, segment) for name in cell_names() for segment in segments_of(load_cell(name))
    }
    assert {(one.cell, one.segment) for one in load_primitives()} == wanted
    assert len(load_primitives()) == len(wanted) == 40


def test_file_is_small_and_holds_numbers_only() -> None:
    assert FILE.stat().st_size < 4_000_000
    with np.load(FILE, allow_pickle=False) as data:
        assert {name: data[name].dtype.kind for name in data.files} == {
            "header": "U",
            "weights": "f",
            "durations": "f",
            "residual": "f",
        }


def test_header_says_how_it_was_made() -> None:
    header = read_header()
    assert header["styles"] == [style.name for style in STYLES]
    assert header["percentiles"]["stature"] == [5.0, 95.0]
    assert {"seed", "version", "demonstrations", "made_by", "tasks"} <= header.keys()


def test_weights_lose_less_than_ten_milliradians() -> None:
    for one in load_primitives():
        assert one.residual.max() < 0.01


def test_primitive_is_what_fitting_the_demonstrations_gives() -> None:
    one = load_primitives()[17]
    phi = promp.basis(PHASES, promp.N_BASIS, promp.usual_width(promp.N_BASIS))
    motions = [phi @ row.T for row in one.weights]
    fitted = promp.fit(motions, one.durations)
    shipped = promp.of_weights(one.weights, one.durations, residual=one.residual)
    np.testing.assert_allclose(fitted.mean, shipped.mean, atol=1e-4)
    np.testing.assert_allclose(fitted.cov, shipped.cov, atol=1e-4)
    assert fitted.duration_s == shipped.duration_s
    assert fitted.duration_spread == shipped.duration_spread


def test_demonstrations_keep_the_joint_limits() -> None:
    phi = promp.basis(PHASES, promp.N_BASIS, promp.usual_width(promp.N_BASIS))
    for one in load_primitives():
        q = phi @ np.swapaxes(one.weights, 1, 2)
        assert (q >= human.Q_MIN - 0.01).all() and (q <= human.Q_MAX + 0.01).all()


def test_shipped_cell_gets_its_own_primitives() -> None:
    cell = load_cell()
    for one in load_primitives():
        found = primitive_for(cell, one.segment)
        assert found.segment == one.segment
        np.testing.assert_array_equal(found.weights, one.weights)
