"""The compiled linear algebra of small matrices and quaternions, against numpy and scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from armtempo.robots.kernels import (
    cholesky,
    cholesky_solve,
    eigenvectors,
    invert,
    quaternion_angle,
    quaternion_between,
    quaternion_of,
    quaternion_product,
)


@pytest.mark.parametrize("m", [1, 3, 6])
def test_cholesky_factors_what_is_positive_definite_and_refuses_the_rest(m: int) -> None:
    random = np.random.default_rng(m)
    A = random.normal(size=(m, m + 2))
    G, C = A @ A.T, np.zeros((m, m))
    assert cholesky(G, 0.0, C)
    np.testing.assert_allclose(C, np.linalg.cholesky(G), atol=1e-12)
    y = random.normal(size=m)
    x = y.copy()
    cholesky_solve(C, x)
    np.testing.assert_allclose(G @ x, y, atol=1e-9)
    least = float(np.linalg.eigvalsh(G)[0])
    assert cholesky(G, 0.999 * least, C)
    np.testing.assert_allclose(C @ C.T, G - 0.999 * least * np.eye(m), atol=1e-12)
    assert not cholesky(G, 1.001 * least, C)


@pytest.mark.parametrize("m", [1, 3, 6])
def test_eigenvectors_are_numpys(m: int) -> None:
    A = np.random.default_rng(m).normal(size=(m, m))
    G, V = A + A.T, np.empty((m, m))
    turned = G.copy()
    eigenvectors(turned, V)
    values = np.diag(turned)
    np.testing.assert_allclose(np.sort(values), np.linalg.eigvalsh(G), atol=1e-12)
    np.testing.assert_allclose(V @ np.diag(values) @ V.T, G, atol=1e-12)
    np.testing.assert_allclose(V.T @ V, np.eye(m), atol=1e-12)


def test_inverse_is_numpys_and_a_singular_matrix_has_none() -> None:
    A = np.random.default_rng(0).normal(size=(6, 6))
    A[0, 0] = 0.0  # needs a pivot
    B = np.empty((6, 6))
    assert invert(A.copy(), B)
    np.testing.assert_allclose(B, np.linalg.inv(A), atol=1e-11)
    A[3] = A[1]
    assert not invert(A.copy(), B)


def test_quaternions_are_scipys() -> None:
    random = np.random.default_rng(0)
    for size in (1e-12, 1e-3, 1.0, np.pi):
        a, b = (size * v / np.linalg.norm(v) for v in random.normal(size=(2, 3)))
        turns = Rotation.from_rotvec([a, b])
        both = quaternion_product(quaternion_of(*a), quaternion_of(*b))
        np.testing.assert_allclose(
            Rotation.from_quat(both, scalar_first=True).as_matrix(), (turns[0] * turns[1]).as_matrix(), atol=1e-14
        )
        assert quaternion_angle(quaternion_of(*a)) == pytest.approx(size, rel=1e-12)
        A, B = turns.as_matrix()
        across = Rotation.from_quat(quaternion_between(A, B), scalar_first=True)
        np.testing.assert_allclose(across.as_matrix() @ A, B, atol=1e-14)
