"""Options that several commands have, and the environment that every command prepares."""

import logging
import os
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from app.settings import Settings
    from app.sim.mocap.read_options import ReadOptions

logger = logging.getLogger(__name__)

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
Unit = Annotated[
    str | None, typer.Option(help="Unit of the lengths, such as cm, or metres per unit.")
]
RootUnit = Annotated[
    str | None, typer.Option(metavar="UNIT", help="Unit of the root's path, if another.")
]
Up = Annotated[
    str | None, typer.Option(metavar="AXIS", help="Axis that points up: x, y, z, -x, -y, -z.")
]
Map = Annotated[
    list[str] | None,
    typer.Option(
        "--map",
        metavar="THEIRS=OURS",
        help="Meaning of a joint or column of the file; may be repeated.",
    ),
]


def read_options(
    unit: str | None, root_unit: str | None, up: str | None, names: list[str] | None
) -> "ReadOptions":
    """Return the options for reading a recording.

    Raises:
        InvalidInput: Not a unit, an axis or a pair of names.
    """
    from app.sim.mocap.read_options import ReadOptions, name_map

    return ReadOptions(unit=unit, root_unit=root_unit, up=up, names=name_map(names or []))


def prepared_settings(
    *, host: str | None = None, port: int | None = None, data: str | None = None
) -> "Settings":
    """Read the settings and keep compiled kernels in the data folder.

    Must run before a kernel is imported. A read-only source tree works this way. The arguments
    replace ``TANDEM_HOST``, ``TANDEM_PORT`` and ``TANDEM_DATA``.

    Raises:
        InvalidInput: A setting is unknown or breaks a rule.
    """
    from app import logs
    from app.settings import load_settings
    from app.sim.core.kernel_cache import kernel_cache

    settings = load_settings(host=host, port=port, data=data)
    logs.set_up(settings.log)
    os.environ.setdefault("NUMBA_CACHE_DIR", str(kernel_cache(settings.data)))
    return settings


def check_kernels_kept(settings: "Settings") -> None:
    """Log a warning if the data folder cannot keep compiled kernels; for commands that compile.

    Another folder that is set as ``NUMBA_CACHE_DIR`` is not checked.
    """
    from app.sim.core.kernel_cache import kernel_cache

    folder = kernel_cache(settings.data)
    if os.environ.get("NUMBA_CACHE_DIR") != str(folder):
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
        TemporaryFile(dir=folder).close()
    except OSError as error:
        logger.warning(
            "compiled kernels cannot be kept in TANDEM_DATA = %s, so that later commands may "
            "compile them again: %s",
            settings.data,
            error.strerror,
        )
