"""The command line: ``python -m app VERB``; ``--help`` lists the verbs.

The same verbs as the HTTP interface. Results go to standard output (``--json``: one object),
logs to standard error. Exit status 0 whatever the result says, 1 where the machine is in the
way (port taken, database in use), 2 for a wrong call. Each verb loads only what it needs.
"""

import argparse
import json
import logging
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.errors import InvalidInput, NotFound, ServiceError
from app.reading_flags import add_flags, stated_options
from app.settings import Settings, check_access, load_settings
from app.sim.core.kernel_cache import kernel_cache

if TYPE_CHECKING:
    from app.policies.checkpoints.checkpoint import Checkpoint
    from app.policies.training.progress import Progress

ROOT = Path(__file__).resolve().parent.parent
WRONG_CALL = 2
IN_THE_WAY = 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb.

    Args:
        arguments: Command line; that of the process by default.

    Returns:
        The exit status.
    """
    options, rest = parser().parse_known_args(arguments)
    if rest and options.verb != "bench":
        parser().error(f"unknown arguments: {' '.join(rest)}")
    options.rest = rest
    logging.basicConfig(
        level=logging.INFO,
        stream=sys.stderr,
        format="%(asctime)s %(levelname)s %(name)s: %(message)s",
    )
    for chatty in ("alembic", "websockets", "uvicorn"):
        logging.getLogger(chatty).setLevel(logging.WARNING)
    try:
        status: int = options.run(options)
    except (InvalidInput, NotFound) as error:
        print(f"tandem: {error.message}", file=sys.stderr)
        return WRONG_CALL
    except ServiceError as error:
        print(f"tandem: {error.message}", file=sys.stderr)
        return IN_THE_WAY
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return status


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    top = argparse.ArgumentParser(prog="python -m app", description="A robot beside a person.")
    verbs = top.add_subparsers(dest="verb", required=True, metavar="VERB")

    def verb(name: str, run: Callable[[argparse.Namespace], int], text: str) -> Any:
        added = verbs.add_parser(name, help=text, description=text)
        added.set_defaults(run=run)
        return added

    one = verb("serve", run_serve, "Start the service.")
    one.add_argument("--host", help="address to listen on (TANDEM_HOST)")
    one.add_argument("--port", type=int, help="port (TANDEM_PORT)")
    one.add_argument("--data", type=Path, help="data folder (TANDEM_DATA)")
    verb("setup", run_setup, "Create or upgrade the database, compile the kernels.")
    one = verb("train", run_train, "Train a policy here and now, without a server.")
    one.add_argument("preset")
    one.add_argument("--seed", type=int, default=0)
    one.add_argument("--set", action="append", default=[], metavar="FIELD=VALUE", dest="sets")
    one.add_argument("--output", type=Path, default=Path("."), help="folder of the result")
    one.add_argument("--json", action="store_true")
    one = verb("evaluate", run_evaluate, "Measure a checkpoint by a protocol.")
    one.add_argument("protocol")
    one.add_argument(
        "motions", nargs="*", type=Path, metavar="FILE", help="recorded motion (pick-mocap)"
    )
    one.add_argument("--checkpoint", help="alias, SHA-256 or .safetensors file")
    one.add_argument("--episodes", type=int, help="the protocol's own if not given")
    one.add_argument("--seed", type=int, default=11)
    add_flags(one)
    one.add_argument("--json", action="store_true")
    one = verb("bench", run_bench, "Run a benchmark of the checkout; more options go to it.")
    one.add_argument("name")
    one = verb("cells", run_cells, "List, show, check, add or remove work cells.")
    one.add_argument("action", choices=("list", "show", "check", "add", "remove"))
    one.add_argument("target", nargs="?", metavar="FILE|NAME")
    one.add_argument("--json", action="store_true")
    one = verb("motions", run_motions, "Import a recorded human motion; list, show, remove.")
    one.add_argument("action", choices=("import", "list", "show", "remove"))
    one.add_argument("target", nargs="?", metavar="FILE|NAME", help=".bvh, .mot, .sto or .csv")
    one.add_argument("--keep", action="store_true", help="store what is imported")
    one.add_argument("--name", help="name to store it under; the file's by default")
    add_flags(one)
    one.add_argument("--json", action="store_true")
    return top


def run_serve(options: argparse.Namespace) -> int:
    """Start the service; the port is taken before anything else."""
    from app.listening import check_alone, listen

    settings = load_settings(host=options.host, port=options.port, data=options.data)
    check_access(settings)
    sock = listen(settings.host, settings.port)
    check_alone(settings)
    prepare_kernels(settings)
    import torch

    from app.serving import serve

    # Networks this small gain nothing from more; waiting for a busy second core costs 0.3 s.
    torch.set_num_threads(1)
    serve(settings, sock, say=lambda line: print(line, flush=True))
    return 0


def run_setup(_options: argparse.Namespace) -> int:
    """Create or upgrade the database and compile the kernels into their cache."""
    settings = load_settings()
    prepare_kernels(settings)
    from app.store.engine import Store
    from app.store.lock import ServerLock
    from app.store.migrate import migrate

    settings.data.mkdir(parents=True, exist_ok=True)
    store = Store(settings.database)
    lock = ServerLock(store, settings.data)
    lock.acquire()
    try:
        migrate(store)
    finally:
        lock.release()
    print(f"database: {store.shown_url}", flush=True)
    store.close()
    print("compiling the simulator's kernels (several minutes, once) ...", flush=True)
    from app.machine import cores
    from app.warm_up import PARTS, compile_all

    started = time.monotonic()
    for n, (name, cpu_s) in enumerate(compile_all(cores()), 1):
        print(f"    {n} of {len(PARTS)}: {name} ({cpu_s:.0f} CPU seconds)", flush=True)
    print(f"kernels are ready ({time.monotonic() - started:.1f} s)", flush=True)
    return 0


def run_train(options: argparse.Namespace) -> int:
    """Train in this process and write the policy into a folder."""
    settings = load_settings()
    prepare_kernels(settings)
    import torch

    from app.cell_verbs import named_cell
    from app.policies.configs import presets
    from app.policies.training.train import train

    preset = presets.resolve(options.preset, presets.nested(parsed_sets(options.sets)))
    cell = named_cell(preset.cell, settings)
    options.output.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)

    def keep(_step: int, policy: "Checkpoint", _resume: "Checkpoint") -> None:
        (options.output / "policy.safetensors").write_bytes(policy.tensors)
        (options.output / "policy.json").write_text(json.dumps(policy.manifest, indent=1))

    train(
        preset,
        seed=options.seed,
        resume=None,
        on_progress=log_progress,
        on_checkpoint=keep,
        should_stop=lambda: False,
        cell=cell,
    )
    path = options.output / "policy.safetensors"
    print(json.dumps({"checkpoint": str(path)}) if options.json else f"wrote {path}")
    return 0


def log_progress(progress: "Progress") -> None:
    """Say on standard error how far a training is."""
    rates = (
        f"{name} {rate:.3f}"
        for name, rate in (
            ("success", progress.success),
            ("collision", progress.collision),
            ("time-out", progress.timeout),
        )
        if rate is not None
    )
    left = progress.time_left_s
    logging.getLogger("app.train").info(
        "%d of %d steps, %s: %s",
        progress.step,
        progress.total_steps,
        "no updates yet" if left is None else f"{left:.0f} s left",
        ", ".join(rates) or "no episode has ended yet",
    )


def run_evaluate(options: argparse.Namespace) -> int:
    """Run a protocol and print its rows; a bad motion file is told with all its faults."""
    settings = load_settings()
    prepare_kernels(settings)
    import torch

    from app.errors import BadMotion
    from app.machine import describe
    from app.motion_verbs import faulty, runs_of
    from app.policies.evaluation.registry import (
        PROTOCOLS,
        WITHOUT_CHECKPOINT,
        check_motions,
        default_checkpoint,
        evaluate,
    )

    if options.protocol not in PROTOCOLS:
        raise NotFound("protocol", options.protocol, tuple(PROTOCOLS))
    files = [str(path) for path in options.motions]
    check_motions(options.protocol, files, "FILE", f"evaluate {options.protocol} FILE ...")
    try:
        motions = runs_of(options.motions, stated_options(options))
    except BadMotion as error:
        for fault in error.faults:
            print(fault.text, file=sys.stderr)
        if options.json:
            print(json.dumps(faulty(error)))
        return WRONG_CALL
    none = options.protocol in WITHOUT_CHECKPOINT
    wanted = options.checkpoint or default_checkpoint(options.protocol)
    checkpoint = None if none else find_checkpoint(wanted, settings)
    torch.set_num_threads(1)
    result = evaluate(
        options.protocol,
        checkpoint,
        episodes=options.episodes,
        seed=options.seed,
        motions=motions,
    )
    result = {**result, "machine": describe()}
    print(json.dumps(result) if options.json else table(result))
    return 0


def run_bench(options: argparse.Namespace) -> int:
    """Run ``tests/benchmarks/bench_NAME.py`` of the checkout."""
    folder = ROOT / "tests" / "benchmarks"
    names = sorted(
        path.stem.removeprefix("bench_").replace("_", "-") for path in folder.glob("bench_*.py")
    )
    if options.name not in names:
        rule = "is no benchmark of this checkout"
        raise InvalidInput("NAME", options.name, rule, names)
    prepare_kernels(load_settings())
    script = folder / f"bench_{options.name.replace('-', '_')}.py"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, str(script), *options.rest]
    return subprocess.run(command, env=environment, check=False).returncode


def run_cells(options: argparse.Namespace) -> int:
    """List, show, check, add or remove work cells; a bad one is told with all its faults."""
    from app.cell_verbs import run
    from app.errors import BadCell

    settings = load_settings()
    prepare_kernels(settings)
    try:
        text, data = run(options.action, options.target, settings)
    except BadCell as error:
        for fault in error.faults:
            print(f"{options.target}: {fault.text}", file=sys.stderr)
        if options.json:
            print(json.dumps({"ok": False, "faults": [asdict(one) for one in error.faults]}))
        return WRONG_CALL
    print(json.dumps(data) if options.json else text)
    return 0


def run_motions(options: argparse.Namespace) -> int:
    """Import, list, show or remove motions; a bad file is told with all its faults."""
    settings = load_settings()
    prepare_kernels(settings)
    from app.errors import BadMotion
    from app.motion_verbs import faulty, run

    keep, name, stated = options.keep, options.name, stated_options(options)
    try:
        text, data = run(
            options.action, options.target, settings, keep=keep, name=name, options=stated
        )
    except BadMotion as error:
        for fault in error.faults:
            print(f"{options.target}: {fault.text}", file=sys.stderr)
        if options.json:
            print(json.dumps(faulty(error)))
        return WRONG_CALL
    print(json.dumps(data) if options.json else text)
    return 0


def prepare_kernels(settings: Settings) -> None:
    """Keep compiled kernels in the data folder, so that a read-only source tree works."""
    os.environ.setdefault("NUMBA_CACHE_DIR", str(kernel_cache(settings.data)))


def find_checkpoint(reference: str, settings: Settings) -> "Checkpoint":
    """Return a checkpoint by file, shipped alias, or SHA-256 or alias in the database.

    Raises:
        NotFound: There is none.
        Damaged: It is damaged.
    """
    from app.policies.checkpoints import pretrained
    from app.policies.checkpoints.checkpoint import load
    from app.store.engine import Store
    from app.store.schema import check_schema
    from jobs.checkpoints import read_sound

    path = Path(reference)
    if path.suffix == ".safetensors":
        if not path.is_file():
            raise NotFound("checkpoint file", reference)
        manifest = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
        return load(manifest, path.read_bytes())
    if reference in pretrained.ALIASES:
        return pretrained.load(reference)
    if settings.database_url is None and not (settings.data / "tandem.db").exists():
        raise NotFound("checkpoint", reference, tuple(pretrained.ALIASES))
    store = Store(settings.database)
    try:
        check_schema(store)
        record, tensors = read_sound(store, reference)
        return load(record.manifest, tensors)
    finally:
        store.close()


def parsed_sets(sets: Sequence[str]) -> dict[str, Any]:
    """Read ``FIELD=VALUE`` pairs; values are JSON where they can be, text otherwise."""
    overrides: dict[str, Any] = {}
    for pair in sets:
        name, sign, text = pair.partition("=")
        if not sign:
            raise InvalidInput("--set", pair, "must have the form FIELD=VALUE")
        try:
            overrides[name] = json.loads(text)
        except ValueError:
            overrides[name] = text
    return overrides


def table(result: Mapping[str, Any]) -> str:
    """Write a protocol's result for people."""
    rows: Sequence[Mapping[str, Any]] = result["results"]
    columns = list(
        dict.fromkeys(key for row in rows for key in row if not isinstance(row[key], list))
    )
    lines = [columns, *([shown(row.get(key)) for key in columns] for row in rows)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(columns))]
    texts = [
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    ]
    head = f"{result['protocol']}, seed {result['seed']}, {result['episodes']} episodes"
    tested = [f"checkpoint {result['checkpoint']}"] if "checkpoint" in result else []
    return "\n".join([head, *tested, "", *texts])


def shown(value: Any) -> str:
    """Write one value of a row: a rate with its interval, a number, or text."""
    if isinstance(value, Mapping) and {"mean", "low", "high"} <= value.keys():
        mean, low, high = (100.0 * value[key] for key in ("mean", "low", "high"))
        return f"{mean:.1f} % [{low:.1f}, {high:.1f}]"
    if isinstance(value, float):
        return f"{value:.3g}"
    return "" if value is None else str(value)


if __name__ == "__main__":
    sys.exit(main())
