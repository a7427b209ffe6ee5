"""Corrections: a prior that holds on new groups, and touches that make it narrower."""

from dataclasses import replace

import numpy as np
import pytest

from monochord.core.types import Floats
from monochord.perception.model.correction import BUILD_SHARE, Correction, Indices, prior
from monochord.perception.model.forest import forest_of

WEIGHTS = np.array([0.2, 0.3, -0.1, 0.1, 0.05, 0.1])
"""Standard deviations of the weights of 1, a, b, a^2, a b, b^2 between groups."""
NOISE = 0.1


def groups(count: int, seed: int, touches: int = 12) -> tuple[Floats, Floats, Indices, Indices]:
    """Variables, errors, group and touch of groups, each with its own weights, three windows a touch."""
    random = np.random.default_rng(seed)
    variables = random.uniform(-1.5, 1.5, (count, touches, 1, 2)).repeat(3, axis=2)
    a, b = variables[..., 0], variables[..., 1]
    terms = np.stack([np.ones_like(a), a, b, a * a, a * b, b * b], axis=-1)
    weights = np.array([0.05, 0.1, 0.0, 0.0, 0.0, 0.0]) + WEIGHTS * random.normal(size=(count, 6))
    error = np.einsum("gtwk,gk->gtw", terms, weights) + NOISE * random.normal(size=(count, touches, 1))
    number = np.broadcast_to(np.arange(count)[:, None, None], error.shape)
    touch = np.broadcast_to(np.arange(count * touches).reshape(count, touches, 1), error.shape)
    return variables.reshape(-1, 2), error.ravel(), number.ravel(), touch.ravel()


@pytest.fixture(scope="module")
def unknown() -> Correction:
    variables, error, group, touch = groups(80, 0)
    return prior(variables, error, np.full(error.size, NOISE), group, touch)


def stated(correction: Correction, variables: Floats) -> tuple[Floats, Floats]:
    return correction.stated(variables, np.full(len(variables), NOISE))


def test_what_a_group_has_in_common_is_learned_where_the_head_states_it_as_noise() -> None:
    random, count, touches = np.random.default_rng(0), 80, 5
    group, touch = np.repeat(np.arange(count), touches), np.arange(count * touches)
    common = 0.6 * random.standard_t(3, size=count)
    error = common[group] + 0.6 * random.standard_t(3, size=group.size)
    unknown = prior(np.zeros((group.size, 1)), error, np.full(group.size, 1.2), group, touch)
    known = unknown.given(np.zeros((4, 1)), np.ones(4), np.full(4, 1.2), np.arange(4))
    assert float(known.error(np.zeros(1))[0]) > 0.5  # four touches that are all off by 1


@pytest.mark.parametrize("known", [0, 3, 8])
def test_errors_of_new_groups_lie_within_what_is_stated_and_known_touches_narrow_it(
    unknown: Correction, known: int
) -> None:
    variables, error, group, touch = groups(150, 1)
    ratio, size, before = list[Floats](), list[float](), list[float]()
    for each in range(150):
        rows = np.flatnonzero(group == each)
        used, rest = rows[: 3 * known], rows[24:]
        std = np.full(used.size, NOISE)
        own = unknown
        if known:
            own = unknown.given(variables[used], error[used], std, touch[used])
        expected, std = stated(own, variables[rest])
        ratio.append((error[rest] - expected) / std)
        size.append(float(np.abs(error[rest] - expected).mean()))
        before.append(float(std.mean()))
    off = np.abs(np.concatenate(ratio))
    assert np.mean(off < 1.0) == pytest.approx(0.683, abs=0.07)
    assert np.mean(off < 2.0) == pytest.approx(0.954, abs=0.035)
    assert np.mean(size) < {0: 0.45, 3: 0.32, 8: 0.16}[known]


def test_a_misread_touch_has_little_weight(unknown: Correction) -> None:
    variables, error, _, touch = groups(1, 2)
    std, at = np.full(error.size, NOISE), np.zeros(2)
    clean = unknown.given(variables, error, std, touch)
    error[:3] += 100.0 * NOISE
    wrong = unknown.given(variables, error, std, touch)
    assert abs(float(wrong.error(at)[0] - clean.error(at)[0])) < NOISE
    plain = np.linalg.lstsq(unknown.terms(variables), error, rcond=None)[0]
    assert abs(float(unknown.terms(at) @ plain - clean.error(at)[0])) > NOISE


