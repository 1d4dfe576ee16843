"""The number of OpenBLAS threads is one inside, and what it was before outside."""

import pytest

from rotcli.models.numerics import blas_threads


def test_one_thread_inside_and_the_former_number_after_an_error():
    functions = blas_threads._functions()
    if functions is None:
        pytest.skip("numpy has no OpenBLAS of its own here")
    get, set_ = functions
    before = get()
    set_(2)
    try:
        two = get()  # 1 where OPENBLAS_NUM_THREADS limits it
        with pytest.raises(ZeroDivisionError), blas_threads.one_thread():
            assert get() == 1
            raise ZeroDivisionError
        assert get() == two
    finally:
        set_(before)


def test_another_blas_is_left_as_it_is(monkeypatch):
    monkeypatch.setattr(blas_threads, "_functions", lambda: None)
    ran = []
    with blas_threads.one_thread():
        ran.append(True)
    assert ran == [True]
