"""Expressions executed on rows; CasADi's own evaluation, and numpy's sines, are the truth."""

import casadi as ca
import numpy as np
import pytest
from truepath.kinematics.vector_program import VectorProgram

N = 100
X = ca.SX.sym("x", 6)  # two angles, their sines, their cosines
SINES = {0: (2, 4), 1: (3, 5)}


def rows():
    angles = np.random.default_rng(0).uniform(-3, 3, (2, N))
    return np.concatenate([angles, np.sin(angles), np.cos(angles)])


def evaluated(outputs, x=None):
    """``(K, N)`` as the program has them, constants filled in; and the program."""
    x = rows() if x is None else x
    program = VectorProgram(X, ca.vertcat(*outputs), SINES)
    out = np.full((program.num_rows, x.shape[1]), np.nan)
    program.bound_to(x, out)()
    return np.array(
        [out[r] if r >= 0 else np.full(x.shape[1], c) for r, c in zip(program.row, program.constant, strict=True)]
    ), program


def by_casadi(outputs):
    return np.array(ca.Function("truth", [X], [ca.vertcat(*outputs)]).map(N)(rows()))


def test_every_operation_does_what_casadi_does():
    a, b = X[0], X[1]
    inside = a / 4
    outputs = [
        a + b, a - b, a * b, a / b, -a, ca.exp(a), ca.log(ca.fabs(a)), ca.fabs(a) ** b, a**3, ca.sqrt(ca.fabs(b)), a**2,
        2 * a, ca.tan(a), ca.asin(inside), ca.acos(inside), ca.atan(a), a < b, a <= b, ca.eq(a, b), ca.ne(a, b),
        ca.logic_not(a < 0), ca.logic_and(a < 0, b < 0), ca.logic_or(a < 0, b < 0), ca.floor(a), ca.ceil(a),
        ca.fmod(a, b), ca.sign(a), ca.copysign(a, b), ca.if_else(a > b, a, 3 * b), ca.erf(a), ca.fmin(a, b),
        ca.fmax(a, b), 1 / a, ca.sinh(a), ca.cosh(a), ca.tanh(a), ca.asinh(a), ca.acosh(1 + a**2), ca.atanh(inside),
        ca.atan2(a, b), ca.expm1(a), ca.log1p(a**2), ca.hypot(a, b), a,
    ]  # fmt: skip
    np.testing.assert_allclose(evaluated(outputs)[0], by_casadi(outputs), rtol=1e-14, atol=1e-15)


def test_memory_that_is_used_again_is_not_used_too_early():
    """A long chain whose early results are needed late."""
    outputs, value = [], X[0]
    early = [ca.exp(0.1 * k * X[1]) for k in range(1, 6)]
    for k in range(40):
        value = ca.sqrt(value**2 + 0.1 * k) - 0.3 * X[1]
        if k % 9 == 0:
            outputs.append(value)
    outputs.append(value * sum(early))
    np.testing.assert_allclose(evaluated(outputs)[0], by_casadi(outputs), rtol=1e-13)


@pytest.mark.parametrize("orders", [range(1, 129), [3, 50, 999], [2, 3], [128, 127, 1]])
def test_waves_of_an_angle_follow_from_its_sine_and_cosine(orders):
    outputs = [wave(k * X[1]) for k in orders for wave in (ca.cos, ca.sin)]
    expected = [wave(k * rows()[1]) for k in orders for wave in (np.cos, np.sin)]
    found, program = evaluated(outputs)
    np.testing.assert_allclose(found, expected, atol=1e-16 * max(orders) ** 2 + 1e-15)
    assert not {"sin", "cos"} & {step.__name__ for step in _calls(program)}


def test_waves_of_anything_else_need_one_sine_and_one_cosine():
    base = (X[0] - 0.3) / 1.7
    outputs = [wave(np.pi * k * base) for k in range(1, 30) for wave in (ca.cos, ca.sin)]
    expected = [wave(np.pi * k * (rows()[0] - 0.3) / 1.7) for k in range(1, 30) for wave in (np.cos, np.sin)]
    found, program = evaluated(outputs)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    names = [step.__name__ for step in _calls(program)]
    assert (names.count("sin"), names.count("cos")) == (1, 1)


def test_waves_that_are_no_multiples_of_each_other_are_taken_as_they_are():
    outputs = [ca.cos(1.5 * X[0]), ca.sin(0.7 * X[0]), ca.cos(-2 * X[0]), ca.sin(-0.7 * X[0])]
    np.testing.assert_allclose(evaluated(outputs)[0], by_casadi(outputs), atol=1e-15)


def test_what_is_constant_has_no_row_and_what_is_equal_has_one():
    outputs = [X[0] * X[1], ca.SX(4.5), X[0] * X[1], ca.SX(0)]
    found, program = evaluated(outputs)
    assert program.num_rows == 1
    assert program.row.tolist() == [0, -1, 0, -1]
    assert program.constant.tolist() == [0.0, 4.5, 0.0, 0.0]
    np.testing.assert_allclose(found, by_casadi(outputs), atol=1e-15)


def test_an_operation_that_rows_do_not_know_is_refused():
    with pytest.raises(TypeError, match="rows do not know"):
        evaluated([ca.remainder(X[0], X[1])])


def _calls(program):
    """The functions of numpy that it calls."""
    run = program.bound_to(rows(), np.empty((program.num_rows, N)))
    (steps,) = (cell.cell_contents for cell in run.__closure__)
    return [ufunc for ufunc, _ in steps]
