"""What each kind of experiment records, as data: the layouts of recording format version 1.

Both the reader and the writer of HDF5 files, and the description of a file, go by these tables. A shape names its
axes: the same letter is the same length throughout one recording.
"""

from dataclasses import dataclass

from tissuejax.errors import unknown


@dataclass(frozen=True)
class Item:
    """One dataset of a recording group.

    Attributes:
        path: below the recording's group.
        shape: axis names and fixed sizes, e.g. ("n", 3).
        role: "time", "input" (what was done), "channel" (what was measured) or "attribute" (a fixed array).
        unit: SI unit.
        time: path of the item's time vector, for a channel.
        channel: the channel's name in a Recording.
        noise: whether `noise_std` may be stated.
        optional: True if the item (or the subgroup that it lies in) may be missing.
        nan: True if NaN is allowed (lost markers).
        stretch: True if the values are stretches, above zero.
    """

    path: str
    shape: tuple[str | int, ...]
    role: str
    unit: str
    time: str = ""
    channel: str = ""
    noise: bool = False
    optional: bool = False
    nan: bool = False
    stretch: bool = False


@dataclass(frozen=True)
class Scalar:
    """One number that belongs to a recording: an attribute of the subgroup or dataset `owner`, or of the group."""

    name: str
    unit: str
    owner: str = ""
    optional: bool = True

    @property
    def path(self) -> str:
        """Its key among a Recording's attributes."""
        return f"{self.owner}/{self.name}" if self.owner else self.name


def _homogeneous(kinematic: str, shape: tuple[str | int, ...], stretch: bool = True) -> tuple[Item, ...]:
    return (
        Item("time", ("n",), "time", "s"),
        Item(kinematic, shape, "input", "1", noise=True, stretch=stretch),
        Item("nominal_stress", shape, "channel", "Pa", "time", "nominal_stress", noise=True),
        Item("direction", (3,), "attribute", "1", optional=True),
        Item("normal", (3,), "attribute", "1", optional=True),
    )


_FORCE = (
    Item("force/time", ("f",), "time", "s"),
    Item("force/value", ("f", 3), "channel", "N", "force/time", "force", noise=True),
)
_MARKERS = (
    Item("markers/time", ("m",), "time", "s", optional=True),
    Item(
        "markers/position",
        ("m", "k", 3),
        "channel",
        "m",
        "markers/time",
        "markers",
        noise=True,
        optional=True,
        nan=True,
    ),
)

LAYOUTS: dict[str, tuple[Item, ...]] = {
    "uniaxial": _homogeneous("stretch", ("n",)),
    "planar": _homogeneous("stretch", ("n",)),
    "equibiaxial": _homogeneous("stretch", ("n",)),
    "biaxial": _homogeneous("stretch", ("n", 2)),
    "simple-shear": _homogeneous("shear", ("n",), stretch=False),
    "probing": (
        Item("probe/time", ("n",), "time", "s"),
        Item("probe/position", ("n", 3), "input", "m"),
        *_FORCE,
        *_MARKERS,
        # The circuit tells when the tip touched; no model predicts a voltage, so it's an input.
        Item("contact/time", ("c",), "time", "s", optional=True),
        Item("contact/voltage", ("c",), "input", "V", optional=True),
    ),
    "cutting": (
        Item("blade/time", ("n",), "time", "s"),
        Item("blade/tip", ("n", 3), "input", "m"),
        Item("blade/profile", ("p", 2), "attribute", "m"),
        Item("depth", ("n",), "input", "m", optional=True),
        *_FORCE,
        *_MARKERS,
    ),
}
SCALARS: dict[str, tuple[Scalar, ...]] = {
    # a tip with an edge is a flat punch, one without is a ball
    "probing": (Scalar("radius", "m", "probe", optional=False), Scalar("edge", "m", "probe")),
    "cutting": (Scalar("thickness", "m", "blade", optional=False),),
}
SPECIMEN = (Scalar("area", "m^2"), Scalar("height", "m"), Scalar("diameter", "m"))
NEEDS_GEOMETRY = ("probing", "cutting")
CELL_NODES = {"hexahedron": 8, "tetra": 4}


def layout(experiment: str) -> tuple[Item, ...]:
    """The items of an experiment kind.

    Raises:
        InputError: an unknown kind; the nearest are offered.
    """
    if experiment not in LAYOUTS:
        raise unknown("experiment kind", experiment, LAYOUTS)
    return LAYOUTS[experiment]


def scalars(experiment: str) -> tuple[Scalar, ...]:
    """The numbers that may or must go with a recording of an experiment kind."""
    return (*SCALARS.get(experiment, ()), *SPECIMEN)