def test_windows_of_one_touch_count_as_one(unknown: Correction) -> None:
    terms = np.zeros((30, 2))
    error, std = np.full(30, 0.5), np.full(30, NOISE)
    one = unknown.given(terms, error, std, np.zeros(30, np.int64))
    alone = unknown.given(terms[:1], error[:1], std[:1], np.zeros(1, np.int64))
    np.testing.assert_allclose(one.mean, alone.mean, atol=1e-12)
    np.testing.assert_allclose(one.covariance, alone.covariance, atol=1e-12)


def test_far_variables_are_bounded(unknown: Correction) -> None:
    far = unknown.terms(np.array([[1e9, -1e9]]))
    assert np.isfinite(far).all()
    assert np.abs(far).max() <= 16.0
    moved = replace(unknown, centre=unknown.centre + 1e9)
    assert np.abs(moved.terms(np.zeros((1, 2)))).max() <= 16.0


def test_what_objects_have_in_common_is_the_builds_and_another_object_is_as_uncertain_as_it_is() -> None:
    rng = np.random.default_rng(5)
    flat, wide, noise = np.zeros(3), np.diag([0.25, 0.04, 0.01]), 0.05
    unknown = Correction(centre=flat[:1], scale=np.ones(1), mean=flat, covariance=wide, noise=1.0)
    variables = rng.normal(size=(1000, 1))
    terms, std, touch = unknown.terms(variables), np.full(1000, noise), np.arange(1000)
    group = touch // 100  # ten objects
    left: dict[str, list[float]] = {"none": [], "same": [], "one": [], "eight": []}
    inside: dict[str, list[bool]] = {name: [] for name in left}
    for _ in range(80):
        build = rng.normal(size=3) * np.sqrt(BUILD_SHARE * np.diag(wide))
        own = rng.normal(size=(10, 3)) * np.sqrt((1.0 - BUILD_SHARE) * np.diag(wide))
        error = np.einsum("ni,ni->n", terms, (build + own)[group]) + noise * rng.normal(size=1000)
        known = {each: (variables[group < each], error[group < each], std[group < each]) for each in (1, 8)}
        learned = {
            "none": unknown,
            "same": unknown.given(*known[1], touch[group < 1]),
            "one": unknown.of_the_build(*known[1], touch[group < 1], group[group < 1]),
            "eight": unknown.of_the_build(*known[8], touch[group < 8], group[group < 8]),
        }
        for name, each in learned.items():
            expected, uncertain = each.error(variables[group == 9])
            off = error[group == 9] - expected
            left[name].append(float(np.mean(np.abs(off))))
            inside[name] += (np.abs(off) < np.hypot(uncertain, noise)).tolist()
        assert learned["one"].mean == pytest.approx(BUILD_SHARE * learned["same"].mean, abs=1e-6)
    error_of = {name: float(np.mean(values)) for name, values in left.items()}
    covered = {name: float(np.mean(values)) for name, values in inside.items()}
    assert error_of["eight"] < 0.93 * error_of["none"]
    assert error_of["one"] < error_of["none"] < 0.9 * error_of["same"]
    for name in ("none", "one", "eight"):
        assert 0.62 < covered[name] < 0.74, (name, covered)
    assert covered["same"] < 0.3


def test_trees_learn_what_polynomials_do_not_and_end_whatever_their_nodes(unknown: Correction) -> None:
    random = np.random.default_rng(0)
    variables = random.uniform(-1.0, 1.0, (400, 5))  # two of the correction, three columns
    error = np.where(variables[:, 3] > 0.2, 0.5, -0.5) + 0.3 * variables[:, 4]
    nodes = forest_of(variables[:300], error[:300])
    learned = unknown.with_forest(nodes)
    left = error[300:] - learned.residual(variables[300:])
    assert np.abs(left).mean() < 0.6 * np.abs(error[300:]).mean()
    np.testing.assert_allclose(
        unknown.with_forest(nodes, 0.5).residual(variables), 0.5 * learned.residual(variables), atol=1e-6
    )
    twice = learned.with_forest(nodes).residual(variables)
    np.testing.assert_allclose(twice, 2.0 * learned.residual(variables), atol=1e-6)
    wild = random.uniform(-9.0, 9.0, (50, 3)).astype(np.float32)
    assert np.isfinite(replace(unknown, forest=wild).residual(variables)).all()


def test_what_is_scaled_states_as_much_more(unknown: Correction) -> None:
    at, std = np.array([[0.5, -0.5]]), np.full(1, NOISE)
    assert unknown.scaled(2.0).stated(at, std)[1] == pytest.approx(2.0 * unknown.stated(at, std)[1])
