"""HyperQueue's program `hq`, as far as `ballbot --cluster hyperqueue` needs it, by its Python module:
PyPI has the module only. Server, workers and tasks are HyperQueue's own; there is no journal.

hq.py [--server-dir DIR] [--output-mode json] COMMAND, where COMMAND is
    server start | server info | worker start --cpus 1 | submit ... | job info ID | job forget ID
"""

import json
import os
import shutil
import sys
import tempfile
import time
from pathlib import Path

from hyperqueue import Client, Job, LocalCluster
from hyperqueue.cluster import WorkerConfig

ONE_CORE = WorkerConfig(cores=1)


class Seen(Exception):
    """The server has said how a job fares."""


def access(server_dir: str) -> Path:
    """The file by which a server is found, once it is there."""
    deadline = time.monotonic() + 30.0
    while time.monotonic() < deadline:
        for found in Path(server_dir).glob("hq-current/access.json"):
            return found
        time.sleep(0.1)
    raise RuntimeError(f"no HyperQueue server in {server_dir}")


def wait() -> None:
    while True:
        time.sleep(1.0)


def start_server(server_dir: str) -> None:
    with LocalCluster(server_dir, None):
        wait()


def start_worker(server_dir: str) -> None:
    # The module starts workers of its own server only: it is shown the other one in its place.
    with tempfile.TemporaryDirectory() as own, LocalCluster(own) as local:
        shutil.copy(access(server_dir), access(own))
        local.start_worker(ONE_CORE)
        wait()


def numbers(ranges: str) -> list[int]:
    """1,3-5 as numbers."""
    ends = [[int(end) for end in part.split("-")] for part in ranges.split(",")]
    return [number for part in ends for number in range(part[0], part[-1] + 1)]


def submit(client: Client, server_dir: str, arguments: list[str]) -> dict:
    split = arguments.index("--")
    options = dict(zip(arguments[:split:2], arguments[1:split:2]))
    job = Job(name=options["--name"], max_fails=None)
    for number in numbers(options["--array"]):
        command = ["env", f"HQ_TASK_ID={number}", *arguments[split + 1 :]]
        said = options["--stderr"].replace("%{TASK_ID}", str(number))
        job.program(command, stdout=None, stderr=said)
    submitted = client.submit(job)
    # The module does not tell a job's name.
    Path(server_dir, f"job-{submitted.id}").write_text(options["--name"])
    return {"id": submitted.id}


def info(client: Client, server_dir: str, job: int) -> list[dict]:
    def see(jobs: dict) -> None:
        stats.update(jobs.get(job, {}))
        raise Seen

    stats: dict = {}
    try:
        client.connection.wait_for_jobs([job], see)
    except Seen:
        pass
    if not stats:
        raise RuntimeError(f"there is no job {job}")
    left = stats["total"] - stats["finished"] - stats["failed"]
    tasks = {"running": left, "waiting": 0, "failed": stats["failed"]}
    name = Path(server_dir, f"job-{job}").read_text()
    return [{"info": {"name": name, "task_stats": tasks}}]


def answer(server_dir: str, command: list[str]) -> object:
    match command:
        case ["server", "start"]:
            return start_server(server_dir)
        case ["worker", "start", "--cpus", "1"]:
            return start_worker(server_dir)
    client = Client(server_dir)
    match command:
        case ["server", "info"]:
            return {}
        case ["submit", *arguments]:
            return submit(client, server_dir, arguments)
        case ["job", "info", job]:
            return info(client, server_dir, int(job))
        case ["job", "forget", job]:
            return client.connection.forget_job(int(job))
    raise RuntimeError(f"not known here: {command}")


if __name__ == "__main__":
    given = sys.argv[1:]
    options = {"--server-dir": os.environ.get("HQ_SERVER_DIR", "")}
    while given and given[0] in ("--server-dir", "--output-mode"):
        options[given[0]] = given[1]
        given = given[2:]
    try:
        print(json.dumps(answer(options["--server-dir"], given)))
    except Exception as error:
        print(json.dumps({"error": str(error)}))
        sys.exit(1)
