"""Law of a single story: its table, and the force along a path of drifts."""

import numpy as np

from tdint.kernels import layout
from tdint.kernels.building.compilable import PLAIN, Variant
from tdint.kernels.laws.compiled import compiled_laws
from tdint.kernels.stories import law_state
from tdint.kernels.stories.law_tables import law_state_table
from tdint.model.building import assemble
from tdint.model.definition import simple_model
from tdint.model.story import simple_story
from tdint.model.story_laws import CODES, Law
from tdint.response.static.cyclic import follow_path

K, FY, HARDENING = 1000.0, 20.0, 0.05  # N/m, N, and stiffness after yielding divided by K
CYCLE = np.concatenate(
    [np.linspace(a, b, 40)[1:] for a, b in ((0, 0.06), (0.06, -0.09), (-0.09, 0.05), (0.05, 0.1))]
)


def law_table(name, *parameters):
    """Return the table `law_parameters` of a story with the initial stiffness K.

    Parameters
    ----------
    name : str
        Name of the law.
    *parameters : float
        Other parameters in the order of the law, in SI units. The last may be omitted if they have
        defaults.
    """
    parameters = Law(name, parameters).parameters
    table = np.zeros((layout.FIRST_PARAMETER + len(parameters), 2))
    table[layout.CODE, 0] = CODES[name]
    table[layout.STIFFNESS, 0] = K
    table[layout.FIRST_PARAMETER :, 0] = parameters
    return table


def law_variant(law_parameters):
    """Return the plain form of the kernels, and the law of a table of `law_table`."""
    return Variant(PLAIN, compiled_laws([law_parameters[layout.CODE, 0]]))


def follow(law_parameters, path):
    """Return the forces along a path of drifts, and the energies at its end.

    Parameters
    ----------
    law_parameters : ndarray
        Result of `law_table`.
    path : array_like
        Drifts, m, after the start at zero.

    Returns
    -------
    forces : ndarray
        Force at each drift of the path, N.
    strain_energy, hysteretic_energy : float
        Energies at the end, J.
    """
    drifts = np.array([0.0, *path])
    result = np.zeros((drifts.size, law_state.RESULT_COLUMNS))
    compiled = law_state.follow.variant(law_variant(law_parameters))
    compiled(law_parameters, 0, drifts, law_state_table(law_parameters), result)
    return (
        result[1:, law_state.SHEAR],
        result[-1, law_state.STRAIN_ENERGY],
        result[-1, law_state.HYSTERETIC_ENERGY],
    )


def along(law, drifts, **story):
    """Return the result of `follow_path` for a single story from rest.

    Parameters
    ----------
    law : Law
        Law of the story.
    drifts : array_like
        Drifts, m.
    **story
        Other arguments of `simple_story`.
    """
    building = assemble(simple_model("one", [simple_story(1.0, law, **story)]))
    return follow_path(building, 1, np.asarray(drifts, float))


def random_path(seed, largest=0.15, turns=40, points=15):
    """Return a random path of drifts, m."""
    peaks = np.random.default_rng(seed).uniform(-largest, largest, turns)
    return np.concatenate(
        [np.linspace(a, b, points)[1:] for a, b in zip([0.0, *peaks], peaks, strict=False)]
    )
