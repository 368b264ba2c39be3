"""Single items of an HDF5 file, fetched with the checks and the messages that every item needs."""

from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from jaxtyping import Shaped

from tissuejax.errors import InputError
from tissuejax.recordings import checks

Holder = h5py.Group | h5py.Dataset
NUMBERS, WHOLE = "fiu", "iu"


@dataclass(frozen=True)
class Source:
    """The file that items come from, as messages call it."""

    label: Path

    def refusal(self, item: str, found: str, expected: str, advice: str = "") -> InputError:
        """The error for one item: this file, the item's HDF5 path, what was found, what was expected."""
        return checks.refusal(self.label, item, found, expected, advice)

    def array(
        self, place: str, found: object, shape: tuple[str | int, ...], sizes: dict[str, int], kinds: str = NUMBERS
    ) -> Shaped[np.ndarray, "..."]:
        """`found` (a dataset or an attribute's value) as an array of `shape`, floats or, for `kinds` WHOLE, integers.

        Args:
            place: HDF5 path for messages.
            found: a dataset, or any value.
            shape: fixed sizes and axis letters; a letter met before must have its earlier length.
            sizes: the letters met so far; added to.
            kinds: numpy kinds that are allowed.

        Raises:
            InputError: another type or shape, or no values at all.
        """
        try:
            values = np.asarray(found[()] if isinstance(found, h5py.Dataset) else found)
        except (OSError, ValueError, TypeError) as error:
            raise self.refusal(place, f"data that can't be read ({error})", f"shape {shape_text(shape)}") from error
        if values.dtype.kind not in kinds:
            expected = "whole numbers" if kinds == WHOLE else "numbers"
            raise self.refusal(place, f"values of type {values.dtype}", expected)
        fits = values.ndim == len(shape) and all(
            sizes.get(s, n) == n if isinstance(s, str) else s == n for s, n in zip(shape, values.shape)
        )
        if not fits:
            known = "".join(f", {s} = {sizes[s]} by the items before" for s in shape if s in sizes)
            raise self.refusal(place, f"shape {values.shape}", f"shape {shape_text(shape)}{known}")
        if values.size == 0:
            raise self.refusal(place, f"no values (shape {values.shape})", "at least one sample")
        sizes |= {s: n for s, n in zip(shape, values.shape) if isinstance(s, str)}
        return values.astype(np.int64 if kinds == WHOLE else float)

    def dataset(self, group: h5py.Group, name: str, shape: tuple, kinds: str = NUMBERS) -> Shaped[np.ndarray, "..."]:
        """A required dataset of finite numbers, on its own."""
        place = f"{path_of(group)}/{name}"
        found = group.get(name)
        if not isinstance(found, h5py.Dataset):
            what = "nothing" if found is None else "a group"
            raise self.refusal(place, what, f"a dataset of shape {shape_text(shape)}")
        values = self.array(place, found, shape, {}, kinds)
        checks.finite(values, self.label, place)
        return values

    def holder(self, group: h5py.Group, name: str) -> Holder:
        """A group or dataset that is there, for its attributes."""
        found = group[name]
        if isinstance(found, h5py.Datatype):
            raise self.refusal(f"{path_of(group)}/{name}", "a named type", "a group or a dataset")
        return found

    def text(self, holder: Holder, name: str) -> str | None:
        """A text attribute; None if it isn't there."""
        if name not in holder.attrs:
            return None
        value = plain(holder.attrs[name])
        if not isinstance(value, str):
            raise self.refusal(attribute(holder, name), f"{value!r}", "a text")
        return value

    def required_text(self, holder: Holder, name: str, expected: str = "a text") -> str:
        """A text attribute that must be there."""
        value = self.text(holder, name)
        if value is None:
            raise self.refusal(attribute(holder, name), "nothing", expected)
        return value

    def number(self, holder: Holder, name: str) -> float | None:
        """A finite number in an attribute; None if it isn't there."""
        if name not in holder.attrs:
            return None
        place = attribute(holder, name)
        value = np.asarray(holder.attrs[name])
        if value.dtype.kind not in NUMBERS or value.size != 1:
            raise self.refusal(place, f"{plain(value)!r}", "one number")
        checks.finite(value.reshape(()), self.label, place)
        return float(value.reshape(()))


def path_of(item: Holder | h5py.Datatype) -> str:
    """The HDF5 path of what was reached by one, as messages call it."""
    return item.name or ""


def attribute(holder: Holder, name: str) -> str:
    """How messages call an attribute."""
    return f"{path_of(holder)} attribute {name!r}"


def plain(value: object) -> object:
    """An attribute's value as text, number, or array."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, np.ndarray) and value.ndim == 0:
        return plain(value.item())
    if isinstance(value, np.generic):
        return plain(value.item())
    return value


def shape_text(shape: tuple[str | int, ...]) -> str:
    """`("n", 3)` as "(n, 3)"."""
    return f"({', '.join(str(s) for s in shape)}{',' if len(shape) == 1 else ''})"
