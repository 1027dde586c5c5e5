import os
from pathlib import Path

import pytest

from app.errors import InvalidInput
from app.main import executor_of
from app.settings import Settings, check_access, load_settings
from app.store.engine import Store


@pytest.fixture(autouse=True)
def no_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (
        "HOST",
        "PORT",
        "DATA",
        "DATABASE_URL",
        "TOKEN",
        "TOKEN_FILE",
        "ROOT_PATH",
        "RAY",
        "WORKER_URL",
        "KEEP_JOBS",
        "KEEP_STATES",
    ):
        monkeypatch.delenv(f"TANDEM_{name}", raising=False)


def test_defaults_are_loopback_port_8000_and_a_file_in_the_data_folder() -> None:
    settings = load_settings()
    assert (settings.host, settings.port, settings.is_loopback) == ("127.0.0.1", 8000, True)
    assert settings.database == f"sqlite:///{Path('data').resolve() / 'tandem.db'}"


@pytest.mark.parametrize("name", ["a?b", "p%41q", "100%", "a b+c#d", "ü"])
def test_database_lies_in_the_data_folder_whatever_its_name(tmp_path: Path, name: str) -> None:
    data = tmp_path / name
    data.mkdir()
    store = Store(load_settings(data=data).database)
    assert store.sqlite_path == Store(store.url).sqlite_path == data.resolve() / "tandem.db"


