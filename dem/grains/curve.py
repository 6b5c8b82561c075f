"""The Morton curve through the cells of a grid: cells that are near in space get ranks that are near."""

import math

import numpy as np

__all__ = ["curve_ranks"]


def curve_ranks(nx: int, ny: int, nz: int) -> np.ndarray:
    """Rank of each cell on a Morton curve, shape [nx ny nz], x fastest."""
    bits = max(1, math.ceil(math.log2(max(nx, ny, nz, 2))))

    def spread(a):
        result = np.zeros_like(a)
        for bit in range(bits):
            result |= ((a >> bit) & 1) << (3 * bit)
        return result

    k, j, i = np.meshgrid(np.arange(nz), np.arange(ny), np.arange(nx), indexing="ij")
    code = spread(i.ravel().astype(np.int64)) | spread(j.ravel().astype(np.int64)) << 1
    code |= spread(k.ravel().astype(np.int64)) << 2
    rank = np.empty(code.size, dtype=np.int32)
    rank[np.argsort(code, kind="stable")] = np.arange(code.size, dtype=np.int32)
    return rank
