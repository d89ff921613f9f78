"""Kernels: machine code that does what its Python does, is kept whole, and takes nothing else than it was made for."""

from __future__ import annotations

import math
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from conftest import COMPILED, law
from tomomesh.kernels.compile import Kernel, kernel
from tomomesh.kernels.native.code import Code
from tomomesh.kernels.native.linker import address_of
from tomomesh.kernels.remeshing.links import face_shape

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

compiled = pytest.mark.skipif(not COMPILED, reason="of kernels as machine code")


@kernel("Tuple((f8, i8))(f8, i8, b1)")
def scaled(value: float, times: int, back: bool) -> tuple[float, int]:
    return value * times, -times if back else times


@kernel("b1(u8, u8)")
def share_a_bit(one: int, other: int) -> bool:
    return (one & other) != 0


@kernel("void(b1[:,:,:], f4[:,::1], i8[::1])")
def count(mask: NDArray[np.bool_], weights: NDArray[np.float32], counts: NDArray[np.int64]) -> None:
    for k in range(mask.shape[0]):
        row = np.zeros(mask.shape[2], np.int64)  # memory of the kernel's own
        for j in range(mask.shape[1]):
            for i in range(mask.shape[2]):
                row[i] += mask[k, j, i] and weights[j, i] > 0
        counts[k] = row.sum()


@kernel("f8(f8)")
def twice(value: float) -> float:
    return 2 * value


@kernel("f8(f8[::1])")
def twice_the_sine_of_the_last(values: NDArray[np.float64]) -> float:
    return twice(math.sin(values[-1]))


def plain(function: Any) -> Any:
    """Return a kernel as the function that it was."""
    return function.function if COMPILED else function


class TestSameAsPython:
    @law(40)
    @given(st.floats(-1e9, 1e9), st.integers(-(2**20), 2**20), st.booleans())
    def test_scalars_and_tuples(self, value: float, times: int, back: bool) -> None:
        found = scaled(value, times, back)
        assert found == plain(scaled)(value, times, back)
        assert [type(one) for one in found] == [float, int]

    @law(40)
    @given(st.integers(0, 2**64 - 1), st.integers(0, 2**64 - 1))
    def test_unsigned_and_bool(self, one: int, other: int) -> None:
        assert share_a_bit(one, other) is plain(share_a_bit)(one, other)

    @law(40)
    @given(arrays(bool, (5, 4, 6)), arrays(np.float32, (2, 3), elements=st.floats(-1, 1, width=32)), st.booleans())
    def test_arrays_and_views(self, mask: NDArray[np.bool_], weights: NDArray[np.float32], turned: bool) -> None:
        view = mask[::2, 1::2, ::-2] if not turned else mask.transpose(1, 0, 2)[:, ::3, ::2]
        weights = np.ascontiguousarray(weights[: view.shape[1], : view.shape[2]])
        found, truth = np.zeros(len(view), np.int64), np.zeros(len(view), np.int64)
        count(view, weights, found)
        plain(count)(view, weights, truth)
        assert np.array_equal(found, truth)

    @law(40)
    @given(arrays(np.float64, 3, elements=st.floats(-9, 9)))
    def test_a_kernel_that_calls_a_kernel(self, values: NDArray[np.float64]) -> None:
        assert twice_the_sine_of_the_last(values) == pytest.approx(2 * math.sin(values[-1]), rel=1e-15, abs=0)

    def test_empty_arrays(self) -> None:
        count(np.zeros((0, 3, 2), bool), np.zeros((3, 2), np.float32), np.zeros(0, np.int64))

    def test_scalars_of_numpy(self) -> None:
        assert scaled(np.float32(0.5), np.int16(3), np.True_) == (1.5, -3)


@compiled
@pytest.mark.parametrize(
    "spoil",
    [
        lambda mask, weights, counts: (mask.astype(np.uint8), weights, counts),
        lambda mask, weights, counts: (mask[0], weights, counts),
        lambda mask, weights, counts: (mask, weights.astype(np.float64), counts),
        lambda mask, weights, counts: (mask, weights.astype(">f4"), counts),
        lambda mask, weights, counts: (mask, np.asfortranarray(weights), counts),
        lambda mask, weights, counts: (mask, weights, np.zeros(10, np.int64)[::2]),
        lambda mask, weights, counts: (mask, weights, np.frombuffer(bytes(40), np.int64)),
        lambda mask, weights, counts: (mask, weights, np.zeros(41, np.uint8)[1:].view(np.int64)),
        lambda mask, weights, counts: (mask, weights, list(counts)),
        lambda mask, weights, counts: (mask, weights, memoryview(counts)),
        lambda mask, weights, counts: (mask, weights),
        lambda mask, weights, counts: (mask, weights, counts, 1),
    ],
)
def test_other_arguments_are_refused(spoil: Callable[..., Any]) -> None:
    """Of another type, number of dimensions, order of bytes or elements; read only, askew, or no array at all."""
    with pytest.raises(TypeError):
        count(*spoil(np.zeros((5, 2, 3), bool), np.zeros((2, 3), np.float32), np.zeros(5, np.int64)))


@compiled
def test_words_are_no_numbers() -> None:
    with pytest.raises(TypeError):
        scaled("a", 2, True)  # type: ignore[arg-type]


@compiled
def test_what_the_process_lacks_is_not_linked() -> None:
    """To call it would end the process."""
    with pytest.raises(LookupError, match="no_such_function"):
        address_of(Code("entry", "environment", ("no_such_function",), b""))


class TestKept:
    code = Code("entry", "environment", ("sin", "NRT_Free"), bytes(range(256)))

    def test_code_comes_back(self) -> None:
        assert Code.unpacked(self.code.packed()) == self.code

    @law(60)
    @given(st.data())
    def test_no_byte_of_it_may_differ(self, data: st.DataObject) -> None:
        packed = bytearray(self.code.packed())
        place = data.draw(st.integers(0, len(packed) - 1))
        packed[place] ^= data.draw(st.integers(1, 255))
        assert Code.unpacked(bytes(packed)) is None
        assert Code.unpacked(bytes(packed[:place])) is None


NUMBA_TOO = """
import sys
import numpy as np
{before}
from tomomesh.kernels.remeshing.links import after, face_shape
corners = np.array([[0., 0, 0], [1, 0, 0], [0, 1, 0]])
assert ("numba" in sys.modules) is {early}
assert after(2) == 0
assert face_shape(corners, 0, 1, 2)[:3] == (0, 0, 1)
assert ("numba" in sys.modules) is {early}
import numba
@numba.njit
def grown(values):
    more = np.empty(len(values) + 1)
    more[:-1] = np.sin(values)
    more[-1] = after(5)
    return more
assert np.allclose(grown(corners[1]), [np.sin(1), 0, 0, 3])
del corners
assert face_shape(np.eye(3), 0, 1, 2)[3] > 0
"""


@compiled
@pytest.mark.parametrize("before", ["", "import numba"])
def test_numba_works_beside(before: str) -> None:
    """Imported sooner or later, Numba and our loader share its libraries in C; Numba may call our kernels."""
    face_shape(np.eye(3), 0, 1, 2)  # in the cache from here on
    program = NUMBA_TOO.format(before=before, early=bool(before))
    done = subprocess.run([sys.executable, "-W", "error", "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@compiled
def test_a_kernel_looks_like_its_function() -> None:
    assert isinstance(face_shape, Kernel)
    assert face_shape.__name__ == "face_shape"
    assert "shape_of" in (face_shape.__doc__ or "")
