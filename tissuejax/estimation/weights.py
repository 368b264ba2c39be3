"""What one unit of misfit means: the noise of each channel, as recorded, as estimated, or as asked for.

Channels without a recorded noise share one standard deviation per unit, so that their misfit is the plain sum of
squares; it starts as a guess and is replaced by the residuals' own (with the degrees of freedom) once a fit is there.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from tissuejax.errors import InputError, unknown
from tissuejax.recordings.recording import Channel, Sample

CHOICES = ("auto", "uniform", "relative")
GUESS = 0.01  # share of the channel's root mean square, until residuals say better


@dataclass(frozen=True)
class Weights:
    """Standard deviations by "recording/channel", SI.

    Attributes:
        std: the value in use.
        groups: for channels whose noise was not recorded, the group that shares one estimate.
    """

    std: Mapping[str, float]
    groups: Mapping[str, str] = field(default_factory=dict)

    @property
    def estimated(self) -> bool:
        """Whether any of them has to come from the residuals."""
        return bool(self.groups)

    def scaled(self, factors: Mapping[str, float]) -> "Weights":
        """Estimated groups multiplied by a factor each."""
        std = {key: s * factors.get(self.groups.get(key, ""), 1.0) for key, s in self.std.items()}
        return Weights(std, self.groups)


def noise(
    sample: Sample, names: tuple[str, ...], choice: str | Mapping[str, float] = "auto", channels: tuple[str, ...] = ()
) -> Weights:
    """The noise of all channels of the named recordings.

    Args:
        sample: what was recorded.
        names: recordings that take part.
        choice: "auto" (recorded where there is one, else one estimate per unit), "uniform" (one estimate per unit
            for all), "relative" (each channel by its own size), or the standard deviations by "recording/channel" or
            channel.
        channels: take only these channels; all if empty.

    Raises:
        InputError: an unknown choice or channel, a standard deviation that is not positive.
    """
    found = {
        f"{r}/{c}": (c, ch)
        for r in names
        for c, ch in sample.recordings[r].channels.items()
        if not channels or c in channels
    }
    if not found:
        raise InputError(f"no channel to fit in recordings {', '.join(names)}")
    if not isinstance(choice, str):
        return Weights({key: _given(key, name, choice) for key, (name, _) in found.items()})
    if choice not in CHOICES:
        raise unknown("choice of weights", choice, CHOICES)
    std, groups = {}, {}
    for key, (_, channel) in found.items():
        recorded = channel.noise_std
        if choice == "auto" and recorded is not None and recorded > 0:
            std[key] = float(recorded)
        else:
            groups[key] = key if choice == "relative" else channel.unit
    for group in set(groups.values()):
        members = [key for key, g in groups.items() if g == group]
        size = _size([found[key][1] for key in members])
        std |= {key: GUESS * size for key in members}
    return Weights(
        {key: std[key] for key in found}, groups if choice != "relative" else dict.fromkeys(groups, "relative")
    )


def _given(key: str, name: str, choice: Mapping[str, float]) -> float:
    value = choice.get(key, choice.get(name))
    if value is None:
        raise InputError(f"no noise given for {key}; name {key!r} or {name!r}, or use one of {', '.join(CHOICES)}")
    if not value > 0:
        raise InputError(f"noise of {key} is {value}; it must be positive")
    return float(value)


def _size(channels: list[Channel]) -> float:
    values = np.concatenate([np.asarray(c.values, float).ravel() for c in channels])
    size = float(np.sqrt(np.nanmean(values**2))) if np.isfinite(values).any() else 0.0
    return size or 1.0
