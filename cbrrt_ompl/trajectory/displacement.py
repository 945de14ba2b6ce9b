"""How a pose moves while both velocities are linear in time."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

QUADRATURE = np.transpose(np.polynomial.legendre.leggauss(8)) * 0.5 + (0.5, 0.0)
"""Gauss-Legendre rule on [0, 1], exact for polynomials of degree 15: rows of (node, weight), shape (8, 2)."""


def wrapped(angle: ArrayLike) -> NDArray[np.float64]:
    """Angles brought to [-pi, pi), any shape [rad]."""
    turned = np.mod(np.asarray(angle, dtype=float) + np.pi, 2.0 * np.pi) - np.pi
    return np.where(turned >= np.pi, -np.pi, turned)  # the remainder of a tiny negative number rounds to 2 pi


def displacement(
    theta: NDArray[np.float64],
    v: NDArray[np.float64],
    v_end: NDArray[np.float64],
    omega: NDArray[np.float64],
    omega_end: NDArray[np.float64],
    dt: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Change of pose over spans in which both velocities are linear in time; every argument has shape (n,).

    The heading is exact; the position is a Gauss-Legendre quadrature of order 16.

    Args:
        theta: headings at the beginning [rad].
        v: forward velocities at the beginning [m/s].
        v_end: forward velocities at the end [m/s].
        omega: turning rates at the beginning [rad/s].
        omega_end: turning rates at the end [rad/s].
        dt: durations [s].

    Returns:
        Changes of (x, y, theta), not wrapped, shape (n, 3) [m, m, rad].
    """
    node, weight = QUADRATURE.T[:, :, None]
    heading = theta + dt * node * (omega + 0.5 * (omega_end - omega) * node)  # (8, n)
    way = dt * weight * (v + (v_end - v) * node)  # (8, n)
    turn = dt * 0.5 * (omega + omega_end)
    return np.column_stack([(way * np.cos(heading)).sum(axis=0), (way * np.sin(heading)).sum(axis=0), turn])
