"""Settings of the service: the ``TANDEM_*`` environment variables, checked at start.

Only ``app.main``, ``app.cli`` and ``jobs.run`` read them; every other part has plain arguments.
"""

import ipaddress
import os
import re
from pathlib import Path
from typing import Literal

from pydantic import Field, SecretStr, ValidationError, field_validator
from pydantic_core import PydanticCustomError
from pydantic_settings import BaseSettings, SettingsConfigDict

from app.errors import InvalidInput

PREFIX = "TANDEM_"
MIN_TOKEN_LENGTH = 16
MAX_KEPT = 2**31 - 1
"""Greatest number of jobs or states to keep; every database takes it in a query."""
_TOKEN = re.compile(r"[!-~]([ -~]*[!-~])?")
"""A token that arrives in a header as it was sent."""


class Settings(BaseSettings):
    """Settings of a server, one attribute per variable."""

    model_config = SettingsConfigDict(env_prefix=PREFIX, frozen=True, extra="forbid")

    host: str = Field("127.0.0.1", min_length=1, description="Address to listen on.")
    port: int = Field(8000, ge=0, le=65535, description="Port; 0 takes any free one.")
    data: Path = Field(Path("data"), description="Folder for the database and files.")
    database_url: str | None = Field(
        None, min_length=1, description="SQLAlchemy URL; a SQLite file in `data` if unset."
    )
    ray: str | None = Field(
        None,
        pattern=r"^\S+$",
        examples=["auto", "10.0.0.5:6379"],
        description="Ray cluster that runs the jobs; this machine if unset.",
    )
    max_jobs: int = Field(1, ge=1, le=1000, description="Jobs that run at once.")
    worker_url: str | None = Field(
        None,
        pattern=r"^https?://[^/?#]+(/[A-Za-z0-9._~-]+)*$",
        examples=["http://10.0.0.5:8000", "https://lab.example.org/tandem"],
        description="Address of this server for workers on other machines.",
    )
    token: SecretStr | None = Field(
        None, description="Bearer token; required for any address but loopback."
    )
    token_file: Path | None = Field(
        None, description="File with the token, in place of `token`, such as of a secret."
    )
    log: Literal["text", "json"] = Field("text", description="Form of the log's lines.")
    keep_jobs: int = Field(
        1000,
        ge=1,
        le=MAX_KEPT,
        description="Ended jobs to keep; older ones are deleted with their files.",
    )
    keep_states: int = Field(
        5,
        ge=0,
        le=MAX_KEPT,
        description="Jobs that can be resumed, the newest that were cancelled, failed or were "
        "ended by a budget.",
    )
    root_path: str = Field(
        "",
        pattern=r"^(/[A-Za-z0-9._~-]+)*$",
        examples=["/tandem", "/lab/tandem"],
        description="Path that a reverse proxy removes from requests, such as `/tandem`.",
    )

    @field_validator("data", mode="before")
    @classmethod
    def check_data(cls, value: object) -> object:
        """Refuse texts of the environment that would silently be another folder."""
        if isinstance(value, str) and (not value.strip() or value.startswith("~")):
            rule = "must be the path of a folder, without ~, which only a shell replaces"
            raise PydanticCustomError("folder", rule)
        return value

    @field_validator("data")
    @classmethod
    def check_path(cls, value: Path) -> Path:
        """Refuse a folder behind a loop of links, and one whose path is no UTF-8."""
        try:
            str(value.resolve()).encode()
        except RuntimeError:
            raise PydanticCustomError("folder", "must not be a link to itself") from None
        except UnicodeEncodeError:
            raise PydanticCustomError("folder", "must be a path in UTF-8") from None
        return value

    @property
    def is_loopback(self) -> bool:
        """Whether the server is accessible from this machine only."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    @property
    def database(self) -> str:
        """The effective database URL."""
        path = str(self.data.resolve() / "tandem.db").replace("%", "%25").replace("?", "%3F")
        return self.database_url or f"sqlite:///{path}"

    @property
    def worker_address(self) -> str:
        """The effective address for workers on other machines."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return self.worker_url or f"http://{host}:{self.port}"

    @property
    def secret(self) -> str | None:
        """The token as text, or None."""
        return None if self.token is None else self.token.get_secret_value()


def load_settings(**overrides: object) -> Settings:
    """Read the settings from the environment and check them.

    Args:
        **overrides: Values in place of the environment's; None is ignored.

    Raises:
        InvalidInput: A variable is unknown or breaks a rule.
    """
    known = [PREFIX + name.upper() for name in Settings.model_fields]
    for name in sorted(os.environ):
        if name.startswith(PREFIX) and name not in known:
            raise InvalidInput(name, "***", "is not a setting", known)  # a misspelt secret
    try:
        given = {k: v for k, v in overrides.items() if v is not None}
        return _with_token(Settings(**given))  # type: ignore[arg-type]
    except ValidationError as error:
        first = error.errors()[0]
        field = "_".join(str(part) for part in first["loc"])
        shown, rule = first["input"], f"is refused: {first['msg']}"
        if first["type"] == "string_pattern_mismatch":
            examples = Settings.model_fields[field].examples or ()
            rule = f"must be of the form {' or '.join(map(str, examples))}"
        if field.endswith("token"):
            shown = "***"
        raise InvalidInput(PREFIX + field.upper(), shown, rule) from None


def _with_token(settings: Settings) -> Settings:
    """Return the settings with the token of its file, without the end of its line.

    Raises:
        InvalidInput: The file cannot be read, or a token is given, too.
    """
    file = settings.token_file
    if file is None:
        return settings
    name = f"{PREFIX}TOKEN_FILE"
    if settings.token is not None:
        raise InvalidInput(name, str(file), f"must not be set beside {PREFIX}TOKEN")
    try:
        token = file.read_bytes().decode(errors="replace").rstrip("\r\n")
    except OSError as error:
        raise InvalidInput(name, str(file), f"cannot be read: {error.strerror}") from None
    return settings.model_copy(update={"token": SecretStr(token)})


def make_data_folder(settings: Settings) -> None:
    """Make the data folder if it is missing.

    Raises:
        InvalidInput: It cannot be made, or a file has its name.
    """
    try:
        settings.data.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        rule = f"must be a folder that exists or can be made: {error.strerror}"
        raise InvalidInput(f"{PREFIX}DATA", str(settings.data), rule) from None


def check_access(settings: Settings) -> None:
    """Check that the settings protect the service.

    Raises:
        InvalidInput: A token is missing, too short, or cannot be sent in a header.
    """
    token = settings.secret
    name = PREFIX + ("TOKEN" if settings.token_file is None else "TOKEN_FILE")
    if token is None and not settings.is_loopback:
        raise InvalidInput(
            "TANDEM_HOST",
            settings.host,
            "is not a loopback address and needs TANDEM_TOKEN or TANDEM_TOKEN_FILE to be set",
        )
    if token is not None and len(token) < MIN_TOKEN_LENGTH:
        raise InvalidInput(name, "***", f"must have at least {MIN_TOKEN_LENGTH} characters")
    if token is not None and not _TOKEN.fullmatch(token):
        rule = "must consist of printable ASCII characters and not begin or end with a space"
        raise InvalidInput(name, "***", rule)
