"""How much faster are links eliminated by the compiled function than by numpy? python benchmarks/elimination_speed.py

One call of numpy works on the matrices of one link of all segments, as `information_filter` did; both in one process, in turns, the
fastest of each. What both find is compared in tests/estimation/test_backward.py.
"""

import time

import awescli  # noqa: F401  (thread settings before numpy)

# isort: split
import numpy as np

from awescli.estimation.backward import eliminate_backward, padded, row_length
from awescli.estimation.elimination import inverse_root

SIZES = {
    "4 segments of 5 s at 50 Hz, gusts at every sample, levels": (4, 249, 14, 10, 1),
    "the same, 48 parameters": (4, 249, 14, 10, 49),
    "29 segments, gusts every tenth of a second, 47 parameters": (29, 49, 12, 11, 48),
}
"""What is fitted -> segments, links, states, axes of processes, parameters and residual."""


def links(seed, K, L, n_s, W, more):
    """(M, E, behind, R, columns) of random links, as `eliminate_backward` takes them, with noise where nothing may be read."""
    random = np.random.default_rng(seed)
    width, columns = n_s + 2 * W, n_s + 3 * W + more
    M = random.standard_normal((K, L, width, row_length(columns)))
    B = random.standard_normal((K, L, width + 5, width))
    M[..., :width] = B.swapaxes(2, 3) @ B
    E = np.zeros((K, L, n_s, padded(width)))
    E[..., :width] = random.standard_normal((K, L, n_s, width)) / (2 * np.sqrt(width))
    behind = random.standard_normal((K, width, row_length(columns)))
    B = random.standard_normal((K, n_s + W + 2, n_s + W))
    behind[:, W:, W:width] = B.swapaxes(1, 2) @ B
    R = np.zeros((K, L, W, padded(W)))
    R[..., np.arange(W), np.arange(W)] = 1.0
    return M, E, behind, R, columns


def by_numpy(M, E, behind, columns):
    """(C^-1, Y, V) of every link, the last one first."""
    (K, L, width, _), n_s = M.shape, E.shape[2]
    W = (width - n_s) // 2
    V, found = behind[:, W:, W:columns], []
    for m in range(L - 1, -1, -1):
        to = np.zeros((K, n_s + W, columns))  # [s+, w+] and what is beside
        G = M[:, m, :, :columns].copy()
        T = V[..., :n_s] @ E[:, m, :, :width]
        T[..., :W] += V[..., n_s : n_s + W]
        to[..., :width], to[..., width:] = T, V[..., n_s + W :]
        G += E[:, m, :, :width].swapaxes(1, 2) @ to[:, :n_s]
        G[:, :W] += to[:, n_s:]
        root = inverse_root(G[:, :W, :W])
        Y = root @ G[:, :W, W:]
        V = G[:, W:, W:] - Y[..., : n_s + W].swapaxes(1, 2) @ Y
        found.append((root, Y, V))
    return found[::-1]


def fastest(work, rounds: int = 9) -> float:
    """[s]"""
    found = []
    for _ in range(rounds):
        begin = time.perf_counter()
        work()
        found.append(time.perf_counter() - begin)
    return min(found)


def main() -> None:
    print("| fit | numpy | compiled | times faster |\n|---|---|---|---|")
    for name, size in SIZES.items():
        M, E, behind, R, columns = links(0, *size)
        eliminate_backward(M.copy(), E, behind, R.copy(), columns)
        numpy = fastest(lambda M=M, E=E, behind=behind, columns=columns: by_numpy(M, E, behind, columns))
        # what it is given is written over: copying counts
        compiled = fastest(lambda M=M, E=E, behind=behind, R=R, columns=columns: eliminate_backward(M.copy(), E, behind, R.copy(), columns))
        print(f"| {name} | {1e3 * numpy:.0f} ms | {1e3 * compiled:.0f} ms | {numpy / compiled:.1f} |")


if __name__ == "__main__":
    main()
