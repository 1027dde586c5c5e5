"""One method per operation of the OpenAPI document; written by ``make client``.

Bodies are the service's own schemas, or mappings of their JSON. A problem raises ``Refused``.
"""

from app.client.operations.cells import CellsOperations
from app.client.operations.checkpoints import CheckpointsOperations
from app.client.operations.deciding import DecidingOperations
from app.client.operations.health import HealthOperations
from app.client.operations.jobs import JobsOperations
from app.client.operations.recordings import RecordingsOperations
from app.client.operations.results import ResultsOperations
from app.client.operations.trackers import TrackersOperations
from app.client.operations.worlds import WorldsOperations

__all__ = ["Client"]


class Client(
    CellsOperations,
    CheckpointsOperations,
    DecidingOperations,
    HealthOperations,
    JobsOperations,
    RecordingsOperations,
    ResultsOperations,
    TrackersOperations,
    WorldsOperations,
):
    """The operations of a server."""
