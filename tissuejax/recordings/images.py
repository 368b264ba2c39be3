"""The stretch of a compressed specimen from pictures of its side: its width at mid-height, by Canny edges.

The steps are the source's (Lister 2012, section 2.1.3): grey, more contrast, Canny edges, the two platens, the plane
half-way between them, where that plane meets the specimen's outline, the width there. The outline is then placed
between pixels by the slope of brightness across it, which the source left at whole pixels.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError
from tissuejax.recordings.rig import compression_stretch

Image = Float[np.ndarray, "rows columns"] | Float[np.ndarray, "rows columns rgb"]


@dataclass(frozen=True)
class Silhouette:
    """What one picture shows, in pixels.

    Attributes:
        top, bottom: rows of the two platens' faces.
        left, right: columns of the specimen's outline half-way between them.
    """

    top: float
    bottom: float
    left: float
    right: float

    @property
    def width(self) -> float:
        """Width of the specimen at mid-height, pixels."""
        return self.right - self.left

    @property
    def gap(self) -> float:
        """Distance between the platens, pixels."""
        return self.bottom - self.top


def contrasted(image: Image) -> Float[np.ndarray, "rows columns"]:
    """The picture in grey between 0 and 1, its 1 % darkest and brightest pixels saturated."""
    image = np.asarray(image, float)
    grey = image @ np.array([0.2125, 0.7154, 0.0721]) if image.ndim == 3 else image
    low, high = np.quantile(grey, [0.01, 0.99])
    if high <= low:
        raise InputError("picture without contrast: expected a specimen on a background of another brightness")
    return np.clip((grey - low) / (high - low), 0.0, 1.0)


def silhouette(image: Image, sigma: float = 1.5, platens: tuple[float, float] | None = None) -> Silhouette:
    """Platens and mid-height outline of a specimen seen from the side.

    Args:
        image: rows from the top down; grey or RGB, any range.
        sigma: width of the Gaussian before the edges are found, pixels.
        platens: rows of the two faces where they are known; otherwise the innermost long level edges are taken.

    Raises:
        InputError: no platens, or fewer than two outline points half-way between them.
    """
    from skimage.feature import canny

    grey = contrasted(image)
    edges = canny(grey, sigma=sigma)
    top, bottom = platens or _platens(grey, edges, sigma)
    middle = 0.5 * (top + bottom)
    row = int(round(middle))
    found = np.flatnonzero(edges[max(row - 1, 0) : row + 2].any(axis=0))
    if len(found) < 2:
        raise InputError(
            f"picture: {len(found)} outline points at row {row}; expected the two sides of a specimen between the "
            "platens (more contrast, or another sigma, may help)"
        )
    line = _line(grey, middle)
    return Silhouette(top, bottom, _between(line, int(found[0])), _between(line, int(found[-1])))


def stretches(images: list[Image], sigma: float = 1.5) -> Float[np.ndarray, " n"]:
    """Compression stretch l1 = 1/l2^2 in each picture, l2 being its mid-height width over that of the first.

    Source: Lister 2012, section 2.1.3, with its eq. 2.1 put right (see `rig.compression_stretch`).
    """
    widths = np.array([silhouette(image, sigma).width for image in images])
    return compression_stretch(widths / widths[0])


def metres_per_pixel(first: Silhouette, gap: float) -> float:
    """Scale of the pictures from the platens' distance in m, measured before the test."""
    if not gap > 0:
        raise InputError(f"distance between the platens {gap} m; expected a length above zero")
    return gap / first.gap


def _platens(grey: Float[np.ndarray, "rows columns"], edges: np.ndarray, sigma: float) -> tuple[float, float]:
    """Faces of the platens: the innermost rows, above and below the middle, where level edges run along a third of
    the picture's width."""
    from scipy.ndimage import gaussian_filter, sobel

    smooth = gaussian_filter(grey, sigma)
    level = edges & (np.abs(sobel(smooth, 0)) > 2 * np.abs(sobel(smooth, 1)))
    thick = level[:-1] | level[1:]
    long = np.flatnonzero(thick.sum(axis=1) > edges.shape[1] / 3)
    above, below = long[long < edges.shape[0] / 2], long[long >= edges.shape[0] / 2]
    if not len(above) or not len(below):
        raise InputError("picture: no two level platens found; expected one above and one below, or give their rows")
    # Where the specimen touches a platen there is no edge, so that those columns are left out.
    faces = [(int(above.max()), thick[above.max()]), (int(below.min()), thick[below.min()])]
    top, bottom = (_between(grey[:, columns].mean(axis=1), row) for row, columns in faces)
    return top, bottom


def _line(grey: Float[np.ndarray, "rows columns"], row: float) -> Float[np.ndarray, " columns"]:
    """Brightness along a row that may lie between two."""
    low = int(np.clip(np.floor(row), 0, len(grey) - 2))
    part = np.clip(row - low, 0.0, 1.0)
    return (1 - part) * grey[low] + part * grey[low + 1]


def _between(line: Float[np.ndarray, " n"], near: int, reach: int = 4) -> float:
    """Where brightness changes most near a pixel: the centroid of its squared slope, to a fraction of a pixel."""
    low, high = max(near - reach, 0), min(near + reach + 1, len(line) - 1)
    slope = np.square(np.diff(line[low : high + 1]))
    if slope.sum() == 0:
        return float(near)
    return float((slope * (np.arange(low, high) + 0.5)).sum() / slope.sum())
