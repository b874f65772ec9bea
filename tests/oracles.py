"""Closed-form cases and independent programs that the tests hold the code against."""

import numpy as np
from scipy.spatial.transform import Rotation


def inertia(Jx, Jy, Jz, Jxz) -> np.ndarray:
    """The inertia matrix of a body symmetric about its x-z plane (Beard & McLain, Small Unmanned Aircraft, eq. 3.12)."""
    return np.array([[Jx, 0, -Jxz], [0, Jy, 0], [-Jxz, 0, Jz]])


def euler_rates(J: np.ndarray, omega: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """omega_dot of Euler's equation J omega_dot + omega x J omega = M, solved with the full matrix."""
    return np.linalg.solve(J, moment - np.cross(omega, J @ omega))


def body_to_ned(phi, theta, psi) -> np.ndarray:
    """The ZYX rotation from scipy's own composition of three elementary rotations."""
    return Rotation.from_euler("ZYX", [psi, theta, phi]).as_matrix()


def power_law(reference_speed, reference_height, height, exponent):
    """v_r (h / h_r)^a, IEC 61400-1 eq. 10."""
    return reference_speed * (height / reference_height) ** exponent


def log_law(reference_speed, reference_height, height, roughness):
    """v_r ln(h / z0) / ln(h_r / z0)."""
    return reference_speed * np.log(height / roughness) / np.log(reference_height / roughness)


def marginal_least_squares(J_own, J, r, sigma, own_covariance, own_value):
    """(H, b, cost) of r = J d + J_own o + e, e ~ N(0, sigma^2), o ~ N(-own_value, own_covariance), by the dense covariance
    R = diag(sigma^2) + J_own P J_own' of the data: what an elimination of the nuisances must equal. Unwhitened arguments."""
    R = np.diag(sigma**2) + J_own @ own_covariance @ J_own.T
    e = r + J_own @ own_value
    W = np.linalg.solve(R, np.column_stack([J, e]))
    return J.T @ W[:, :-1], J.T @ W[:, -1], float(e @ W[:, -1])


def runge_kutta(f, x, h, steps):
    """Classical RK4 of dx/dt = f(x), written out once more: (steps + 1, n)."""
    path = [np.asarray(x, dtype=float)]
    for _ in range(steps):
        x = path[-1]
        k1 = f(x)
        k2 = f(x + h / 2 * k1)
        k3 = f(x + h / 2 * k2)
        k4 = f(x + h * k3)
        path.append(x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
    return np.array(path)


def order_of(errors) -> np.ndarray:
    """Observed orders of convergence of errors whose step was halved each time."""
    errors = np.asarray(errors)
    return np.log2(errors[:-1] / errors[1:])


def kkt_violation(H, b, lower, upper, d) -> float:
    """How far d is from the optimum of 1/2 d'Hd - b'd in the box: largest violation of the bounds or of the sign of the gradient."""
    gradient = H @ d - b
    free = (d > lower + 1e-9) & (d < upper - 1e-9)
    wrong = np.where(free, np.abs(gradient), np.where(d <= lower + 1e-9, np.maximum(-gradient, 0), np.maximum(gradient, 0)))
    outside = np.maximum(np.maximum(lower - d, d - upper), 0)
    return float(max((wrong / np.sqrt(np.diag(H))).max(), outside.max()))
