"""What numba kernels share with the printed loops of `kernels`: inputs between samples, recorded set-points, lanes that end."""

from numba import njit

from awescli.simulation.kernels import LIMIT


@njit(cache=True)
def _inputs_at(u, U, k, share):
    """u = U[k] + share (U[k+1] - U[k])"""
    for i in range(u.shape[0]):
        for lane in range(u.shape[1]):
            u[i, lane] = U[k, i, lane] + share * (U[k + 1, i, lane] - U[k, i, lane])


@njit(cache=True)
def _sample(x, k, SP, n_s):
    """Take over the recorded set-points of sample k."""
    for i in range(SP.shape[1]):
        for lane in range(x.shape[1]):
            x[n_s + i, lane] = SP[k, i, lane]


@njit(cache=True)
def _stop_diverged(x, start, alive, k):
    """Mark lanes whose state left the numbers; put them back to their start. Returns how many stopped now."""
    stopped = 0
    for lane in range(x.shape[1]):
        good = True
        for i in range(x.shape[0]):
            if not (abs(x[i, lane]) < LIMIT):
                good = False
        if not good:
            if alive[lane] > k:
                alive[lane] = k
                stopped += 1
            for i in range(x.shape[0]):
                x[i, lane] = start[i, lane]
    return stopped
