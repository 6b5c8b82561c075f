"""Taichi for the batch: started only where nobody has started it.

Contract: `ensure` leaves a running Taichi alone, so the bed and the batch live in one process. The batch hands its
arrays to kernels as numpy arrays and keeps no fields, so a bed that starts Taichi anew takes nothing from it. The
kernels are then compiled again.
"""

import contextlib
import io
import os

__all__ = ["ensure"]


def ensure(*, threads: int | None = None) -> None:
    """Start Taichi on the CPU in double precision, unless it runs.

    Args:
        threads: CPU threads, all that this process may use when None; of no effect where Taichi runs already.

    Raises RuntimeError: Taichi runs in single precision or not on the CPU: the batch needs double precision there.
    """
    from hedgebed_taichi import is_running, ti

    if is_running():
        impl = ti.lang.impl
        config = impl.current_cfg()
        if impl.get_runtime().default_fp != ti.f64 or config.arch not in (ti.x64, ti.arm64):
            raise RuntimeError(
                "Taichi runs in single precision or not on the CPU in this process (for a bed, it seems). Run the "
                "batch in a process of its own, or the bed in float64 on the CPU"
            )
        return
    if threads is None:
        threads = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)
    with contextlib.redirect_stdout(io.StringIO()):
        # Taichi's own way to share a loop out gives a thread at least 512 items (make_cpu_multithreaded_range_for.cpp):
        # a batch of some hundred trials would be one thread's. Without it blocks are as small as the kernels ask for.
        # Its optimisations take longer than LLVM's, which do the same work: steps run as fast without them.
        ti.init(
            arch=ti.cpu, cpu_max_num_threads=threads, default_fp=ti.f64, default_ip=ti.i32, fast_math=False,
            cfg_optimization=False, advanced_optimization=False, make_cpu_multithreading_loop=False,
            log_level=ti.ERROR,
        )  # fmt: skip
