"""Attitude against inertial space as the running product of the rotations of single samples.

A quaternion w + ix + jy + kz is a pair of complex numbers (w + ix, y + iz), with the product
(a, b)(c, d) = (a c - b d*, a d + b c*). A vector (x, y, z) is the pair (ix, y + iz). A rotation
about the first axis by an angle multiplies both numbers of a pair by e^(i angle / 2), and y + iz
by e^(i angle). Arrays of pairs are (2, ..., n).
"""

from math import factorial

import numpy as np

from rotcli.models.strapdown.cells import Arena, ComplexArray
from rotcli.units import FloatArray

Pair = tuple[complex, complex]

_MAX_SERIES_ANGLE = 0.4  # rad, of a step; trigonometry is used for larger rotations
_SERIES_ERROR = 1e-17  # relative, of the first term that is omitted
_MAX_LOOP = 80  # factors that a loop multiplies faster than numpy does


def multiply_pairs(p: Pair, q: Pair) -> Pair:
    """Return the quaternion product p q."""
    (a, b), (c, d) = p, q
    return a * c - b * d.conjugate(), a * d + b * c.conjugate()


def pair_of(q: FloatArray) -> Pair:
    """Return the pair of a quaternion (4,), scalar first."""
    w, x, y, z = (float(v) for v in q)
    return complex(w, x), complex(y, z)


def attitude(phi: FloatArray, first: Pair, out: ComplexArray, arena: Arena) -> Pair:
    """Compute the attitudes out (2, rows, n) of samples that rotate by phi (3, rows, n), rad.

    phi: rotation vector from each sample to the next. first: attitude at row 0 of cell 0.
    Returns the attitude at row 0 of the last cell.
    """
    _, rows, n = out.shape
    with arena.stage():
        products = _products_in_cells(_steps(phi, arena), arena)
        starts = _running_products(products[:, rows], first, arena)
        starts /= np.sqrt(np.sum(starts.real**2 + starts.imag**2, axis=0))
        _multiply(starts, products[:, :rows], out, arena.complex(*out.shape))
    return complex(starts[0, n - 1]), complex(starts[1, n - 1])


def rotate_vectors(
    q: ComplexArray,
    x: ComplexArray,
    yz: ComplexArray,
    out: tuple[FloatArray, ComplexArray],
    arena: Arena,
) -> None:
    """Compute out (x', y' + iz') of vectors rotated by unit quaternions q (2, rows, n).

    x: (rows, n), the first component times i. yz: (rows, n), y + iz. Both are overwritten.
    """
    a, b = q
    x_out, yz_out = out
    with arena.stage():
        t, u, product = (arena.complex(*x.shape) for _ in range(3))
        # (t, u) = q v
        np.multiply(a, yz, out=u)
        np.multiply(b, x, out=product)
        u -= product
        np.multiply(a, x, out=t)
        np.conjugate(yz, out=yz)
        np.multiply(b, yz, out=product)
        t -= product
        # (t, u) q*; the first component with |q| = 1
        np.multiply(a, u, out=yz_out)
        np.multiply(b, t, out=product)
        yz_out -= product
        np.conjugate(b, out=product)
        product *= u
        np.multiply(product.imag, 2.0, out=x_out)
        x_out += x.imag


def _steps(phi: FloatArray, arena: Arena) -> ComplexArray:
    """Return the quaternions (2, rows, n) of rotation vectors phi (3, rows, n)."""
    _, rows, n = phi.shape
    steps = arena.complex(2, rows, n)
    with arena.stage():
        square, s, product = (arena.real(rows, n) for _ in range(3))
        np.multiply(phi[0], phi[0], out=square)
        for k in (1, 2):
            np.multiply(phi[k], phi[k], out=product)
            square += product
        square *= 0.25
        scalar = product
        _half_angle_functions(square, s, scalar)
        steps[0].real = scalar
        np.multiply(s, phi[0], out=steps[0].imag)
        np.multiply(s, phi[1], out=steps[1].real)
        np.multiply(s, phi[2], out=steps[1].imag)
    return steps


def _half_angle_functions(square: FloatArray, s: FloatArray, scalar: FloatArray) -> None:
    """Compute s = sin(h) / 2h and scalar = cos(h) of the half angles h from their squares."""
    largest = float(square.max())
    if not largest < 0.25 * _MAX_SERIES_ANGLE**2:
        half = np.sqrt(square)
        s[...] = 0.5 * np.sinc(half / np.pi)
        np.cos(half, out=scalar)
        return
    terms = 1
    while largest**terms / factorial(2 * terms + 1) > _SERIES_ERROR:
        terms += 1
    s[...] = 0.5 * (-1.0) ** terms / factorial(2 * terms + 1)
    for k in reversed(range(terms)):
        s *= square
        s += 0.5 * (-1.0) ** k / factorial(2 * k + 1)
    np.multiply(s, s, out=scalar)
    scalar *= square
    scalar *= -4.0
    scalar += 1.0
    np.sqrt(scalar, out=scalar)


def _products_in_cells(steps: ComplexArray, arena: Arena) -> ComplexArray:
    """Return the products (2, rows + 1, n) of the first 0, 1, ... rows of steps (2, rows, n)."""
    _, rows, n = steps.shape
    products = arena.complex(2, rows + 1, n)
    products[0, 0], products[1, 0] = 1.0, 0.0
    products[:, 1] = steps[:, 0]
    with arena.stage():
        work = arena.complex(2, n)
        for j in range(1, rows):
            _multiply(products[:, j], steps[:, j], products[:, j + 1], work)
    return products


def _multiply(p: ComplexArray, q: ComplexArray, out: ComplexArray, work: ComplexArray) -> None:
    """Compute out = p q of quaternions (2, ..., n); p (2, n) may be one per cell.

    work: of the shape of q.
    """
    a, b = p
    np.multiply(a, q, out=out)
    np.conjugate(q, out=work)
    work *= b
    out[0] -= work[1]
    out[1] += work[0]


def _running_products(factors: ComplexArray, first: Pair, arena: Arena) -> ComplexArray:
    """Return [first, first f0, first f0 f1, ...] (2, n) of factors (2, n); the last is not used."""
    n = factors.shape[1]
    if n <= _MAX_LOOP:
        running: list[Pair] = [first]
        for c, d in factors[:, :-1].T.tolist():
            running.append(multiply_pairs(running[-1], (c, d)))
        return np.array(running).T
    rows = 8  # the factors become cells again
    cells = -(-n // rows)
    with arena.stage():
        steps, work = arena.complex(2, rows, cells), arena.complex(2, rows, cells)
        padded = np.zeros((2, rows * cells), dtype=complex)
        padded[0, n:] = 1.0
        padded[:, :n] = factors
        steps[...] = padded.reshape(2, cells, rows).transpose(0, 2, 1)
        products = _products_in_cells(steps, arena)
        starts = _running_products(products[:, rows], first, arena)
        _multiply(starts, products[:, :rows], steps, work)
        return steps.transpose(0, 2, 1).reshape(2, -1)[:, :n].copy()
