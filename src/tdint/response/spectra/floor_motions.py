"""Floor motions of a run as records, and floor response spectra for equipment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tdint.arrays import Numbers
from tdint.errors import UsageError
from tdint.ground_motion.record import SI_LOCATION, Record
from tdint.number_parsing import pluralize
from tdint.response.runs.outcome import Response
from tdint.response.spectra.elastic import Spectrum, spectrum
from tdint.tabular import Tabular

if TYPE_CHECKING:
    from tdint.model.definition import Model

ROOF = "roof"
_CHANNEL = "HNX"  # channel code of a floor if the ground motion has no code of an accelerometer


@dataclass(frozen=True, repr=False)
class FloorSpectrum(Tabular):
    """Elastic response spectrum of the absolute acceleration of a floor or an attachment; floors
    are numbered from 1 at the bottom.

    Attributes
    ----------
    floor : int or str
        Floor, from 1 at the bottom, or name of an attachment.
    spectrum : Spectrum
        Response spectrum of its absolute acceleration.
    """

    floor: int | str
    spectrum: Spectrum

    @property
    def place(self) -> str:
        """Floor, such as `floor 3`, or name of the attachment."""
        return self.floor if isinstance(self.floor, str) else f"floor {self.floor}"

    def _headline(self) -> str:
        periods = pluralize(self.spectrum.periods.size, "period")
        return f"of {self.place}, damping {self.spectrum.damping:g}, {periods}"


def floors_of(names: Sequence[str], model: Model) -> tuple[int | str, ...]:
    """Convert the names of floors to numbers; the result has no duplicates.

    Parameters
    ----------
    names : sequence of str
        Numbers of floors, from 1 at the bottom, `roof`, or names of attachments, which are not
        converted.

    Raises
    ------
    UsageError
        The building has no such floor.
    """
    stories = len(model.stories)
    attachments = [item.name for item in model.attachments]
    floors: list[int | str] = []
    for name in names:
        if name in attachments:
            floors.append(name)
            continue
        # A name that is not a number becomes 0, which is rejected below.
        floor = (
            stories
            if name == ROOF
            else int(name)
            if name.isascii() and name.isdecimal() and len(name) < 9
            else 0
        )
        if not 1 <= floor <= stories:
            raise UsageError(
                f"floor {name!r} not found; floors must be numbers from 1 to {stories}, "
                f"{', '.join([*attachments, f'or {ROOF}'])}"
            )
        floors.append(floor)
    return tuple(dict.fromkeys(floors))


def floor_motion(response: Response, floor: int | str) -> Record:
    """Return the absolute acceleration of a floor or an attachment at the time steps of a run as a
    record.

    The station code of the record is the floor (F01, ..., F10 for ten floors), and its location
    code states that it is in SI units. The channel code is the code of the ground motion if this is
    a code of an accelerometer (its second letter is N), otherwise HNX.

    Parameters
    ----------
    floor : int or str
        Floor, from 1 at the bottom, or name of an attachment (station code A01, A02, ...).

    Raises
    ------
    UsageError
        The run kept no history.
    """
    history, model = response.history, response.model
    if history is None:
        raise UsageError(
            "the motion of a floor requires a run with a response history; use run(..., "
            "history=True)"
        )
    ground = response.record
    component = ground.component if ground else ""
    channel = (
        component
        if len(component) == 3 and component.isalnum() and component[1] == "N"
        else _CHANNEL
    )
    if isinstance(floor, str):
        assert history.devices is not None
        letter, place = "A", floor
        number = [item.name for item in model.attachments].index(floor) + 1
        accelerations = history.devices.absolute_acceleration
    else:
        letter, place, number, accelerations = (
            "F",
            f"floor {floor}",
            floor,
            history.absolute_acceleration,
        )
    # The number of the floor has at least two digits, and in all floors the same number of digits.
    station = f"{letter}{number:0{max(2, len(str(len(model.stories))))}d}"
    return Record(
        acceleration=accelerations[:, number - 1],
        dt=response.dt,
        start=ground.start if ground else "",
        id=f".{station}.{SI_LOCATION}.{channel}",
        component=channel,
        source=f"{place} of {model.name}",
    )


def floor_spectra(
    response: Response,
    floors: Sequence[int | str],
    periods: Numbers,
    damping: Numbers | Sequence[str] = (0.05,),
) -> tuple[FloorSpectrum, ...]:
    """Compute elastic response spectra of the absolute accelerations of floors.

    The spectra are exact for floor accelerations that are linear between the time steps of the run.

    Parameters
    ----------
    response : Response
        Response with its history.
    floors : sequence of int or str
        Floors, from 1 at the bottom, `roof`, or names of attachments.
    periods : ndarray, shape (k,)
        Periods, s. At period 0, the result is the maximum absolute acceleration of the floor at the
        time steps.
    damping : sequence of float, default 0.05
        Damping ratios.

    Returns
    -------
    tuple of FloorSpectrum
        One per floor and damping ratio.

    Raises
    ------
    UsageError, AnalysisError
        As by `spectrum`; or the response has no history, or a floor does not exist.
    """
    places = floors_of([str(floor) for floor in floors], response.model)
    motions = [(floor, floor_motion(response, floor)) for floor in places]
    return tuple(
        FloorSpectrum(floor, spectrum(motion, periods, ratio))
        for floor, motion in motions
        for ratio in damping
    )
