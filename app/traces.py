"""Traces for OpenTelemetry: off unless ``OTEL_EXPORTER_OTLP_ENDPOINT`` is set.

The SDK is an extra (``otel``) and read only then; it has further standard variables, such as
``OTEL_SERVICE_NAME`` and ``OTEL_TRACES_SAMPLER``.
"""

import importlib
import os
import threading

from opentelemetry.trace import TracerProvider

from app.errors import MissingPackage

VARIABLES = ("OTEL_EXPORTER_OTLP_ENDPOINT", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT")
EXPORT_S = 2.0
"""Time for the export of the last spans when the service stops [s]."""


def provider_of_environment() -> TracerProvider | None:
    """Return the provider that exports spans; None where no endpoint is set.

    Raises:
        MissingPackage: The SDK is not installed.
    """
    if not any(map(os.environ.get, VARIABLES)):
        return None
    try:
        sdk = importlib.import_module("opentelemetry.sdk.trace")
        export = importlib.import_module("opentelemetry.sdk.trace.export")
        otlp = importlib.import_module("opentelemetry.exporter.otlp.proto.http.trace_exporter")
    except ImportError:
        remedy = ".venv/bin/pip install '.[otel]', or unset OTEL_EXPORTER_OTLP_ENDPOINT"
        raise MissingPackage("opentelemetry-sdk", "the export of traces", remedy) from None
    os.environ.setdefault("OTEL_SERVICE_NAME", "tandem")
    provider: TracerProvider = sdk.TracerProvider()
    provider.add_span_processor(export.BatchSpanProcessor(otlp.OTLPSpanExporter()))  # type: ignore[attr-defined]
    return provider


def finish(provider: TracerProvider) -> None:
    """Export the last spans; a signal ends the process without the handlers of its exit."""
    export = threading.Thread(
        target=provider.shutdown,  # type: ignore[attr-defined]
        name="last-spans",
        daemon=True,
    )
    export.start()
    export.join(EXPORT_S)
