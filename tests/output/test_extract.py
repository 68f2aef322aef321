"""What is written out of a mesh: copies of a vertex come together again, but not within a face."""

import numpy as np
import pytest

from remeshvec.output.extract import _part_corners


@pytest.mark.parametrize(
    ("target", "expected"),
    [
        ([0, 1, 2, 3, 0, 5], [0, 1, 2, 3, 0, 5]),  # of different faces
        ([0, 0, 2, 3, 4, 5], [0, 1, 2, 3, 4, 5]),  # of one face
        ([0, 0, 2, 3, 0, 5], [0, 1, 2, 3, 0, 5]),
        ([0, 1, 2, 2, 2, 2], [0, 1, 2, 3, 4, 5]),
    ],
)
def test_copies_in_one_face_stay_apart(target, expected):
    F = np.array([[0, 1, 2], [3, 4, 5]])
    target = np.array(target)
    _part_corners(F, target)
    assert target.tolist() == expected
