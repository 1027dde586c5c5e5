"""Generated requests get no answer that the OpenAPI document does not describe."""

from collections.abc import Iterator

import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from schemathesis import GenerationMode

from app.main import create_app
from app.settings import Settings
from tests.api.live_server import running, wait_until_ready
from tests.api.test_hostile_values import API, ROUTES

N_REQUESTS = 8
"""Requests of each kind per operation; they are the same in every run."""
document = schemathesis.openapi.from_dict(
    API,
    config=schemathesis.Config.from_dict(
        # Rules beyond the schema, such as names that exist, refuse valid requests.
        {"checks": {"positive_data_acceptance": {"enabled": False}}}
    ),
)
document.config.generation.codec = None
"""Texts have all characters but surrogates, as with UTF-8, whose test of each takes seconds."""


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    app = create_app(Settings(data=tmp_path_factory.mktemp("described")))
    with running(app) as (_, found):
        wait_until_ready(found)
        app.state.services.supervisor.stop()  # some requests post jobs, which need not run
        yield found


def takes_values(method: str, path: str) -> bool:
    """Whether an operation has values that can break its schema.

    Any text fits a path or a header.
    """
    operation = API["paths"][path][method]
    return "requestBody" in operation or any(
        one["in"] == "query" for one in operation.get("parameters", [])
    )


CASES = [(*route, GenerationMode.POSITIVE) for route in ROUTES]
CASES += [(*route, GenerationMode.NEGATIVE) for route in ROUTES if takes_values(*route)]


@pytest.mark.parametrize(("method", "path", "kind"), CASES)
def test_answer_to_generated_requests_is_described(
    address: str, method: str, path: str, kind: GenerationMode
) -> None:
    strategy = document[path][method].as_strategy(generation_mode=kind)

    @settings(
        max_examples=N_REQUESTS,
        derandomize=True,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(case=strategy)
    def ask(case: schemathesis.Case) -> None:
        case.call_and_validate(base_url=address)

    ask()
