"""What machines and people call things: column names to quantities, header keys to specimen sizes, words to kinds."""

import re
import unicodedata

from tissuejax.errors import InputError
from tissuejax.units import factor


def _any(*patterns: str) -> str:
    return "|".join(patterns)


_PLACES = (
    "(standard|crosshead|traverse?n?|machine|actuator|grip|axial|linear|digital|absolute|probe|tip|tensile|compressive"
    "|compression)"
)
_TURNED = "(osc(illation|illatory)?|shear)"  # a rheometer's words before strain, stress, displacement
_MOVES = "displacement|disp|extension|travel|position|stroke|elongation|deflection|path|weg"


# Read in this order; the first pattern that matches the whole bare name wins.
QUANTITY_NAMES: dict[str, str] = {
    "true_strain": _any(
        r"(true|log|logarithmic|hencky|wahre)[ _]?(strain|dehnung)",
    ),
    "true_stress": _any(
        r"(true|cauchy|wahre)[ _]?(stress|spannung)",
    ),
    "time": _any(
        r"(total |elapsed |test |step |run |record )?time( ?stamp)?( s| on sample)?",
        r"t",
        r"zeit",
        r"pruefzeit",
        r"testzeit",
        r"temps",
        r"tiempo",
        r"tempo",
        r"seconds?",
    ),
    "shear": _any(
        r"(amount of )?shear( strain)?",
        r"osc(illation|illatory)? (shear )?strain",
        r"gamma",
        r"scherung",
        r"shear strain",
    ),
    "stretch": _any(
        r"stretch( ratio)?",
        r"lambda",
        r"l/l0",
        r"elongation ratio",
        r"axial stretch",
        r"streckung",
    ),
    "strain": _any(
        r"((engineering|eng|nominal|axial|tensile|compressive|compression|video|local) )?strain( \d)?",
        r"dehnung",
        r"stauchung",
        r"eps(ilon)?",
        r"deformation %",
        r"ave ?2",
        r"verformung %",
        r"strain 1",
    ),
    "nominal_stress": _any(
        r"((engineering|eng|nominal|tensile|compressive|compression|axial) )?stress",
        rf"{_TURNED} stress",
        r"(1st|first) piola( kirchhoff)?( stress)?",
        r"spannung",
        r"pk1",
        r"p11",
        r"sigma",
        r"normspannung",
        r"contrainte",
    ),
    "displacement": _any(
        rf"({_PLACES} )?({_MOVES})( z| into surface| \d)?",
        rf"{_TURNED} ({_MOVES})",
        r"(standard|traversen)?weg( abs(olut)?)?",
        r"traverse( abs(olut)?)?",
        r"verformung",
        r"traverse position",
        r"crosshead",
        r"depth",
        r"indentation( depth)?",
        r"penetration( depth)?",
        r"pd",
        r"position \(z\)",
        r"u",
        r"h",
        r"deformation",
        r"allongement",
        r"desplazamiento",
        r"verschiebung",
        r"position linear.*",
        r"displacement linear.*",
        r"extension linear.*",
        r"position z",
    ),
    "length": _any(
        r"(current |specimen |sample |grip |gauge |gage )?(length|separation|gap|height)",
        r"laenge",
        r"grip to grip separation( at .*)?",
        r"size",
    ),
    "force": _any(
        r"((standard|axial|normal|tensile|compressive|test|pruef|indentation|tip|probe) )?(force|load|kraft)",
        r"(normal )?(force|load|kraft) (z|on sample|1)",
        r"standardkraft",
        r"pruefkraft",
        r"last",
        r"f",
        r"fz",
        r"fn",
        r"force linear.*",
        r"load linear.*",
        r"carga",
        r"charge",
    ),
    "angle": _any(
        r"(shear |twist )?angle",
        r"rotation",
        r"angular (displacement|position)",
        r"winkel",
    ),
    "torque": _any(
        r"torque",
        r"moment",
        r"drehmoment",
    ),
}
# Words that say which way something goes and not what it is: the unit tells. P is a force in N, and a stress in Pa.
BY_UNIT = ("tension", "compression", "pull", "traction", "zug", "druck", "p")
# A rheometer's and a shear rig's words, where the kind of test is known to be shear.
IN_SHEAR = {"strain": "shear", "stress": "nominal_stress"}

SIZE_NAMES: dict[str, str] = {
    "height": _any(
        r"((specimen|sample|initial|original|gauge|gage|grip|starting|undeformed|mess|einspann|anfangs|proben?) ?)*"
        r"(height|length|laenge|hoehe|gap|separation|size)",
        r"l0",
        r"l 0",
        r"h0",
        r"messlaenge",
        r"einspannlaenge",
    ),
    "width": _any(
        r"((specimen|sample|initial|probe?n?) ?)*(width|breite)( of .*)?",
        r"probenbreite",
        r"b0",
    ),
    "thickness": _any(
        r"((specimen|sample|initial|probe?n?) ?)*(thickness|dicke)",
        r"probendicke",
        r"a0",
        r"d0",
    ),
    "diameter": _any(
        r"((specimen|sample|initial|probe?n?|plate|geometry) ?)*(diameter|durchmesser)",
        r"probendurchmesser",
    ),
    "area": _any(
        r"((specimen|sample|initial|original|cross ?section(al)?) ?)*(area|section|querschnitt|flaeche|cross ?section)",
        r"s0",
        r"a0",
        r"querschnittsflaeche",
    ),
    "radius": _any(
        r"(tip|indenter|probe|ball|sphere|kugel) ?radius",
        r"radius( of (the )?tip)?",
    ),
}

