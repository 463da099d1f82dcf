"""Training by Adam with scikit-learn, for large networks."""

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import Problem, SpecError, UsageError
from fzcli.learn.levenberg_marquardt import Layers
from fzcli.learn.network import Activation
from fzcli.learn.trainers import AdamSpec

Array = NDArray[np.float64]


def train(
    inputs: Array,
    targets: Array,
    hidden: tuple[int, ...],
    activation: Activation,
    spec: AdamSpec,
    seed: int,
) -> Layers:
    """Weights and biases that map coded inputs (N, i) to coded targets (N, o).

    Raises:
        UsageError: scikit-learn is not installed.
        SpecError: the training diverged; a smaller rate is advised.
    """
    shape: dict[str, Any] = {"hidden_layer_sizes": hidden, "activation": activation, "alpha": 0.0, "random_state": seed}
    endless = {"max_iter": spec.epochs, "n_iter_no_change": spec.epochs + 1, "tol": 0.0}
    batch = {"batch_size": min(spec.batch, len(inputs)), "warm_start": True}
    network = _regressor_class()(solver="adam", **shape, **endless, **batch)
    narrow = inputs.astype(np.float32), targets.astype(np.float32)  # twice as fast; Adam's noise is far larger
    for rate in spec.rates:
        network.set_params(learning_rate_init=rate)
        _fit(network, *narrow, f"{rate:g}")
    weights = tuple(np.asarray(one, dtype=float) for one in network.coefs_)
    biases = tuple(np.asarray(one, dtype=float) for one in network.intercepts_)
    return _best_output(inputs, targets, weights, biases, activation)


def _best_output(
    inputs: Array, targets: Array, weights: tuple[Array, ...], biases: tuple[Array, ...], activation: Activation
) -> Layers:
    """The linear output layer solved in the least mean square, which takes off the noise of Adam's last batches."""
    layer = inputs
    for weight, bias in zip(weights[:-1], biases[:-1], strict=True):
        layer = layer @ weight + bias
        layer = np.tanh(layer) if activation == "tanh" else np.maximum(layer, 0)
    layer = np.hstack([layer, np.ones((len(layer), 1))])
    H = layer.T @ layer
    H += 1e-9 * float(np.trace(H)) / len(H) * np.eye(len(H))  # units that never answer have no column of their own
    last: Array = np.linalg.solve(H, layer.T @ targets).astype(float)
    return (*weights[:-1], last[:-1]), (*biases[:-1], last[-1])


def _regressor_class() -> Any:
    try:
        from sklearn.neural_network import MLPRegressor
    except ImportError:
        text = "trainer 'adam' needs scikit-learn: pip install 'fzcli[learn]'"
        raise UsageError(text) from None
    return MLPRegressor


def _fit(network: Any, inputs: NDArray[Any], targets: NDArray[Any], rate: str) -> None:
    from sklearn.exceptions import ConvergenceWarning

    with warnings.catch_warnings(), np.errstate(over="ignore", invalid="ignore"):
        warnings.simplefilter("ignore", ConvergenceWarning)  # the iterations asked for are up: no defect
        try:
            network.fit(inputs, targets)
            finite = all(np.isfinite(one).all() for one in (*network.coefs_, *network.intercepts_))
        except ValueError as error:
            if "finite" not in str(error):
                raise
            finite = False
    if not finite:
        raise SpecError(Problem(f"the training diverged at rate {rate}; make it smaller", field="trainer"))
