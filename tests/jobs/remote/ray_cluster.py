"""A Ray cluster of this machine: a head without CPUs, as beside a server, and some nodes.

``python -m tests.jobs.remote.ray_cluster N`` prints its address. Each line of the input removes
a node as if its machine had failed; the end of the input ends the cluster.
"""

import sys

from ray.cluster_utils import Cluster

MEMORY = 80 * 1024 * 1024
"""Size of each object store, which jobs do not use [bytes]."""


def main(n_nodes: int) -> None:
    cluster = Cluster(
        initialize_head=True, head_node_args={"num_cpus": 0, "object_store_memory": MEMORY}
    )
    nodes = [cluster.add_node(num_cpus=1, object_store_memory=MEMORY) for _ in range(n_nodes)]
    try:
        print(cluster.address, flush=True)
        for _line in sys.stdin:
            cluster.remove_node(nodes.pop(0), allow_graceful=False)
            print("removed", flush=True)
    finally:
        cluster.shutdown()


if __name__ == "__main__":
    main(int(sys.argv[1]))
