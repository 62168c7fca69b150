from __future__ import annotations

import numpy as np
import pytest

from gcodectl.errors import UsageError
from gcodectl.learn.ilc import Law
from gcodectl.learn.model import Model


@pytest.mark.parametrize("delay", [0.0, 0.2])
def test_l_inverts_the_model(delay):
    model = Model(1.08, 2.7, delay)
    u = np.zeros(600)
    u[100:300] = np.sin(np.arange(200) / 30) ** 2
    learned = Law(model, 0.01, gain=0.25).learn(model.predict(u, 0.01))
    np.testing.assert_allclose(learned[:500], 0.25 * u[:500], atol=1e-9)


def test_q_shifts_nothing_and_halves_its_bandwidth():
    t = np.arange(4000) * 0.01
    law = Law(Model(1.0, 1.0), 0.01)
    for frequency, gain in ((0.3, 1.0), (3.0, 0.5), (20.0, 0.0)):
        wave = np.sin(2 * np.pi * frequency * t)
        out = law.smooth(wave)[1000:3000]
        np.testing.assert_allclose(out, gain * wave[1000:3000], atol=0.01)


def test_a_causal_q_comes_late():
    step = np.repeat([0.0, 1.0], 500)
    law = Law(Model(1.0, 1.0), 0.01, causal=True)
    assert not law.smooth(step)[:500].any()
    assert law.smooth(step)[503] < 0.2


def test_a_law_that_cannot_work_is_refused():
    with pytest.raises(UsageError, match="bandwidth"):
        Law(Model(1.0, 1.0), 0.01, bandwidth=50.0)
    with pytest.raises(UsageError, match="gain"):
        Law(Model(1.0, 1.0), 0.01, gain=2.5)


def test_the_delay_can_be_put_into_the_model():
    law = Law(Model(1.0, 2.0), 0.01).with_delay(0.2)
    assert law.model == Model(1.0, 2.0, 0.2)
    assert law.gain == 0.25
