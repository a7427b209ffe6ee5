"""Corrections: a prior that holds on new groups, and touches that make it narrower."""

from dataclasses import replace

import numpy as np
import pytest

from monochord.core.types import Floats
from monochord.perception.model.correction import BUILD_SHARE, Correction, Indices, prior

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
    variables, error, group, touch = groups(150, 0)
    return prior(variables, error, np.full(error.size, NOISE), group, touch)


def stated(correction: Correction, variables: Floats) -> tuple[Floats, Floats]:
    expected, uncertain = correction.error(correction.terms(variables))
    return expected, np.sqrt(correction.noise * NOISE**2 + uncertain**2)


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
            own = unknown.given(unknown.terms(variables[used]), error[used], std, touch[used])
        expected, std = stated(own, variables[rest])
        ratio.append((error[rest] - expected) / std)
        size.append(float(np.abs(error[rest] - expected).mean()))
        before.append(float(std.mean()))
    off = np.abs(np.concatenate(ratio))
    assert np.mean(off < 1.0) == pytest.approx(0.683, abs=0.07)
    assert np.mean(off < 2.0) == pytest.approx(0.954, abs=0.035)
    assert np.mean(size) < {0: 0.45, 3: 0.32, 8: 0.16}[known]


@pytest.mark.parametrize("larger", [1.0, 4.0])
def test_errors_beyond_any_group_of_the_prior_are_learned_and_stated(
    unknown: Correction, larger: float
) -> None:
    variables, error, group, touch = groups(100, 4)
    error = larger * error
    off: dict[bool, list[Floats]] = {True: [], False: []}
    size: dict[bool, list[float]] = {True: [], False: []}
    for each in range(100):
        rows = np.flatnonzero(group == each)
        used, rest = rows[:24], rows[24:]
        known = unknown.terms(variables[used]), error[used], np.full(used.size, NOISE), touch[used]
        for fitted in (True, False):
            own = (unknown.fitted(*known) if fitted else unknown).given(*known)
            expected, std = stated(own, variables[rest])
            off[fitted].append(np.abs(error[rest] - expected) / std)
            size[fitted].append(float(np.abs(error[rest] - expected).mean()))
    within, as_before = (float(np.mean(np.concatenate(off[fitted]) < 1.0)) for fitted in (True, False))
    if larger == 1.0:  # a group of the prior: nothing changes
        assert within == pytest.approx(as_before, abs=0.05)
        assert np.mean(size[True]) < 1.02 * np.mean(size[False])
    else:  # noise is 4 times larger, too, and eight touches cannot tell all of that from six weights
        assert as_before < 0.25
        assert 0.5 < within < 0.8
        assert np.mean(size[True]) < 0.95 * np.mean(size[False])


def test_one_misread_touch_widens_little_and_moves_nothing(unknown: Correction) -> None:
    variables, error, _, touch = groups(1, 2)
    terms, std = unknown.terms(variables), np.full(error.size, NOISE)
    before = unknown.fitted(terms, error, std, touch)
    without = before.given(terms, error, std, touch)
    error[:3] += 100.0 * NOISE
    after = unknown.fitted(terms, error, std, touch)
    assert after.covariance[0, 0] <= 4.0 * before.covariance[0, 0]
    at = unknown.terms(np.zeros((1, 2)))
    off = after.given(terms, error, std, touch).error(at)[0] - without.error(at)[0]
    assert abs(float(off[0])) < NOISE


def test_a_misread_touch_has_little_weight(unknown: Correction) -> None:
    variables, error, _, touch = groups(1, 2)
    terms, std = unknown.terms(variables), np.full(error.size, NOISE)
    clean = unknown.given(terms, error, std, touch)
    error[:3] += 100.0 * NOISE
    wrong = unknown.given(terms, error, std, touch)
    at = unknown.terms(np.zeros((1, 2)))
    assert abs(float((wrong.error(at)[0] - clean.error(at)[0])[0])) < NOISE
    plain = np.linalg.lstsq(terms, error, rcond=None)[0]
    assert abs(float((at @ plain)[0] - clean.error(at)[0][0])) > NOISE


def test_windows_of_one_touch_count_as_one(unknown: Correction) -> None:
    terms = unknown.terms(np.zeros((30, 2)))
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
        known = {each: (terms[group < each], error[group < each], std[group < each]) for each in (1, 8)}
        learned = {
            "none": unknown,
            "same": unknown.given(*known[1], touch[group < 1]),
            "one": unknown.of_the_build(*known[1], touch[group < 1], group[group < 1]),
            "eight": unknown.of_the_build(*known[8], touch[group < 8], group[group < 8]),
        }
        for name, each in learned.items():
            expected, uncertain = each.error(terms[group == 9])
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
