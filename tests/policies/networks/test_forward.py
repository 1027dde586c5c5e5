"""Forward passes without torch, compared with the modules of torch."""

import numpy as np
import pytest
import torch
from torch import nn

from app.policies.networks.actor_critic import hidden
from app.policies.networks.forward import (
    MANY,
    centred_layers_of,
    forward_few,
    forward_many,
    new_columns,
    new_units,
)


@pytest.mark.parametrize("n", [1, 3, 300, MANY])
@pytest.mark.parametrize(("layers", "normed"), [(1, False), (2, True), (3, True)])
def test_outputs_are_those_of_torch(n: int, layers: int, normed: bool) -> None:
    torch.manual_seed(n)
    network = nn.Sequential(*hidden(20, 32, layers, normed), nn.Linear(32, 3))
    for parameter in network.parameters():
        nn.init.normal_(parameter, std=0.3)
    x = torch.randn(n, 20)
    x[:, 5:15] = x[0, 5:15].clone()
    varying = (x != x[0]).any(dim=0).numpy()
    with torch.inference_mode():
        expected = network(x).numpy()
    weights, found = centred_layers_of(network), np.empty((n, 3), dtype=np.float32)
    units = new_units([weights], n)
    forward_few(weights, x.numpy(), varying, units, found)
    np.testing.assert_allclose(found, expected, atol=1e-5)
    rows = x.numpy()
    differing, work = np.ascontiguousarray(rows[:, varying].T), new_columns([weights])
    many = forward_many(weights, differing, rows[:1], varying, work)
    np.testing.assert_allclose(many.T, expected, atol=1e-5)
