import json
import os
import signal
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.cli.entry import main
from app.cli.output import table
from app.cli.preflight import address_of, listen
from app.cli.train import parse_overrides
from app.errors import InvalidInput
from app.precompile import PARTS
from tests.policies.evaluation.sorting_players import untrained
from tests.sim.recorded_person import csv_text, working
from tests.support import workshop

ROOT = Path(__file__).resolve().parents[2]
START_S, COMPILE_S = 240.0, 1200.0


def environment(data: Path, **more: str) -> dict[str, str]:
    kept = {k: v for k, v in os.environ.items() if not k.startswith("TANDEM_")}
    return {**kept, "TANDEM_DATA": str(data), "PYTHONUNBUFFERED": "1", **more}


def run(
    *arguments: str, data: Path, timeout: float = START_S, **more: str
) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "app", *arguments]
    return subprocess.run(
        command,
        cwd=ROOT,
        env=environment(data, **more),
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


def test_setup_makes_the_database_and_compiles_every_part(tmp_path: Path) -> None:
    done = run("setup", data=tmp_path, timeout=COMPILE_S)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "tandem.db").stat().st_size > 0
    for name in PARTS:
        assert f": {name} (" in done.stdout
    assert f"{len(PARTS)} of {len(PARTS)}: " in done.stdout
    assert "kernels are ready" in done.stdout


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["fly"],
        ["serve", "--port", "x"],
        ["evaluate"],
        ["evaluate", "pick-luck"],
        ["evaluate", "pick-single", "--episodes", "0"],
        ["evaluate", "pick-single", "--checkpoint", "best"],
        ["evaluate", "pick-single", "--colour", "red"],
        ["train", "pick-td4"],
        ["train", "pick-td3", "--set", "gamma=2"],
        ["train", "pick-td3", "--set", "gamma"],
        ["bench", "nothing"],
        ["cells", "check"],
        ["cells", "check", "nothing.json"],
        ["cells", "show"],
        ["cells", "show", "kitchen"],
        ["cells", "remove", "kitchen"],
        ["cells", "add", "/"],
        ["recordings"],
        ["recordings", "import"],
        ["recordings", "import", "nobody.bvh"],
        ["recordings", "import", "/"],
        ["train", "pick-td3", "--set", "cell=kitchen"],
        ["train", "pick-td3", "--set", "x=" + 100_000 * "["],
        ["evaluate", "pick-single", "--episodes", "1", "--checkpoint", ""],
        ["serve", "--data", ""],
        ["serve", "--data", "~/tandem"],
    ],
)
def test_wrong_call_ends_with_status_2(
    arguments: list[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "value"), [("TANDEM_PORT", "no"), ("TANDEM_PROT", "8000"), ("TANDEM_TOKEN", "x")]
)
def test_bad_setting_stops_the_start_with_status_2(
    name: str, value: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(name, value)
    assert main(["serve"]) == 2
    assert name in capsys.readouterr().err


def test_evaluation_prints_one_json_object(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", "pick-single", "--episodes", "8", "--seed", "3", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["protocol"], result["seed"], result["episodes"]) == ("pick-single", 3, 8)
    assert result["results"][0]["name"] == "policy"
    assert {"mean", "low", "high"} <= result["results"][0]["success"].keys()
    assert result["machine"]["cores"] >= 1
    assert "policy" in table(result)


def test_sorting_of_a_policy_file_prints_one_json_object_and_a_table_without_pairs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    policy, path = untrained(), tmp_path / "policy.safetensors"
    path.write_bytes(policy.tensors)
    path.with_suffix(".json").write_text(json.dumps(policy.manifest))
    call = ["evaluate", "sorting-grid", "--checkpoint", str(path), "--episodes", "1"]
    assert main([*call, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["protocol"], result["episodes"]) == ("sorting-grid", 1)
    assert result["checkpoint"] == policy.sha256
    row = result["results"][0]
    assert (row["name"], row["n"], len(row["pairs"])) == ("clean", 55, 55)
    assert {"mean", "low", "high"} <= row["worst_pair"].keys()
    assert "pairs_below" in table(result) and "'n_goal'" not in table(result)


@pytest.mark.parametrize("manifest", [None, "", "{bad", "\udc80", "[" * 100_000])
def test_policy_file_without_a_manifest_beside_it_is_refused_with_the_path(
    manifest: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "policy.safetensors"
    path.write_bytes(untrained().tensors)
    if manifest is not None:
        path.with_suffix(".json").write_bytes(manifest.encode(errors="surrogateescape"))
    assert main(["evaluate", "sorting-grid", "--checkpoint", str(path)]) == 2
    rule = "cannot be read: No such file" if manifest is None else "must be the checkpoint's"
    assert f"FILE = '{tmp_path}/policy.json' {rule}" in capsys.readouterr().err


def test_folder_that_cannot_be_made_is_named_without_a_traceback(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    folder = tmp_path / "file" / "data"
    monkeypatch.setenv("TANDEM_DATA", str(folder))
    (tmp_path / "clip.csv").write_text(csv_text(working(100)))
    for command in (["recordings", "import", str(tmp_path / "clip.csv"), "--keep"], ["setup"]):
        assert main(command) == 2
        rule = "must be a folder that exists or can be made: Not a directory"
        assert capsys.readouterr().err == f"tandem: TANDEM_DATA = '{folder}' {rule}\n"


def test_missing_library_of_the_system_is_one_line(tmp_path: Path) -> None:
    fault = "libgomp.so.1: cannot open shared object file: No such file or directory"
    (tmp_path / "pinocchio.py").write_text(f"raise ImportError({fault!r})\n")
    ended = run("cells", "list", data=tmp_path / "data", PYTHONPATH=str(tmp_path))
    assert ended.returncode == 1
    assert ended.stderr == f"tandem: a library of the system is missing: {fault}\n"


@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
def test_file_whose_name_cannot_be_printed_is_imported(tmp_path: Path, encoding: str) -> None:
    path = os.fsencode(tmp_path) + b"/B\xe4r \xc3\xa4.csv"
    Path(os.fsdecode(path)).write_text(csv_text(working(100)))
    name = os.fsdecode(path)
    done = run("recordings", "import", name, data=tmp_path, PYTHONIOENCODING=encoding)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("B\\udce4r ") and "clean runs: 1" in done.stdout


@pytest.mark.parametrize("seed", ["-1", str(2**31)])
def test_training_with_a_seed_out_of_range_is_refused_before_it_starts(
    seed: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["train", "pick-td3", "--seed", seed, "--output", str(tmp_path / "a")]) == 2
    assert "Invalid value for '--seed'" in capsys.readouterr().err
    assert not (tmp_path / "a").exists()


def test_the_table_shows_nested_values_as_text() -> None:
    rate = {"mean": 0.5, "low": 0.25, "high": 0.75}
    row = {"expected": {"first": None, "switches": [1, None]}, "beside": {"nearest": rate}}
    result = {"protocol": "pick-cases", "seed": 1, "episodes": 4, "results": [row]}
    assert table(result).splitlines()[-1] == "switches 1 to any  nearest 50.0 % [25.0, 75.0]"


def test_a_policy_that_picks_cannot_be_measured_at_sorting(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["evaluate", "sorting-grid", "--checkpoint", "pick", "--episodes", "1"]) == 2
    assert "must be a policy that sorts for sorting-grid" in capsys.readouterr().err


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    """A good motion file."""
    path = tmp_path / "wave.csv"
    path.write_text(csv_text(working(100)), encoding="utf-8")
    return path


def test_evaluation_beside_recorded_people_has_a_row_for_them(
    clip: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["evaluate", "pick-mocap", str(clip), "--episodes", "4", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in result["results"]] == ["library", "recorded"]
    assert result["settings"]["motions"][0]["source"].startswith("wave.csv (")


def test_motion_files_are_asked_for_and_refused_by_protocol(
    clip: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["evaluate", "pick-mocap"]) == 2
    assert "FILE = [] must hold at least one" in (printed := capsys.readouterr().err)
    assert "evaluate pick-mocap FILE ..." in printed
    assert main(["evaluate", "pick-single", str(clip)]) == 2
    printed = capsys.readouterr().err
    assert "wave.csv'] must not be given to pick-single" in printed and "pick-mocap" in printed
    assert main(["evaluate", "pick-mocap", str(clip.with_name("none.csv"))]) == 2
    assert "cannot be read: No such file" in capsys.readouterr().err


def test_every_fault_of_every_bad_motion_file_is_reported(
    clip: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    torn, wrong = clip.with_name("torn.csv"), clip.with_name("wrong.txt")
    torn.write_text(clip.read_text()[:300], encoding="utf-8")
    wrong.write_text("x", encoding="utf-8")
    files = [str(path) for path in (torn, clip, wrong)]
    assert main(["evaluate", "pick-mocap", *files, "--json"]) == 2
    printed = capsys.readouterr()
    faults = json.loads(printed.out)["faults"]
    lines = printed.err.splitlines()
    assert len(lines) == len(faults) >= 2
    assert lines[0].startswith(f"{torn}: ") and lines[-1].startswith(f"{wrong}: file_name")
    assert [fault["place"].split(": ")[0] for fault in faults][-1] == str(wrong)


def test_cells_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["cells", "list", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["cells"][0]["name"] == "pick-and-place"


@pytest.fixture
def cell_file(tmp_path: Path) -> Path:
    """A good cell of the user's own."""
    path = tmp_path / "workshop.json"
    path.write_text(json.dumps(workshop.definition()), encoding="utf-8")
    return path


def test_shipped_cell_file_is_good_and_a_broken_one_is_named(
    cell_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shipped = ROOT / "app" / "sim" / "cells" / "data" / "sorting-e1.json"
    assert main(["cells", "check", str(shipped)]) == 0
    assert "23 stations" in capsys.readouterr().out
    cell_file.write_text(json.dumps(workshop.definition(wheels=4)), encoding="utf-8")
    assert main(["cells", "check", str(cell_file)]) == 2
    assert "wheels = 4 is not a known field" in capsys.readouterr().err


def test_every_fault_of_a_cell_file_is_a_line_and_an_object(
    cell_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = workshop.definition()
    cell["robot"]["dt"], cell["robot"]["tool_length"] = -1.0, 120.0
    cell_file.write_text(json.dumps(cell), encoding="utf-8")
    assert main(["cells", "check", str(cell_file), "--json"]) == 2
    printed = capsys.readouterr()
    faults = json.loads(printed.out)["faults"]
    assert [fault["place"] for fault in faults] == ["robot.tool_length", "robot.dt"]
    assert "millimetres" in faults[0]["hint"]
    assert len(printed.err.splitlines()) == 2


@pytest.mark.parametrize("content", [b"", b"\xff", b"[" * 9999, b"{}", b"0", b"\x00" * 999])
def test_file_that_is_no_cell_never_gives_a_traceback(
    cell_file: Path, capsys: pytest.CaptureFixture[str], content: bytes
) -> None:
    cell_file.write_bytes(content)
    assert main(["cells", "check", str(cell_file)]) == 2
    assert "Traceback" not in capsys.readouterr().err


def test_own_cell_is_added_shown_listed_and_removed(
    cell_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["cells", "add", str(cell_file)]) == 0
    assert main(["cells", "add", str(cell_file)]) == 0
    assert "was stored already" in capsys.readouterr().out
    assert main(["cells", "list"]) == 0
    assert "workshop" in capsys.readouterr().out
    assert main(["cells", "show", "workshop"]) == 0
    assert json.loads(capsys.readouterr().out)["name"] == "workshop"
    assert main(["cells", "remove", "workshop"]) == 0
    assert main(["cells", "show", "workshop"]) == 2


def test_cell_with_a_taken_name_is_refused(
    cell_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["cells", "add", str(cell_file)])
    cell_file.write_text(json.dumps(workshop.definition(title="Changed")), encoding="utf-8")
    assert main(["cells", "add", str(cell_file)]) == 1
    assert "remove it first" in capsys.readouterr().err
    assert main(["cells", "remove", "pick-and-place"]) == 1
    assert "reserved" in capsys.readouterr().err


def test_values_of_overrides_are_json_where_they_can_be() -> None:
    assert parse_overrides(["gamma=0.9", "name=x"]) == {"gamma": 0.9, "name": "x"}
    with pytest.raises(InvalidInput, match="FIELD=VALUE"):
        parse_overrides(["gamma"])


def test_address_of_an_open_server_is_one_that_a_browser_takes() -> None:
    with listen("0.0.0.0", 0) as sock:
        assert address_of(sock) == f"http://127.0.0.1:{sock.getsockname()[1]}"


def test_address_that_is_not_ours_is_refused() -> None:
    with pytest.raises(InvalidInput, match="TANDEM_HOST"):
        listen("192.0.2.1", 0)
    with socket.socket(), pytest.raises(InvalidInput, match="TANDEM_HOST"):
        listen("no-such-host.invalid", 0)
    with pytest.raises(InvalidInput, match="TANDEM_HOST"):
        listen(f"{'a' * 64}.example", 0)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[int, Path]]:
    """A server started as people start it; yields its port and data folder.

    Its tests are the last of this module, because its live cell takes processor time.
    """
    data = tmp_path_factory.mktemp("served")
    with listen("127.0.0.1", 0) as sock:
        port = sock.getsockname()[1]
    process = subprocess.Popen(
        [sys.executable, "-m", "app", "serve"],
        cwd=ROOT,
        env=environment(data, TANDEM_PORT=str(port)),
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    with process.stdout as lines:
        for line in lines:
            if line.startswith("Tandem is ready"):
                assert f"http://127.0.0.1:{port}" in line
                break
        yield port, data
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=30.0) == -signal.SIGTERM


def test_served_address_answers(server: tuple[int, Path]) -> None:
    with urllib.request.urlopen(f"http://127.0.0.1:{server[0]}/healthz") as answer:
        assert json.load(answer)["status"] == "ok"


def test_second_server_on_the_port_says_so_in_one_line(
    server: tuple[int, Path], tmp_path: Path
) -> None:
    second = run("serve", data=tmp_path / "other", TANDEM_PORT=str(server[0]))
    assert second.returncode == 1
    assert second.stderr.count("\n") == 1
    assert f"another program already listens on 127.0.0.1:{server[0]}" in second.stderr
    assert not (tmp_path / "other").exists()


def test_second_server_on_the_database_says_so_in_one_line(server: tuple[int, Path]) -> None:
    second = run("serve", data=server[1], TANDEM_PORT="0")
    assert second.returncode == 1
    assert second.stderr.count("\n") == 1
    assert "another Tandem server" in second.stderr
