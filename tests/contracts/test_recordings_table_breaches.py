"""Tables with a side file: each thing that is wrong is refused, naming its place and what is allowed."""

import pytest

from tests.contracts.recordings_made import ROWS, UNI, put
from tissuejax.errors import InputError
from tissuejax.recordings import files

BREACHES = {
    "no toml": (ROWS, "file = ", ["s.toml", "not TOML"]),
    "key": (ROWS, "colums = 1\n" + UNI, ["'colums'", "'columns'"]),
    "key in part": (ROWS, UNI + "[[part]]\nwere = {}\n", ["'were'", "'where'"]),
    "no file": (ROWS, UNI.replace('file = "t.csv"', ""), ["file", "found nothing"]),
    "file absent": (ROWS, UNI.replace("t.csv", "u.csv"), ["u.csv", "no such file"]),
    "experiment": (ROWS, UNI.replace("uniaxial", "uniaxail"), ["'uniaxail'", "'uniaxial'"]),
    "quantity": (ROWS, UNI.replace("stretch =", "strech ="), ["'strech'", "'stretch'"]),
    "column": (ROWS, UNI.replace('"P"', '"Pa"'), ["t.csv", "'Pa'", "'P'"]),
    "wrong unit": (ROWS, UNI.replace("kPa", "mm"), ["columns.nominal_stress", "'mm'", "'Pa'"]),
    "unknown unit": (ROWS, UNI.replace("kPa", "kPA"), ["'kPA'", "'kPa'"]),
    "no unit": (ROWS, UNI.replace(', unit = "kPa"', ""), ["columns.nominal_stress", "no unit"]),
    "no load": (ROWS, UNI.replace("nominal_stress", "#"), ["nothing for the load", "force"]),
    "two motions": (ROWS, UNI + 'strain = { column = "l" }', ["stretch and strain"]),
    "positive": (ROWS, 'positive = "push"\n' + UNI, ["'push'", "'tension' or 'compression'"]),
    "sign": (ROWS, UNI.replace('"kPa"', '"kPa", sign = 2'), ["sign", "1 or -1"]),
    "no height": (
        ROWS,
        UNI.replace('stretch = { column = "l"', 'displacement = { column = "l", unit = "m"'),
        ["height"],
    ),
    "no area": (ROWS, UNI.replace("nominal_stress", "force").replace("kPa", "N"), ["specimen", "area, diameter"]),
    "size zero": (ROWS, UNI + '[specimen]\nheight = "0 mm"', ["specimen.height", "above zero"]),
    "size without unit": (ROWS, UNI + "[specimen]\nheight = 3", ["specimen.height", "no unit"]),
    "size unknown": (ROWS, UNI + '[specimen]\nhight = "3 mm"', ["'hight'", "'height'"]),
    "sizes in no file": (
        ROWS,
        UNI + '[specimen]\nheight = { column = "h", unit = "mm" }\nfile = 3\nkey = "t"',
        ["specimen", "file = 3", "names of a file"],
    ),
    "noise negative": (ROWS, UNI + '[noise]\nnominal_stress = "-3 Pa"', ["noise.nominal_stress", "above zero"]),
    "noise zero": (ROWS, UNI + '[noise]\nnominal_stress = "0 Pa"', ["noise.nominal_stress", "above zero"]),
    "noise of what is not there": (ROWS, UNI + '[noise]\nforce = "3 N"', ["noise.force", "noise.nominal_stress"]),
    "attributes": (ROWS, UNI + '[attributes]\nage = "old"', ["attributes.age", "a number"]),
    "shear in tension": (ROWS, UNI.replace("stretch =", "shear ="), ["uniaxial", "shear"]),
    "one column biaxial": (ROWS, UNI.replace("uniaxial", "biaxial"), ["1 column", "two for a biaxial"]),
    "empty table": ("", UNI, ["t.csv", "empty file"]),
    "header only": ("t,l,P\n", UNI, ["t.csv", "rows", "none"]),
    "comments only": ("# a\n\n", UNI, ["t.csv", "empty table"]),
    "one row": ("t,l,P\n0,1,0\n", UNI, ["1 sample", "at least 2", "3 to be fitted"]),
    "height below the displacement": (
        ROWS,
        UNI.replace('stretch = { column = "l"', 'displacement = { column = "l", unit = "mm", sign = -1')
        + '[specimen]\nheight = "0.5 mm"',
        ["specimen.height", "0.5 mm", "shortens the specimen"],
    ),
    "short row": (ROWS + "1500,1.3\n", UNI, ["line 5", "2 cells", "expected 3"]),
    "word": (ROWS.replace("1.1", "abc"), UNI, ["line 3", "'l'", "'abc'"]),
    "missing cell": (ROWS.replace("1.1", ""), UNI, ["line 3", "'l'", "nan", "missing"]),
    "infinite": (ROWS.replace("1.1", "inf"), UNI, ["line 3", "inf"]),
    "time back": (ROWS.replace("1000", "400"), UNI, ["'t'", "index 2", "strictly increasing"]),
    "stretch zero": (ROWS.replace("1.1", "0"), UNI, ["stretch 0", "above zero"]),
    "names twice": (ROWS.replace("t,l,P", "t,l,l"), UNI, ["line 1", "'l'"]),
    "where nothing": (ROWS, UNI.replace("[columns]", "where = { l = 7 }\n[columns]"), ["keeps no row"]),
    "same name twice": (ROWS, UNI + "[[part]]\n[[part]]\n", ["'r1'", "two parts"]),
    "the same twice": (ROWS, UNI + '[[part]]\n[[part]]\nrecording = "r2"', ["r1", "r2", "identical data"]),
    "binary table": ("t,l,P\n\0\0\0", UNI, ["binary"]),
    "lowpass": (ROWS, UNI.replace("[columns]", 'lowpass = "5 Hz"\n[columns]'), ["cutoff 5 Hz", "2 samples a second"]),
    "cutting without a body": (ROWS, UNI.replace("uniaxial", "cutting"), ["tissue.length"]),
    "blade of a tension test": (ROWS, UNI + '[blade]\nthickness = "0.4 mm"', ["[blade]", "uniaxial"]),
}


@pytest.mark.parametrize("breach", BREACHES)
def test_each_breach_is_refused_with_its_place(breach, tmp_path):
    rows, text, words = BREACHES[breach]
    with pytest.raises(InputError) as refused:
        files.read(put(tmp_path, rows, text))
    for word in words:
        assert word in str(refused.value), str(refused.value)
    assert refused.value.exit_code == 2
