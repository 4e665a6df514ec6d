"""Shards of a campaign on HyperQueue, by its Python module: what the gate and docs/campaigns.md show.

campaign.py server SERVER_DIR                              a server with a worker, until it is ended
campaign.py worker SERVER_DIR                              another worker of it, until it is ended
campaign.py run SERVER_DIR BALLBOT CAMPAIGN PARTS RESULTS  has the parts run, and waits for them
"""

import shutil
import sys
import tempfile
import time
from pathlib import Path

from hyperqueue import Client, Job, LocalCluster
from hyperqueue.cluster import WorkerConfig

ONE_CORE = WorkerConfig(cores=1)


def access(server_dir: str) -> Path:
    """The file by which a server is found, once it is there."""
    deadline = time.monotonic() + 30.0
    while time.monotonic() < deadline:
        for found in Path(server_dir).glob("hq-current/access.json"):
            return found
        time.sleep(0.1)
    sys.exit(f"no HyperQueue server in {server_dir}")


def wait() -> None:
    while True:
        time.sleep(1.0)


def server(server_dir: str) -> None:
    with LocalCluster(server_dir, ONE_CORE):
        wait()


def worker(server_dir: str) -> None:
    # The module starts workers of its own server only: it is shown the other one in its place.
    with tempfile.TemporaryDirectory() as own, LocalCluster(own) as local:
        shutil.copy(access(server_dir), access(own))
        local.start_worker(ONE_CORE)
        wait()


def run(server_dir: str, ballbot: str, campaign: str, parts: str, results: str) -> None:
    access(server_dir)
    client = Client(server_dir)
    job = Job()
    folder = Path(results, "shards").absolute()
    folder.mkdir(parents=True, exist_ok=True)
    said = str(folder / "task-%{TASK_ID}.txt")
    for part in range(1, int(parts) + 1):
        # A part that is done says so and ends.
        shard = ["--shard", f"{part}/{parts}", "--out", results, "--threads", "1"]
        command = [ballbot, "--quiet", "campaign", campaign, *shard]
        job.program(command, stdout=None, stderr=said)
    client.wait_for_jobs([client.submit(job)])


if __name__ == "__main__":
    {"server": server, "worker": worker, "run": run}[sys.argv[1]](*sys.argv[2:])
