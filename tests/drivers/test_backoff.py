"""How long a driver waits before it tries again."""

from hypothesis import given
from hypothesis import strategies as st

from drivers.backoff import JITTER, STEPS_S, Backoff


def test_the_waits_grow_to_a_cap_and_begin_again_after_a_success():
    backoff = Backoff(chance=lambda: 0.5)
    assert [backoff.next_wait_s() for _ in range(6)] == [0.5, 1, 2, 5, 5, 5]
    backoff.reset()
    assert backoff.next_wait_s() == 0.5


@given(st.floats(0, 1), st.integers(0, 20))
def test_chance_moves_a_wait_by_its_fraction_only(chance, failures):
    backoff = Backoff(chance=lambda: chance)
    for _ in range(failures):
        backoff.next_wait_s()
    step_s = STEPS_S[min(failures, len(STEPS_S) - 1)]
    assert step_s * (1 - JITTER) - 1e-9 <= backoff.next_wait_s() <= step_s * (1 + JITTER) + 1e-9
