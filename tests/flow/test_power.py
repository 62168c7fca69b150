import math

import numpy as np
import pytest

from gcodectl.flow.power import power_kernel
from gcodectl.jit import Kernel

ANY = power_kernel.py_func if isinstance(power_kernel, Kernel) else power_kernel


@pytest.mark.parametrize("kernel", [power_kernel, ANY])
@pytest.mark.parametrize("exponent", [0.2, 0.5, 1.0 / 1.96, 1.0, 1.96, 2.5, 5.0, 1.0 / 3.0, -1.5])
def test_a_power_is_that_of_the_c_library_to_a_billionth(kernel, exponent: float) -> None:  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(7)
    bases = [*np.exp(rng.uniform(-40.0, 10.0, 300)), *np.nextafter(math.sqrt(0.5), [0.0, 1.0]), 0.5, 1.0, 2.0]
    worst = max(abs(kernel(float(base), exponent) / base**exponent - 1.0) for base in bases)
    assert worst < 1e-9


@pytest.mark.parametrize(("base", "exponent"), [(1e-300, 2.5), (5e-324, 1.0), (1e-200, 8.0)])
def test_what_is_too_small_stays_small(base: float, exponent: float) -> None:
    assert 0.0 <= power_kernel(base, exponent) < 1e-290


def test_what_is_too_large_stays_large() -> None:
    assert power_kernel(1e200, 4.0) > 1e300
