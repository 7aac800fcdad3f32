import base64
import struct

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from auvid_cli.report.page.render import PackedArrays


@given(st.lists(st.floats(width=32, allow_infinity=False)))
def test_numbers_are_read_back(values):
    arrays = PackedArrays()
    (text,) = [arrays.texts[arrays.add(np.array(values))]]
    read = struct.unpack(f"<{len(values)}f", base64.b64decode(text))
    np.testing.assert_array_equal(read, values)


def test_the_same_numbers_are_kept_once():
    arrays = PackedArrays()
    time = np.arange(5.0)
    assert [arrays.add(time), arrays.add(2.0 * time), arrays.add(time.copy())] == [0, 1, 0]
    assert len(arrays.texts) == 2


def test_what_is_too_large_is_a_gap():
    arrays = PackedArrays()
    arrays.add(np.array([1.0, 1e300, np.inf, -2.0]))
    np.testing.assert_array_equal(np.frombuffer(base64.b64decode(arrays.texts[0]), "<f4"), [1.0, np.nan, np.nan, -2.0])
