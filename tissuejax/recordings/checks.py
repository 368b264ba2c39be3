"""What every recording must satisfy, whichever format it came in; each refusal says where, what was found, what is
expected."""

from collections.abc import Iterable, Mapping

import numpy as np
from jaxtyping import Float, Num

from tissuejax.errors import InputError
from tissuejax.recordings.recording import Recording


def refusal(file: object, item: str, found: str, expected: str, advice: str = "") -> InputError:
    """The error for one item of a file: which file, which item, what was found, what was expected, what to do."""
    return InputError(f"{file}: {item}: found {found}, expected {expected}.{' ' if advice else ''}{advice}")


LONGEST = 120  # letters of a name: it becomes a file name, with an ending and a folder before it


def named(name: str, file: object, what: str) -> None:
    """Refuse a name that can't stand in one line: too long or with control characters; of a sample, which names files
    too, also one of blanks and dots alone.
    """
    if what == "sample" and not name.strip(". "):
        raise refusal(file, f"name of a {what}", repr(name), "a name with a letter or a digit in it")
    if not name.isprintable():
        raise refusal(file, f"name of a {what}", f"{name[:60]!r}", "a name without line breaks and control characters")
    if len(name) > LONGEST:
        found = f"{len(name)} letters ({name[:40]!r}...)"
        raise refusal(file, f"name of a {what}", found, f"at most {LONGEST}", "Give it a shorter name.")


def finite(values: Num[np.ndarray, "..."], file: object, item: str, nan_allowed: bool = False) -> None:
    """Refuse NaN and infinities (`nan_allowed`: infinities alone), naming the first and how many there are."""
    bad = np.isinf(values) if nan_allowed else ~np.isfinite(values)
    if bad.any():
        first = tuple(int(i) for i in np.argwhere(bad)[0])
        where = f" at index {first[0] if len(first) == 1 else first}" if first else ""
        allowed = "finite numbers or NaN" if nan_allowed else "finite numbers"
        raise refusal(
            file, item, f"{values[first]}{where} ({bad.sum()} in all)", allowed, "Remove or mend these samples."
        )


def increasing(time: Float[np.ndarray, " n"], file: object, item: str) -> None:
    """Refuse a time vector that is not strictly increasing, naming the first offending sample."""
    steps = np.diff(time)
    if (steps <= 0).any():
        i = int(np.argmax(steps <= 0)) + 1
        found = f"{time[i]:.9g} s at index {i} after {time[i - 1]:.9g} s ({(steps <= 0).sum()} such steps)"
        advice = "Sort the samples, drop repeats, or split the file where a new test begins."
        raise refusal(file, item, found, "strictly increasing times", advice)


def positive(
    values: Float[np.ndarray, "..."] | float, file: object, item: str, meaning: str, zero: bool = False
) -> None:
    """Refuse values that are negative, or zero unless `zero`; `meaning` says what they should be, e.g. "a length"."""
    values = np.asarray(values)
    bad = values < 0 if zero else values <= 0
    if bad.any():
        first = tuple(int(i) for i in np.argwhere(bad)[0])
        where = f" at index {first[0] if len(first) == 1 else first}" if first else ""
        raise refusal(
            file, item, f"{values[first]:.6g}{where}", f"{meaning}, {'not negative' if zero else 'above zero'}"
        )


def noise_level(value: float, file: object, item: str, unit: str) -> None:
    """Refuse a standard deviation of noise that is zero (data would weigh infinitely) or negative."""
    if not value > 0:
        advice = "Leave it out where the noise was not recorded: a fit then estimates it."
        expected = f"a standard deviation above zero{'' if unit == '1' else f', in {unit}'}"
        raise refusal(file, item, f"{value:g}", expected, advice)


def noise_levels(recordings: Mapping[str, Recording], file: object) -> None:
    """The same of every level that recordings state, whichever format they came in."""
    for name, recording in recordings.items():
        for key, channel in recording.channels.items():
            if channel.noise_std is not None:
                noise_level(channel.noise_std, file, f"recording {name}: noise_std of {key}", channel.unit)
        for key, value in recording.attributes.items():
            if key.endswith("/noise_std"):
                noise_level(value, file, f"recording {name}: {key}", "1")


def stretches(values: Float[np.ndarray, "n ..."], file: object, item: str) -> None:
    """Refuse stretches that are not above zero, guessing at the usual cause."""
    if (values <= 0).any():
        advice = "A stretch is current over original length (1 = undeformed); if these are strains, add 1 or say so."
        i = int(np.argwhere(values <= 0)[0][0])
        raise refusal(file, item, f"stretch {values.min():.6g} (first at index {i})", "stretches above zero", advice)


def shorter(displacement: Float[np.ndarray, "n ..."], height: float, file: object) -> None:
    """Refuse a specimen that is pressed together by its whole height, or by more."""
    most = float(-np.min(displacement))
    if most >= height:
        expected = f"more than the {1e3 * most:.4g} mm by which the displacement shortens the specimen"
        advice = (
            "The height is wrong, or the displacement's unit or sign, or it doesn't count from the undeformed state."
        )
        raise refusal(file, "specimen.height", f"{1e3 * height:.4g} mm", expected, advice)


def distinct(recordings: Iterable[tuple[str, Recording]]) -> None:
    """Refuse two recordings with the same data, whatever their names: it would count one measurement twice.

    Args:
        recordings: pairs of a name or label (e.g. "file.h5: r1") and a recording.

    Raises:
        InputError: which two are the same.
    """
    seen: dict[tuple, str] = {}
    for label, recording in recordings:
        arrays = {f"inputs {k}": v for k, v in recording.inputs.items()}
        arrays |= {f"channels {k}": c.values for k, c in recording.channels.items()}
        arrays |= {f"attributes {k}": v for k, v in recording.attributes.items() if k != "start"}
        key = (recording.experiment, *((k, np.asarray(arrays[k]).tobytes()) for k in sorted(arrays)))
        if key in seen:
            raise InputError(
                f"recordings {seen[key]!r} and {label!r} hold identical data: list each recording once "
                "(repeats of a test differ by noise)"
            )
        seen[key] = label
