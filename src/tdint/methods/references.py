"""Where the methods were published, in full: for papers that cite them.

A DOI stands where it was found in print beside its reference; the others are left for a library to find.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from tdint.methods.method import Method


@dataclass(frozen=True)
class Publication:
    """A publication.

    Attributes
    ----------
    authors : str
        As BibTeX takes them, `and` between them; empty where they are not known.
    place : str
        Journal with volume, number and pages, or the report.
    doi : str
        Empty where it is not known for sure.
    """

    authors: str
    year: int
    title: str
    place: str
    doi: str = ""

    @property
    def key(self) -> str:
        """First author and year: newmark1959; without authors the first long word of the title."""
        word = self.authors.partition(",")[0] or next(one for one in self.title.split() if len(one) > 6)
        return re.sub(r"\W", "", word).lower() + str(self.year)

    @property
    def text(self) -> str:
        """In one line."""
        authors = self.authors.replace(" and ", "; ")
        head = f"{authors} ({self.year}). {self.title}" if authors else f"{self.title} ({self.year})"
        return f"{head}. {self.place}." + (f" doi:{self.doi}" if self.doi else "")

    @property
    def bibtex(self) -> str:
        """An entry of BibTeX."""
        fields = {"author": self.authors, "year": str(self.year), "title": f"{{{self.title}}}"}
        fields |= {"howpublished": self.place, "doi": self.doi}
        inner = "".join(f"  {name} = {{{value}}},\n" for name, value in fields.items() if value)
        return f"@misc{{{self.key},\n{inner}}}\n"


_IMPULSE = Publication(
    "",
    2022,
    "An Implicit Unconditionally Stable Integration Method for Nonlinear Structural Dynamics and "
    "Earthquake Engineering Problems",
    "Published online 15 March 2022",
)
_EESD = "Earthquake Engineering and Structural Dynamics"
_IJNME = "International Journal for Numerical Methods in Engineering"
_NEWMARK = Publication(
    "Newmark, N. M.",
    1959,
    "A method of computation for structural dynamics",
    "Journal of the Engineering Mechanics Division, ASCE 85(EM3), 67-94",
    "10.1061/JMCEA3.0000098",
)
_FOX = Publication(
    "Fox, L. and Goodwin, E. T.",
    1949,
    "Some new methods for the numerical integration of ordinary differential equations",
    "Mathematical Proceedings of the Cambridge Philosophical Society 45(3), 373-388",
)
_HHT = Publication(
    "Hilber, H. M. and Hughes, T. J. R. and Taylor, R. L.",
    1977,
    "Improved numerical dissipation for time integration algorithms in structural dynamics",
    f"{_EESD} 5(3), 283-292",
    "10.1002/eqe.4290050306",
)
_WBZ = Publication(
    "Wood, W. L. and Bossak, M. and Zienkiewicz, O. C.",
    1980,
    "An alpha modification of Newmark's method",
    f"{_IJNME} 15(10), 1562-1566",
    "10.1002/nme.1620151011",
)
_CHUNG = Publication(
    "Chung, J. and Hulbert, G. M.",
    1993,
    "A time integration algorithm for structural dynamics with improved numerical dissipation: the "
    "generalized-alpha method",
    "Journal of Applied Mechanics 60(2), 371-375",
    "10.1115/1.2900803",
)
_COLLOCATION = Publication(
    "Hilber, H. M. and Hughes, T. J. R.",
    1978,
    "Collocation, dissipation and 'overshoot' for time integration schemes in structural dynamics",
    f"{_EESD} 6(1), 99-117",
)
_WILSON = Publication(
    "Wilson, E. L.",
    1968,
    "A computer program for the dynamic stress analysis of underground structures",
    "Report SESM 68-1, University of California, Berkeley",
)
_BATHE_WILSON = Publication(
    "Bathe, K. J. and Wilson, E. L.",
    1973,
    "Stability and accuracy analysis of direct integration methods",
    f"{_EESD} 1(3), 283-291",
    "10.1002/eqe.4290010308",
)
_ZHOU = Publication(
    "Zhou, X. and Tamma, K. K.",
    2004,
    "Design, analysis, and synthesis of generalized single step single solve and optimal algorithms for "
    "structural dynamics",
    f"{_IJNME} 59(5), 597-668",
    "10.1002/nme.873",
)
_HOUBOLT = Publication(
    "Houbolt, J. C.",
    1950,
    "A recurrence matrix solution for the dynamic response of elastic aircraft",
    "Journal of the Aeronautical Sciences 17(9), 540-550",
    "10.2514/8.1722",
)
_PARK = Publication(
    "Park, K. C.",
    1975,
    "An improved stiffly stable method for direct integration of nonlinear structural dynamic equations",
    "Journal of Applied Mechanics 42(2), 464-470",
)
_BAIG = Publication(
    "Bathe, K. J. and Baig, M. M. I.",
    2005,
    "On a composite implicit time integration procedure for nonlinear dynamics",
    "Computers and Structures 83(31-32), 2513-2524",
)
_BATHE = Publication(
    "Bathe, K. J.",
    2007,
    "Conserving energy and momentum in nonlinear dynamics: a simple implicit time integration scheme",
    "Computers and Structures 85(7-8), 437-445",
    "10.1016/j.compstruc.2006.09.004",
)
_NOH = Publication(
    "Noh, G. and Bathe, K. J.",
    2019,
    "The Bathe time integration method with controllable spectral radius: the rho-infinity-Bathe method",
    "Computers and Structures 212, 299-310",
    "10.1016/j.compstruc.2018.11.001",
)
_CHANG = Publication(
    "Chang, S. Y.",
    2002,
    "Explicit pseudodynamic algorithm with unconditional stability",
    "Journal of Engineering Mechanics 128(9), 935-947",
)
_CHEN = Publication(
    "Chen, C. and Ricles, J. M.",
    2008,
    "Development of direct integration algorithms for structural dynamics using discrete control theory",
    "Journal of Engineering Mechanics 134(8), 676-683",
    "10.1061/(ASCE)0733-9399(2008)134:8(676)",
)
_KOLAY = Publication(
    "Kolay, C. and Ricles, J. M.",
    2014,
    "Development of a family of unconditionally stable explicit direct integration algorithms with controllable "
    "numerical energy dissipation",
    f"{_EESD} 43(9), 1361-1380",
)
_DORMAND = Publication(
    "Dormand, J. R. and Prince, P. J.",
    1980,
    "A family of embedded Runge-Kutta formulae",
    "Journal of Computational and Applied Mathematics 6(1), 19-26",
    "10.1016/0771-050X(80)90013-3",
)
_KUNTZMANN = Publication(
    "Kuntzmann, J.",
    1961,
    "Neuere Entwicklungen der Methode von Runge und Kutta",
    "Zeitschrift fuer angewandte Mathematik und Mechanik 41, T28-T31",
)
_BUTCHER = Publication(
    "Butcher, J. C.",
    1964,
    "Implicit Runge-Kutta processes",
    "Mathematics of Computation 18(85), 50-64",
    "10.1090/S0025-5718-1964-0159424-9",
)
_EHLE = Publication(
    "Ehle, B. L.",
    1969,
    "On Pade approximations to the exponential function and A-stable methods for the numerical solution of "
    "initial value problems",
    "Report CSRR 2010, University of Waterloo",
)
_HAIRER = Publication(
    "Hairer, E.",
    2010,
    "Energy-preserving variant of collocation methods",
    "Journal of Numerical Analysis, Industrial and Applied Mathematics 5(1-2), 73-84",
)
_NIGAM = Publication(
    "Nigam, N. C. and Jennings, P. C.",
    1969,
    "Calculation of response spectra from strong-motion earthquake records",
    "Bulletin of the Seismological Society of America 59(2), 909-922",
)

REFERENCES: dict[str, tuple[Publication, ...]] = {
    "impulse": (_IMPULSE,),
    "impulse4": (_IMPULSE, _EHLE),
    "moment4": (_HAIRER,),
    **dict.fromkeys(("newmark", "newmark-average", "newmark-linear", "central-difference"), (_NEWMARK,)),
    "fox-goodwin": (_FOX, _NEWMARK),
    "hht": (_HHT,),
    "wbz": (_WBZ,),
    "generalized-alpha": (_CHUNG,),
    "collocation": (_COLLOCATION,),
    "wilson": (_WILSON, _BATHE_WILSON),
    "u0v0": (_ZHOU,),
    "houbolt": (_HOUBOLT,),
    "park": (_PARK,),
    "bathe": (_BAIG, _BATHE, _NOH),
    "chang": (_CHANG,),
    "cr": (_CHEN,),
    "kr-alpha": (_KOLAY,),
    "rk5": (_DORMAND,),
    "gauss4": (_KUNTZMANN, _BUTCHER),
    "exact": (_NIGAM,),
}
"""The publications of each method of ours."""


def references_of(method: Method) -> tuple[Publication, ...]:
    """The publications of a method; none for one of a plug-in, which has its `source` alone."""
    return REFERENCES.get(method.name, ())
