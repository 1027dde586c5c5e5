"""Sign-in of a browser: exchanges the token for a session cookie."""

import hmac
import json
from urllib.parse import parse_qs

from fastapi import APIRouter, Request
from starlette.responses import HTMLResponse, RedirectResponse, Response

from app.api.bodies import FORM
from app.api.security import SESSION_PATH, cookie_name, session_value, sign_in_page
from app.errors import InvalidInput

COOKIE_AGE_S = 30 * 24 * 3600
WRONG = "This is not the token of this server."

router = APIRouter(include_in_schema=False)


@router.post(SESSION_PATH)
async def sign_in(request: Request) -> Response:
    """Check the token of a form or of JSON and answer with the cookie."""
    token: str | None = request.app.state.token
    body = await request.body()
    is_form = request.headers.get("content-type", "").startswith(FORM)
    if is_form:
        given = parse_qs(body.decode("utf-8", "replace")).get("token", [""])[0]
    else:
        given = _from_json(body)
    proof = given.encode("utf-8", "replace")
    if token is not None and not hmac.compare_digest(proof, token.encode()):
        if is_form:  # A browser shows the answer as it is.
            page = sign_in_page(request.scope.get("root_path", ""), WRONG)
            return HTMLResponse(page, 422)
        raise InvalidInput("token", "***", "is not the token of this server")
    answer = RedirectResponse("/", 303) if is_form else Response(status_code=204)
    if token is not None:
        answer.set_cookie(
            cookie_name(token),
            session_value(token),
            max_age=COOKIE_AGE_S,
            path=request.scope.get("root_path") or "/",
            httponly=True,
            samesite="strict",
            secure=request.url.scheme == "https",
        )
    return answer


def _from_json(body: bytes) -> str:
    try:
        given = json.loads(body)["token"]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InvalidInput("token", None, "is required") from error
    if not isinstance(given, str):
        raise InvalidInput("token", "***", "must be a string")
    return given
