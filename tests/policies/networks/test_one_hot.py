"""The layer over codes against the plain product with one-hot numbers."""

import pytest
import torch
from torch.nn import functional

from app.policies.networks.one_hot import OneHotLinear


@pytest.mark.parametrize("n", [0, 1, 7])
@pytest.mark.parametrize(
    ("n_places", "n_codes", "n_plain"), [(1, 2, 1), (9, 12, 5), (40, 3, 20)]
)
def test_value_and_gradients_are_those_of_the_plain_product(
    n: int, n_places: int, n_codes: int, n_plain: int
) -> None:
    torch.manual_seed(n)
    layer = OneHotLinear(n_places, n_codes, n_plain, 8)
    codes = torch.randint(0, n_codes, (n, n_places), dtype=torch.uint8)
    codes = codes * (torch.rand(n, n_places) < 0.5)
    plain, above = torch.rand(n, n_plain), torch.randn(n, 8)
    parameters = [layer.weight, layer.plain, layer.bias]

    got = layer(codes, plain)
    one_hot = functional.one_hot(codes.long(), n_codes).flatten(1).float()
    wanted = one_hot @ layer.weight + plain @ layer.plain + layer.bias
    torch.testing.assert_close(got, wanted, rtol=1e-5, atol=1e-5)

    for ours, theirs in zip(
        torch.autograd.grad((got * above).sum(), parameters),
        torch.autograd.grad((wanted * above).sum(), parameters),
        strict=True,
    ):
        torch.testing.assert_close(ours, theirs, rtol=1e-5, atol=1e-5)


def test_initial_weights_are_glorot_uniform_and_biases_zero() -> None:
    torch.manual_seed(0)
    layer = OneHotLinear(20, 10, 20, 64)
    bound = (6 / (20 * 10 + 20 + 64)) ** 0.5
    for weights in (layer.weight, layer.plain):
        assert 0.99 * bound < weights.abs().max() <= bound
        assert weights.std().item() == pytest.approx(bound / 3**0.5, rel=0.02)
    assert not layer.bias.any()


def test_without_plain_numbers_the_result_is_that_of_zeros() -> None:
    torch.manual_seed(0)
    layer = OneHotLinear(9, 12, 5, 8)
    codes = torch.randint(0, 12, (7, 9), dtype=torch.uint8)
    torch.testing.assert_close(layer(codes, None), layer(codes, torch.zeros(7, 5)))
