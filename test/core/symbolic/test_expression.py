# Copyright 2026 flea_diag maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The algebra of laws: derivatives against differences, text against values."""

from __future__ import annotations

import math
import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flea_diag.core.symbolic.expression import (
    FUNCTIONS,
    ONE,
    ZERO,
    Constant,
    Expression,
    Variable,
    apply,
    derivative,
    evaluate,
    substitute,
    symbols,
    text,
)

X, Y, Z = Variable("x"), Variable("y"), Variable("z")
AT = {"x": 0.7, "y": -1.3, "z": 2.1}

leaves = st.sampled_from([X, Y, Z, Constant(2.0), Constant(-0.5)])
trees = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.builds(lambda a, b: a + b, inner, inner),
        st.builds(lambda a, b: a - b, inner, inner),
        st.builds(lambda a, b: a * b, inner, inner),
        st.builds(lambda a: a**2, inner),
        st.builds(lambda a: 1 / (2 + a**2), inner),
        st.builds(lambda a: apply("tanh", a), inner),
    ),
    max_leaves=8,
)


@given(trees)
def test_derivative_is_the_limit_of_differences(tree: Expression) -> None:
    h = 1e-5
    up, down = ({**AT, "x": AT["x"] + s * h} for s in (1, -1))
    slope = (evaluate(tree, up) - evaluate(tree, down)) / (2 * h)
    exact = evaluate(derivative(tree, "x"), AT)
    assert exact == pytest.approx(slope, rel=1e-5, abs=1e-5 * (1 + abs(evaluate(tree, AT))))


@given(trees)
def test_text_is_python_of_the_same_value(tree: Expression) -> None:
    value = eval(text(tree), {"__builtins__": {}}, {**FUNCTIONS, **AT})
    assert value == pytest.approx(evaluate(tree, AT), rel=1e-9, abs=1e-12)


@given(trees)
def test_substituting_a_number_is_evaluating(tree: Expression) -> None:
    numbers = {name: Constant(value) for name, value in AT.items()}
    found = substitute(tree, numbers)
    assert isinstance(found, Constant)
    assert found.value == pytest.approx(evaluate(tree, AT), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    ("built", "words"),
    [
        (X + X, "2*x"),
        (X - X, "0"),
        (X * X / X, "x"),
        (2 * (X + Y), "2*x + 2*y"),
        (-(X + Y), "-x - y"),
        ((Y - X) / Z, "(y - x)/z"),
        (X / (Y * Z), "x/(y*z)"),
        (1 / X, "1/x"),
        ((X / Y) ** 2, "x**2/y**2"),
        (X + 0, "x"),
        (0 * X, "0"),
        (apply("tanh", 0.0), "0"),
    ],
)
def test_normal_form(built: Expression, words: str) -> None:
    assert str(built) == words


def test_a_hash_stays_in_its_process() -> None:
    built = X * Y + Z
    assert hash(built) == hash(X * Y + Z)
    kept = pickle.loads(pickle.dumps(built))
    assert "_hash" in vars(built)
    assert "_hash" not in vars(kept)
    assert kept == built
    assert hash(kept) == hash(built)


def test_equal_expressions_compare_equal() -> None:
    assert X * Y + Z == X * Y + Z
    assert hash(X + Y) == hash(X + Y)
    assert X * 1 == X
    assert X**0 == ONE
    assert derivative(X, "y") == ZERO


def test_derivatives_of_the_other_functions() -> None:
    assert evaluate(derivative(apply("exp", 2 * X), "x"), AT) == pytest.approx(2 * math.exp(1.4))
    assert evaluate(derivative(apply("fabs", Y), "y"), AT) == -1.0
    assert derivative(apply("sign", X), "x") == ZERO


def test_symbols_in_order_of_appearance() -> None:
    assert symbols(Y * X + apply("exp", Z) + X) == ("y", "x", "z")


def test_a_missing_value_is_named() -> None:
    with pytest.raises(KeyError, match="y"):
        evaluate(X + Y, {"x": 1.0})
