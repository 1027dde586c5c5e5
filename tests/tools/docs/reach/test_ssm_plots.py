"""``tools/docs/reach/ssm_plots.py`` draws what is in the result, to its scale."""

import numpy as np

from tools.docs.reach.ssm_plots import arrivals, override


def test_the_override_is_drawn_in_percent_until_each_arrives():
    example = {
        "dt_s": 0.5,
        "override": {"policy-rollout": [1.0, 0.2], "rrtstar-once": [1.0, 0, 0, 1]},
    }
    upper, lower = override(example).axes
    for axis, seconds, values in ((upper, 1.0, [100, 20]), (lower, 2.0, [100, 0, 0, 100])):
        steps = axis.patches[1].get_data()
        np.testing.assert_allclose(steps.values, values)
        assert steps.edges[-1] == seconds


def test_runs_that_never_arrive_are_not_drawn_as_arrived():
    axis = arrivals({"policy": [2.0, None, 1.0, 3.0]}, 20.0).axes[0]
    (line,) = axis.lines
    x, y = line.get_data()
    assert x.tolist() == [1.0, 2.0, 3.0, 20.0]
    assert y.tolist() == [25.0, 50.0, 75.0, 100.0]
    assert axis.get_xlim()[1] < 20.0
