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

"""Expansion and collection: the same value, and the shape that was asked for."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flea_diag.core.symbolic.collect import (
    MOST_TERMS,
    collect,
    expand,
    exponents,
    factors_of,
    monomial,
    power_of,
    solved_for,
    terms_of,
)
from flea_diag.core.symbolic.expression import (
    ONE,
    Constant,
    Expression,
    Power,
    Sum,
    Variable,
    apply,
    evaluate,
    product,
    substitute,
    symbols,
    total,
)
from flea_diag.errors import ConfigurationError

A, B, U, V = (Variable(name) for name in "abuv")
AT = {"a": 0.7, "b": -1.3, "u": 2.1, "v": -0.4}

leaves = st.sampled_from([A, B, U, V, Constant(2.0), Constant(-0.5)])
trees = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.builds(lambda x, y: x + y, inner, inner),
        st.builds(lambda x, y: x - y, inner, inner),
        st.builds(lambda x, y: x * y, inner, inner),
        st.builds(lambda x, n: x**n, inner, st.integers(2, 3)),
        st.builds(lambda x: 1 / (2 + x**2), inner),
        st.builds(lambda x: apply("tanh", x), inner),
    ),
    max_leaves=8,
)


@given(trees)
def test_expanding_keeps_the_value(tree: Expression) -> None:
    assert evaluate(expand(tree), AT) == pytest.approx(evaluate(tree, AT), rel=1e-6, abs=1e-9)


@given(trees)
def test_an_expanded_expression_is_a_sum_of_monomials(tree: Expression) -> None:
    for term in terms_of(expand(tree)):
        for factor in factors_of(term):
            power = isinstance(factor, Power) and factor.exponent > 0
            assert not isinstance(factor.base if power else factor, Sum)


@given(trees)
def test_expanding_twice_changes_nothing(tree: Expression) -> None:
    once = expand(tree)
    assert expand(once) == once


@given(trees)
def test_collected_terms_sum_to_the_expression(tree: Expression) -> None:
    parts = collect(tree, {"u", "v"})
    whole = total(product(pair) for pair in parts.items())
    assert evaluate(whole, AT) == pytest.approx(evaluate(tree, AT), rel=1e-6, abs=1e-9)


@given(trees)
def test_coefficients_hold_parameters_alone_and_signals_vary(tree: Expression) -> None:
    for basis, coefficient in collect(tree, {"u", "v"}).items():
        assert not {"u", "v"} & set(symbols(coefficient))
        assert basis == ONE or {"u", "v"} & set(symbols(basis))


def test_a_parity_relation_in_its_terms() -> None:
    """K (i - i0) - (fc + c |F|) tanh(w/s) - F."""
    i, F, w = Variable("i"), Variable("F"), Variable("w")
    K, i0, fc, c, s = (Variable(name) for name in ("K", "i0", "fc", "c", "s"))
    shape = apply("tanh", w / s)
    r = K * (i - i0) - (fc + c * apply("fabs", F)) * shape - F
    found = {str(basis): str(factor) for basis, factor in collect(r, {"i", "F", "w"}).items()}
    assert found == {
        "i": "K",
        "1": "-K*i0",
        "tanh(w/s)": "-fc",
        "fabs(F)*tanh(w/s)": "-c",
        "F": "-1",
    }


def test_a_quotient_by_a_sum_is_one_factor() -> None:
    assert str(expand((A + B) * (1 / (U + V)))) == "a/(u + v) + b/(u + v)"


def test_too_many_terms_are_refused() -> None:
    wide = total(Variable(f"x{k}") for k in range(30))
    with pytest.raises(ConfigurationError, match=str(MOST_TERMS)):
        expand(wide**3)


@pytest.mark.parametrize(
    ("text", "powers"),
    [
        ("a", {"a": 1}),
        ("a*b", {"a": 1, "b": 1}),
        ("a/b^2", {"a": 1, "b": -2}),
        ("a/b/c", {"a": 1, "b": -1, "c": -1}),
    ],
)
def test_products_are_read(text: str, powers: dict[str, int]) -> None:
    assert exponents(monomial(text)) == powers


@pytest.mark.parametrize("text", ["", "a+b", "2*a", "*a", "a b", "a^x", "__import__('os')"])
def test_anything_else_is_refused(text: str) -> None:
    with pytest.raises(ConfigurationError, match="is not a product of parameters"):
        monomial(text)


def test_exponents_of_a_sum_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="is not a product of powers"):
        exponents(A + B)


def test_a_name_is_solved_for_where_the_expression_is_linear_in_it():
    found = solved_for("u", 3.0 * A * (U - B) + V)
    assert evaluate(found, AT) == pytest.approx(-1.3 + 0.4 / (3.0 * 0.7))
    assert solved_for("u", A * U**2 + V) is None
    assert solved_for("u", A * V) is None


def test_a_symbol_that_comes_back_is_not_replaced_again():
    """A reading is the truth and its offset: what remains of the reading less its offset."""
    assert substitute(U - A, {"u": U + A}) == U
    assert evaluate(substitute(U / V, {"u": V, "v": U}), AT) == pytest.approx(-0.4 / 2.1)


def test_a_factor_may_be_a_size_without_sign():
    assert monomial("a*fabs(u)/b") == A * apply("fabs", U) / B


def test_the_power_of_a_name_is_that_of_its_factor_alone():
    lumped = monomial("a^2/b*(u+v)")
    assert [power_of(name, lumped) for name in "abuv"] == [2, -1, 0, 0]
