"""A cluster of hedgebed's workers on SLURM, for `hedgebed sweep --scheduler`: a file to start from.

    pip install '.[sweep]' dask-jobqueue
    python examples/sweep/slurm.py scheduler.json &        # on the login node; `kill %1` ends it and its jobs
    hedgebed sweep sweep.toml --scheduler scheduler.json --out /shared/sweep

No SLURM was at hand: tried with dask-jobqueue 0.9.0 and stand-ins for sbatch and scancel on one machine. Queue,
account, memory and time are yours to change. Every worker must see the same /shared under the same path, and have the
same version of hedgebed.

Other queues: take `PBSCluster`, `LSFCluster`, `SGECluster` or `HTCondorCluster` of dask_jobqueue in place of
`SLURMCluster`, and the words of your queue in place of `--requeue`. These were not tried.
"""

import signal
import sys

JOBS = 16
"""Jobs, each a worker that computes one run at a time."""


def main(scheduler_file: str) -> None:
    """Start the scheduler, ask for the jobs and wait."""
    from dask_jobqueue import SLURMCluster  # no dependency of hedgebed

    for ending in (signal.SIGINT, signal.SIGTERM):
        signal.signal(ending, lambda *given: None)  # it ends the pause; then the jobs are cancelled
    with SLURMCluster(
        queue="normal",
        cores=1,
        processes=1,
        memory="4GB",
        walltime="24:00:00",
        local_directory="/tmp",
        job_extra_directives=["--requeue"],  # a job that is taken away comes back, and its run goes on
        scheduler_options={"scheduler_file": scheduler_file},
    ) as cluster:
        cluster.scale(jobs=JOBS)
        print(f"scheduler at {cluster.scheduler_address}; Ctrl-C or kill ends it", flush=True)
        signal.pause()


if __name__ == "__main__":
    main(sys.argv[1])
