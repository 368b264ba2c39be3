"""Whether whitened residuals still hold correlation."""

import math

import numpy as np
from jaxtyping import Float


def portmanteau(white: list[Float[np.ndarray, " n"]], lags: int = 20) -> float:
    """z-value of Ljung-Box's test that whitened series hold no correlation up to `lags`; about normal under the null.

    Source: Ljung and Box 1978, Biometrika 65.
    """
    q = dof = 0.0
    for x in white:
        n = len(x)
        k = min(lags, n // 4)
        if k < 1:
            continue
        x = x - np.mean(x)
        c0 = float(x @ x)
        if c0 == 0.0:
            continue
        r = np.array([float(x[i:] @ x[:-i]) / c0 for i in range(1, k + 1)])
        q += n * (n + 2) * float(np.sum(r**2 / (n - np.arange(1, k + 1))))
        dof += k
    if dof == 0:
        return 0.0
    return (((q / dof) ** (1 / 3)) - (1 - 2 / (9 * dof))) / math.sqrt(2 / (9 * dof))  # Wilson and Hilferty 1931
