"""The beta1/beta2-Bathe method (Malakiyeh, Shojaee and Bathe 2019, Computers and Structures 212,
289-298).

The first substep is the trapezoidal rule over gamma h. The second is

    v1 = v0 + gamma h ((1 - beta1) a0 + beta1 ag) + (1 - gamma) h ((1 - beta2) ag + beta2 a1)

and the displacements follow from the velocities with the same weights. With gamma = 1/2 the order
is 2 if beta2 = 1 - beta1.
"""

from tdint.plugin import ImplicitTableau, Parameter, composite_method


def tableau(beta1, beta2, gamma):
    """Return the weights of the values at the start, at the inner point and at the end."""
    rest = 1.0 - gamma
    return ImplicitTableau(
        inner=gamma,
        by_start=gamma * (1.0 - beta1),
        by_inner=gamma * beta1 + rest * (1.0 - beta2),
        by_end=rest * beta2,
    )


METHODS = (
    composite_method(
        "two-parameter-bathe",
        tableau,
        (
            Parameter("beta1", 1.0 / 3.0, 0.0, 1.0),
            Parameter("beta2", lambda beta1: 1.0 - beta1, 0.5, 1.0),
            Parameter("gamma", 0.5, 0.0, 1.0, low_allowed=False, high_allowed=False),
        ),
        "Malakiyeh, Shojaee and Bathe (2019)",
    ),
)
