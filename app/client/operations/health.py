"""Operations with the tag health; written by ``make client``."""

from app.api.routes.health import HealthPublic, ReadinessPublic
from app.client.transport import Transport


class HealthOperations(Transport):
    """Operations with the tag health."""

    def health(self) -> HealthPublic:
        """200 while the process answers."""
        return self._parsed(HealthPublic, "GET /healthz")

    def ready(self) -> ReadinessPublic:
        """200 when the service can decide."""
        return self._parsed(ReadinessPublic, "GET /readyz")

    def scrape(self) -> str:
        """Metrics for Prometheus."""
        return self._send("GET /metrics").text
