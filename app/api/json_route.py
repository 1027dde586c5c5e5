"""Routes of decisions: bodies validated as JSON bytes.

Source: FastAPI's extension point for routes, ``APIRoute.get_route_handler``.
"""

from collections.abc import Callable, Coroutine
from typing import Any, get_type_hints

from fastapi.routing import APIRoute
from pydantic import BaseModel, ValidationError
from starlette.requests import Request
from starlette.responses import Response

from app.api.services import services_of


class JsonRoute(APIRoute):
    """Route of an asynchronous function of a body, ``request``, and the services.

    The body is validated as bytes, without Python objects in between. A body that does not
    match its schema is passed to FastAPI's own handler, which writes the problem.
    """

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return the handler of the route."""
        ordinary, decide = super().get_route_handler(), self.endpoint
        model: type[BaseModel] = get_type_hints(decide)["request"]

        async def handle(request: Request) -> Response:
            try:
                body = model.model_validate_json(await request.body())
            except ValidationError:
                return await ordinary(request)
            answer: BaseModel = await decide(body, services_of(request))
            content = answer.__pydantic_serializer__.to_json(answer)
            return Response(content, media_type="application/json")

        return handle
