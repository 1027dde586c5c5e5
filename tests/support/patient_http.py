"""HTTP requests of tests, with the time that an answer may take on a busy machine."""

from functools import partial

import httpx

PATIENCE_S = 300.0

get = partial(httpx.get, timeout=PATIENCE_S)
post = partial(httpx.post, timeout=PATIENCE_S)
put = partial(httpx.put, timeout=PATIENCE_S)
delete = partial(httpx.delete, timeout=PATIENCE_S)
stream = partial(httpx.stream, timeout=PATIENCE_S)