def test_data_folder_that_is_a_link_to_itself_is_refused(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(InvalidInput, match="TANDEM_DATA = .*loop' .* must not be a link to"):
        load_settings(data=str(tmp_path / "loop"))


def test_data_folder_behind_a_link_whose_name_is_no_text_is_refused(tmp_path: Path) -> None:
    folder = os.fsdecode(os.fsencode(tmp_path) + b"/data-\xff")
    os.mkdir(folder)
    (tmp_path / "link").symlink_to(folder)
    with pytest.raises(InvalidInput, match="TANDEM_DATA = .*link' .* must be a path in UTF-8"):
        load_settings(data=str(tmp_path / "link"))


def test_variables_are_read(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("TANDEM_PORT", "8130")
    monkeypatch.setenv("TANDEM_DATA", str(tmp_path))
    monkeypatch.setenv("TANDEM_DATABASE_URL", "postgresql://db/tandem")
    settings = load_settings()
    assert (settings.port, settings.data) == (8130, tmp_path)
    assert settings.database == "postgresql://db/tandem"


def test_command_line_wins_over_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TANDEM_PORT", "8130")
    assert load_settings(port=8131, host=None).port == 8131


@pytest.mark.parametrize(
    ("name", "values", "named"),
    [
        ("TANDEM_PORT", ("abc", "-1", "65536", ""), "TANDEM_PORT"),
        ("TANDEM_DATA", ("", " ", "~/tandem", "data-\udcff"), "TANDEM_DATA"),
        ("TANDEM_KEEP_JOBS", ("0", "1e3", str(2**31), str(10**30)), "TANDEM_KEEP_JOBS"),
        ("TANDEM_KEEP_STATES", ("-1", str(2**31), str(10**30)), "TANDEM_KEEP_STATES"),
        ("TANDEM_RAY", ("", " ", "10.0.0.5:6379 "), "TANDEM_RAY"),
        ("TANDEM_PROT", ("8130",), "TANDEM_PORT"),  # misspelt: the message has the choices
        (
            "TANDEM_WORKER_URL",
            ("lab:8000", "ftp://lab", "http://lab/", "http://lab?a=b"),
            "TANDEM_WORKER_URL",
        ),
    ],
)
def test_bad_variable_is_refused_by_name(
    monkeypatch: pytest.MonkeyPatch, name: str, values: tuple[str, ...], named: str
) -> None:
    for value in values:
        monkeypatch.setenv(name, value)
        with pytest.raises(InvalidInput, match=named):
            load_settings()


@pytest.mark.parametrize(
    ("name", "example"),
    [
        ("RAY", "10.0.0.5:6379"),
        ("WORKER_URL", "http://10.0.0.5:8000"),
        ("ROOT_PATH", "/tandem"),
    ],
)
def test_form_of_a_variable_is_shown_by_an_example_that_is_taken(
    monkeypatch: pytest.MonkeyPatch, name: str, example: str
) -> None:
    monkeypatch.setenv(f"TANDEM_{name}", "a b")
    with pytest.raises(InvalidInput, match=f"TANDEM_{name} = 'a b' must be of the form") as one:
        load_settings()
    assert example in str(one.value)
    monkeypatch.setenv(f"TANDEM_{name}", example)
    assert getattr(load_settings(), name.lower()) == example


def test_value_of_a_misspelt_secret_is_not_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TANDEM_TOKN", "a-token-of-this-server")
    with pytest.raises(InvalidInput, match="TANDEM_TOKN") as refused:
        load_settings()
    assert "a-token" not in f"{refused.value} {refused.value.problem()}"


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.4", "::", "robot.example"])
def test_address_that_others_reach_needs_a_token(host: str) -> None:
    with pytest.raises(InvalidInput, match="TANDEM_TOKEN"):
        check_access(Settings(host=host))


def test_short_token_is_refused_and_not_shown() -> None:
    with pytest.raises(InvalidInput, match="at least 16") as refused:
        check_access(Settings(token="hunter2"))
    assert "hunter2" not in str(refused.value)


def test_empty_token_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TANDEM_TOKEN", "")  # such as of a command that failed
    with pytest.raises(InvalidInput, match="at least 16"):
        check_access(load_settings())


@pytest.mark.parametrize(
    "token", ["schlüssel-schlüssel", " 0123456789abcdef", "0123456789abcdef\n"]
)
def test_token_that_no_header_carries_is_refused(token: str) -> None:
    with pytest.raises(InvalidInput, match="printable ASCII") as refused:
        check_access(Settings(token=token))
    assert token not in str(refused.value)


@pytest.mark.parametrize("end", ["", "\n", "\r\n"])
def test_token_is_read_from_a_file(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, end: str
) -> None:
    file = tmp_path / "token"
    file.write_bytes(f"a-token-of-this-server{end}".encode())
    monkeypatch.setenv("TANDEM_TOKEN_FILE", str(file))
    settings = load_settings(host="0.0.0.0")
    check_access(settings)
    assert settings.secret == "a-token-of-this-server"
    assert "a-token" not in repr(settings)


@pytest.mark.parametrize(
    ("content", "rule"),
    [(None, "cannot be read"), (b"", "at least 16"), (b"\xff" * 20, "printable ASCII")],
)
def test_file_without_a_token_is_refused_by_name(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, content: bytes | None, rule: str
) -> None:
    file = tmp_path / "token"
    if content is not None:
        file.write_bytes(content)
    monkeypatch.setenv("TANDEM_TOKEN_FILE", str(file))
    with pytest.raises(InvalidInput, match=f"TANDEM_TOKEN_FILE = .*{rule}"):
        check_access(load_settings())


def test_token_beside_its_file_is_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "token").write_text("a-token-of-this-server")
    monkeypatch.setenv("TANDEM_TOKEN_FILE", str(tmp_path / "token"))
    monkeypatch.setenv("TANDEM_TOKEN", "another-token-of-it")
    with pytest.raises(InvalidInput, match="must not be set beside TANDEM_TOKEN"):
        load_settings()


@pytest.mark.parametrize("path", ["", "/tandem", "/robots/cell-1"])
def test_root_path_starts_with_a_slash_and_ends_without(path: str) -> None:
    assert load_settings(root_path=path).root_path == path
    for wrong in ("tandem", "/tandem/", "//host", "/a b", "/a?b", '/"x', "/../a\n"):
        with pytest.raises(InvalidInput, match="TANDEM_ROOT_PATH"):
            load_settings(root_path=wrong)


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.9", "localhost", "::1"])
def test_loopback_needs_no_token(host: str) -> None:
    check_access(Settings(host=host))


def test_token_does_not_show_in_the_settings_text() -> None:
    assert "a-secret-of-some-length" not in repr(Settings(token="a-secret-of-some-length"))


@pytest.mark.parametrize(
    ("host", "expected"), [("127.0.0.1", "http://127.0.0.1:8130"), ("::1", "http://[::1]:8130")]
)
def test_workers_find_the_server_by_host_and_port(host: str, expected: str) -> None:
    assert load_settings(host=host, port=8130).worker_address == expected
    proxy = "https://lab.example.org/tandem"
    assert load_settings(host=host, worker_url=proxy).worker_address == proxy


@pytest.mark.parametrize(("host", "port"), [("0.0.0.0", 8000), ("127.0.0.1", 0)])
def test_cluster_needs_an_address_of_the_server(host: str, port: int, tmp_path: Path) -> None:
    settings = load_settings(host=host, port=port, data=tmp_path, ray="10.0.0.5:6379")
    with pytest.raises(InvalidInput, match="TANDEM_WORKER_URL = None must be set for"):
        executor_of(settings, settings.database)
