"""Data from one mesh to another, by weights of corners: arrays, tensors, and as a sparse matrix."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import FloatArray, IntArray
from ..errors import OptionError

__all__ = [
    "TRANSFER_METHODS",
    "as_matrix",
    "as_values",
    "in_kind_of",
    "interpolate",
    "is_tensor",
    "like",
    "pick",
    "to_numpy",
]

TRANSFER_METHODS = ("auto", "linear", "nearest")


def is_tensor(value: Any) -> bool:
    """Tell whether this is a tensor of PyTorch, without importing it."""
    return hasattr(value, "detach") and hasattr(value, "numpy")


def to_numpy(value: Any) -> NDArray[Any]:
    """Return the numbers of an array or tensor."""
    return np.asarray(value.detach().cpu().numpy() if is_tensor(value) else value)


def as_values(values: Any, shape: tuple[int, ...], noun: str) -> Any:
    """Check that there is one value, of any shape, for every element; tensors stay tensors."""
    try:
        array = values if is_tensor(values) else np.asarray(values)
    except (ValueError, TypeError) as error:
        raise OptionError(f"values on {noun} are not a rectangular array: {error}") from error
    if tuple(array.shape[: len(shape)]) != shape:
        wanted = ", ".join(str(n) for n in shape)
        raise OptionError(
            f"values on {noun} must have shape ({wanted}, ...), one entry for each of the "
            f"{noun}; got {tuple(array.shape)}"
        )
    return array


def interpolate(values: Any, index: IntArray, weights: FloatArray, method: str) -> Any:
    """Combine values of three elements each.

    Parameters
    ----------
    values : (k, ...) array or tensor
    index : (j, 3) int
        Elements; -1 for none, whose weights are 0.
    weights : (j, 3) float64
    method : {"auto", "linear", "nearest"}
        The weighted sum; or the value with the largest weight, the first of equal ones. ``"auto"``:
        linear for floating point numbers, nearest for all else. Linear whole numbers are rounded.

    Returns
    -------
    (j, ...)
        In the type of the values.
    """
    if is_tensor(values):
        return _interpolate_tensor(values, index, weights, method)
    is_float = values.dtype.kind in "fc"
    if method == "nearest" or (method == "auto" and not is_float):
        return pick(values, index[np.arange(len(index)), weights.argmax(axis=1)])
    if values.dtype.kind not in "fciub":
        raise OptionError(f'values of {values.dtype} cannot be added up; use method="nearest"')
    return _weighted_sum(values, index, weights)


def pick(values: Any, index: IntArray) -> Any:
    """Take elements, -1 for none: NaN where the type has it, else 0."""
    taken = values[like(values, index)]
    nowhere = np.flatnonzero(index < 0)
    if len(nowhere):
        taken = taken.clone() if is_tensor(taken) else taken.copy()
        is_float = taken.is_floating_point() if is_tensor(taken) else taken.dtype.kind in "fc"
        taken[like(values, nowhere)] = float("nan") if is_float else taken.dtype.type()
    return taken


def _weighted_sum(values: NDArray[Any], index: IntArray, weights: FloatArray) -> NDArray[Any]:
    """Add up in double precision, and return to the type of the values."""
    columns = (slice(None), *(None,) * (values.ndim - 1))
    total: NDArray[Any] = np.zeros((len(index), *values.shape[1:]), np.result_type(values, float))
    with np.errstate(invalid="ignore"):
        for corner in range(3):
            weight = weights[:, corner][columns]
            # A corner without weight does not count, even if its value is not finite.
            total += np.where(weight == 0.0, 0.0, weight * values[index[:, corner]])
    total[index[:, 0] < 0] = np.nan if values.dtype.kind in "fc" else 0
    if values.dtype.kind in "iu":
        limits = np.iinfo(values.dtype)
        return np.clip(np.rint(total), limits.min, limits.max).astype(values.dtype)
    return (total >= 0.5) if values.dtype.kind == "b" else total.astype(values.dtype, copy=False)


def _interpolate_tensor(values: Any, index: IntArray, weights: FloatArray, method: str) -> Any:
    """Do the same with a tensor; gradients flow back to the values."""
    is_float = values.is_floating_point() or values.is_complex()
    if method == "nearest" or (method == "auto" and not is_float):
        return pick(values, index[np.arange(len(index)), weights.argmax(axis=1)])
    if not is_float:
        total = _weighted_sum(to_numpy(values), index, weights)
        return like(values, total)
    weight = like(values, weights).to(values.dtype)
    weight = weight.reshape(*weights.shape, *(1,) * (values.ndim - 1))
    total = (weight * values[like(values, index)]).sum(1)
    nowhere = np.flatnonzero(index[:, 0] < 0)
    if len(nowhere):
        total[like(values, nowhere)] = float("nan")
    return total


def like(values: Any, array: NDArray[Any]) -> Any:
    """Return an array as what the values are, a tensor on the same device or an array."""
    if not is_tensor(values):
        return array
    import torch

    return torch.as_tensor(np.ascontiguousarray(array), device=values.device)


def in_kind_of(mesh: tuple[Any, Any], value: Any) -> Any:
    """Return an array or a sparse matrix as what V and F are: a tensor beside theirs, or as it is.

    Floating-point numbers get the type of V. Sparse tensors are in coordinates, through whose products
    gradients flow on every device.
    """
    given = next((x for x in mesh if is_tensor(x)), None)
    if given is None:
        return value
    import torch

    def tensor(array: NDArray[Any]) -> Any:
        made = like(given, array)
        are_reals = made.is_floating_point() and given.is_floating_point()
        return made.to(given.dtype) if are_reals else made

    if isinstance(value, np.ndarray):
        return tensor(value)
    entries = value.tocoo()
    at, numbers = tensor(np.stack(entries.coords).astype(np.int64)), tensor(entries.data)
    return torch.sparse_coo_tensor(at, numbers, entries.shape, check_invariants=True).coalesce()


def as_matrix(index: IntArray, weights: FloatArray, n: int) -> Any:
    """Return the sparse matrix (j, n) that combines ``n`` values like `interpolate`."""
    from scipy.sparse import csr_array

    used = (weights != 0.0) & (index >= 0)
    starts = np.r_[0, np.cumsum(used.sum(axis=1))]
    matrix = csr_array((weights[used], index[used], starts), shape=(len(index), n))
    matrix.sum_duplicates()
    return matrix
