"""Learners behind one interface: known rows and what was measured of them in, a guess for other rows out.

mean, median    what is known, on average: what every learner must beat
inverse-k   k nearest neighbours, weighted 1 / distance (attributes scaled to their range, as in the paper)
exponential-f   all neighbours, weighted exp(-distance / f)
ridge-a     linear, its slopes held back by a
linear-C, quadratic-C   support vector regression, one a parameter, linear or second order; C: the weight of a miss
gaussian    Gaussian process: squared exponential and noise, both fitted
committee   the median of all of the above

The committee needs no choosing among them (see `evaluation`).

Source: Malone and Purwin, k-NN weights and SVM kernels; Gaussian processes and ridge are scikit-learn's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np

from gcodectl.columns import Floats

Learner: TypeAlias = Callable[[Floats, Floats, Floats], Floats]
"""X[n, columns], y[n], Z[m, columns] -> guesses[m]."""
FLAT = 1e-6
"""A deviation below this is none."""
NOISES = (0.1, 0.3, 1.0)
"""Of a Gaussian process, as a share of the target's variance."""
NEAR = 1e-3
"""Of the attributes' range: what is nearer than this is the same place."""


def distances(X: Floats, Z: Floats) -> Floats:
    """Return [m, n]: how far each of Z is from each of X, every column scaled to its range in X."""
    span = np.ptp(X, axis=0)
    scale = np.where(span > 0, span, 1.0)
    return np.asarray(np.sqrt((((Z[:, None] - X[None]) / scale) ** 2).sum(axis=2)), dtype=np.float64)


def mean(X: Floats, y: Floats, Z: Floats) -> Floats:
    """What is known, on average."""
    del X
    return np.full(len(Z), y.mean())


def median(X: Floats, y: Floats, Z: Floats) -> Floats:
    """The middle one of what is known."""
    del X
    return np.full(len(Z), np.median(y))


def _neighbours(k: int | None, weigh: Callable[[Floats], Floats]) -> Learner:
    def guess(X: Floats, y: Floats, Z: Floats) -> Floats:
        from sklearn.neighbors import KNeighborsRegressor

        if not X.shape[1]:
            return mean(X, y, Z)
        span = np.ptp(X, axis=0)
        span[span == 0] = 1.0
        # a tree, as what scikit-learn does by default starts threads for every handful of rows
        model = KNeighborsRegressor(min(k or len(X), len(X)), weights=weigh, algorithm="kd_tree").fit(X / span, y)
        return np.asarray(model.predict(Z / span), dtype=np.float64)

    return guess


def _inverse(k: int) -> Learner:
    return _neighbours(k, lambda far: 1.0 / np.maximum(far, NEAR))


def _exponential(f: float) -> Learner:
    return _neighbours(None, lambda far: np.exp(-(far - far.min(axis=1, keepdims=True)) / f))


def _scaled(make: Callable[[], object]) -> Learner:
    """Fit a scikit-learn regressor to columns and a target of mean 0 and deviation 1."""

    def guess(X: Floats, y: Floats, Z: Floats) -> Floats:
        middle, spread = float(y.mean()), float(y.std())
        if not X.shape[1] or spread < FLAT:
            return np.full(len(Z), middle)
        centre, scale = X.mean(axis=0), X.std(axis=0)
        scale[scale < FLAT] = 1.0
        model: Any = make()
        model.fit((X - centre) / scale, (y - middle) / spread)
        return np.asarray(middle + spread * model.predict((Z - centre) / scale), dtype=np.float64)

    return guess


def _ridge(a: float) -> Learner:
    def make() -> object:
        from sklearn.linear_model import Ridge

        return Ridge(alpha=a)

    return _scaled(make)


def _support(kernel: str, C: float) -> Learner:
    def make() -> object:
        from sklearn.svm import SVR

        return SVR(kernel=kernel, C=C, degree=2, coef0=1.0, gamma="scale", epsilon=0.1)

    return _scaled(make)


class _Gaussian:
    """A Gaussian process whose noise is the likeliest of NOISES, its length fixed: fast, and steady."""

    def fit(self, X: Floats, y: Floats) -> None:
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF

        length = np.sqrt(2.0 * X.shape[1])  # about how far two standardised rows are from each other
        tried = [GaussianProcessRegressor(RBF(length), alpha=noise, optimizer=None).fit(X, y) for noise in NOISES]
        self._best = max(tried, key=lambda one: float(one.log_marginal_likelihood_value_))

    def predict(self, Z: Floats) -> Floats:
        return np.asarray(self._best.predict(Z), dtype=np.float64)


SINGLE: Mapping[str, Learner] = MappingProxyType(
    {
        "mean": mean,
        "median": median,
        "inverse-1": _inverse(1),
        "inverse-5": _inverse(5),
        "exponential-0.1": _exponential(0.1),
        "exponential-0.3": _exponential(0.3),
        "exponential-1": _exponential(1.0),
        "ridge-1": _ridge(1.0),
        "ridge-10": _ridge(10.0),
        "linear-0.01": _support("linear", 0.01),
        "linear-0.1": _support("linear", 0.1),
        "quadratic-0.01": _support("poly", 0.01),
        "gaussian": _scaled(_Gaussian),
    }
)
"""The learners that look at the data themselves."""
COMMITTEE = "committee"
NAMES = (*SINGLE, COMMITTEE)


def guesses(X: Floats, y: Floats, Z: Floats) -> dict[str, Floats]:
    """Return every learner's guesses for Z, the committee's too."""
    import sklearn

    with sklearn.config_context(assume_finite=True, skip_parameter_validation=True):  # half the time of so small fits
        found = {name: learner(X, y, Z) for name, learner in SINGLE.items()}
    found[COMMITTEE] = np.median(list(found.values()), axis=0)
    return found