# What people call a kind of test: the kind of this project, and which sense counts positive where the word says so.
EXPERIMENT_WORDS: dict[str, tuple[str, str]] = {
    "tension": ("uniaxial", "tension"),
    "tensile": ("uniaxial", "tension"),
    "pull": ("uniaxial", "tension"),
    "compression": ("uniaxial", "compression"),
    "compressive": ("uniaxial", "compression"),
    "unconfined-compression": ("uniaxial", "compression"),
    "pure-shear": ("planar", ""),
    "planar-tension": ("planar", ""),
    "biaxial-tension": ("biaxial", ""),
    "equi-biaxial": ("equibiaxial", ""),
    "shear": ("simple-shear", ""),
    "simple shear": ("simple-shear", ""),
    "indentation": ("probing", "compression"),
    "indent": ("probing", "compression"),
    "probe": ("probing", "compression"),
}
# Natural words for the keys of [columns] and [specimen].
COLUMN_WORDS = {
    "load": "force",
    "gauge_length": "length",
    "gage_length": "length",
    "extension": "displacement",
    "elongation": "displacement",
    "crosshead": "displacement",
    "travel": "displacement",
    "depth": "displacement",
    "indentation": "displacement",
    "stress": "nominal_stress",
    "engineering_stress": "nominal_stress",
    "engineering_strain": "strain",
    "nominal_strain": "strain",
    "cauchy_stress": "true_stress",
    "log_strain": "true_strain",
    "shear_strain": "shear",
    "lambda": "stretch",
    "t": "time",
}
SIZE_WORDS = {
    "length": "height",
    "gauge_length": "height",
    "gage_length": "height",
    "gauge-length": "height",
    "initial_length": "height",
    "l0": "height",
    "gap": "height",
    "cross_section": "area",
    "section": "area",
    "tip_radius": "radius",
    "indenter_radius": "radius",
    "probe_radius": "radius",
}
_BRACKET = re.compile(r"^(.*?)\s*[(\[{<]\s*([^()\[\]{}<>]*)\s*[)\]}>]\s*$")
_SUFFIX = re.compile(r"^(.+?)[ _](s|sec|ms|min|mm|um|cm|m|nm|N|mN|uN|kN|nN|gf|g|Pa|kPa|MPa|GPa|deg|rad|percent|S)$")
_SLASH = re.compile(r"^(.+?)\s*(?:/|,| in )\s*([^/,\d\s][^,\s]*)$")


def bare(name: str) -> str:
    """A name for comparison: lower case, no accents (ü is ue), no punctuation but "/", one blank between words."""
    text = name.strip().lower().replace("ä", "ae").replace("ö", "oe").replace("ü", "ue").replace("ß", "ss")
    text = "".join(c for c in unicodedata.normalize("NFKD", text) if not unicodedata.combining(c))
    return re.sub(r"[\s_:.\-()]+", " ", text).strip()


def readable(unit: str) -> bool:
    """Whether a text is a unit of something that a test records."""
    if not unit.strip() or len(unit) > 14:
        return False
    for si in ("s", "m", "N", "Pa", "1", "rad", "V", "N*m", "m/s", "N/m", "degC", "m^2", "Hz", "rad/s", "1/s", "J"):
        try:
            factor(unit, si)
        except (InputError, ValueError):
            continue
        return True
    return False


def split_unit(name: str) -> tuple[str, str]:
    """A column's name without its unit, and the unit: "Load (kN)", "Zeit [s]", "force_N", "F in N", "Fz, gf"."""
    found = _BRACKET.match(name)
    if found and found[1]:
        inner = found[2].replace("Â", "")
        if readable(inner):
            return found[1], inner
        if inner in ("", "-", "#", "1"):
            return found[1], ""
    found = _SLASH.match(name) or _SUFFIX.match(name)
    if found:
        unit = {"percent": "%", "S": "s"}.get(found[2], found[2])
        if readable(unit):
            return found[1], unit
    return name, ""


def quantity_of(name: str, unit: str = "") -> str | None:
    """The quantity that a column holds, by its bare name; None where the name says nothing known."""
    text = bare(name)
    if text in BY_UNIT:
        return quantity_by_unit(unit)
    for quantity, pattern in QUANTITY_NAMES.items():
        if re.fullmatch(pattern, text) or (unit in ("%",) and re.fullmatch(pattern, f"{text} %")):
            return quantity
    return None


def quantity_by_unit(unit: str) -> str | None:
    """What a unit alone says of a load or deformation: displacement, force, nominal_stress or strain, or None."""
    if unit in ("%", "mm/mm", "m/m"):
        return "strain"
    for quantity, si in (("displacement", "m"), ("force", "N"), ("nominal_stress", "Pa")):
        try:
            factor(unit, si)
        except (InputError, ValueError):
            continue
        return quantity if unit else None
    return None


def sizes_of(key: str) -> list[str]:
    """The specimen sizes that a header key may name: none, mostly one, and two for A0 (thickness or area)."""
    text = bare(split_unit(key)[0])
    # testXpert writes its symbol behind the word: "Probendicke a0".
    short = re.sub(r"(?<=\w) [a-z]0$", "", text)
    return [size for size, pattern in SIZE_NAMES.items() if re.fullmatch(pattern, text) or re.fullmatch(pattern, short)]
