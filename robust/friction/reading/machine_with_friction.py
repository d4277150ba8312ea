"""A class of friction from measured levels: from their BLAs, from their records, or from an
identified fit.
"""

from __future__ import annotations

from collections.abc import Sequence

from nlfrf import Bla, Record
from nlfrf._base.arguments import as_list, short_form
from robust._base.channels import is_single
from robust.friction.reading.assumed_class import MachineWithFriction, assume_class
from robust.friction.reading.friction_fit import FrictionFit
from robust.friction.reading.from_blas import read_blas
from robust.friction.reading.from_fit import read_fit
from robust.friction.reading.identification import identify_friction


def machine_with_friction(
    blas: Sequence[Bla] | Sequence[Record] | FrictionFit,
    *,
    nominal: object = None,
    stiction: float = 1.5,
    margin: float = 1.25,
    free: bool = False,
    masses: int = 1,
) -> MachineWithFriction:
    """Return a linear plant and a class of friction from measurements at three levels or more.

    Use this before `prove_friction`, if the friction law is unknown but the axis was measured at
    several levels of excitation. If you know the limits of the class, use `MaxwellSlip` directly.

    **Records** are evaluated by `identify_friction`, whose result may be given instead. The plant
    then contains a delay, and the limits of the class are the ends of 95 % intervals. Within the
    measured band the axis is one rigid mass, or a motor and a load.

    **BLAs** are evaluated level by level: 1/G = k - m w^2 + j c w + a j w/(j w + b) is fitted over
    all lines. The last term is an element that slips. The plant has no damping. Its stiffness is
    the lowest k that the highest level allows within three standard deviations, minus the decrease
    of k that a force twice as large could still cause. K0 is the sum of two parts. The first part
    is `margin` times the difference between the stiffness at rest, extrapolated from the lowest
    levels, and k of the highest level. The second part is the amount by which the stiffness of the
    plant is below that k.

    A flexible machine, or BLAs with a delay, need a `nominal`. Fit the nominal at the lowest level,
    where the friction is a spring, or at the highest level, where the friction has no stiffness.
    The differences between the levels and the nominal are then attributed to friction. A proof uses
    the nominal twice, without damping and with its damping (`MachineWithFriction.machines`).

    Parameters
    ----------
    blas : sequence of Bla, or of Record, or FrictionFit
        Measurements of one machine from force [N] to position [m], at levels from sticking to
        sliding and without a base motion. Records need several periods, to estimate the noise.
    nominal : NominalFit, control.StateSpace or FrictionPlant, optional
        Model from force to position at the place of the friction, with at least two poles more than
        zeros (``fit_nominal(blas[0], n_poles=4, n_zeros=2)``), or a plant with one friction port.
        The delay of a fit is kept. Only with BLAs.
    stiction : float
        Ratio of the largest to the smallest slip force of a slider, an assumption. For records the
        class uses the upper end of the estimate, if that is larger.
    margin : float
        Factor on the estimated presliding stiffness.
    free : bool
        True for an axis without a spring to ground. Only with records: BLAs cannot distinguish such
        a spring from friction.
    masses : int
        1 for one mass; 2 for a motor and a load with friction on both and the encoder on the motor.
        Two masses take up to half a minute, and need records.

    Returns
    -------
    MachineWithFriction

    Raises
    ------
    ValueError
        Fewer than three levels; BLAs and records together; a reversed sign; BLAs with a delay or
        with a misfit that the model does not explain; two lowest levels that are equal, or whose
        stiffnesses differ so much that neither level sticks; a highest level that still sticks. For
        records also an open question about the machine or K0 (`FrictionFit.questions`).

    References
    ----------
    "The impact of nonlinear friction on frequency response function measurements".

    Examples
    --------
    >>> machine_with_friction([])
    Traceback (most recent call last):
        ...
    ValueError: blas must hold at least three levels, from sticking to sliding, got 0
    >>> import nlfrf
    >>> axis, grid = nlfrf.servo_axis("linear motor"), dict(fs=4000, n_samples=4000, f_min=2, f_max=300)
    >>> played = [nlfrf.multisine("special-odd", rms=rms, rng=3, **grid) for rms in (1, 15, 60)]
    >>> records = [nlfrf.rig.simulate_servo(axis, ms, n_periods=3, n_discard=2) for ms in played]
    >>> found = machine_with_friction(records, free=True)                    # the axis has 2 N/um
    >>> bool(2e6 < found.friction[0].K0 < 2.6e6)
    True
    """
    if isinstance(blas, FrictionFit):
        return assume_class(read_fit(blas), stiction=stiction, margin=margin)
    levels: list[object] = as_list(blas)
    records = [one for one in levels if isinstance(one, Record)]
    measured = [one for one in levels if is_single(one)]
    if len(records) + len(measured) < len(levels):
        raise ValueError(
            "blas must be BLAs with one input and output, or Records, in a list, got"
            f" {short_form(blas)}"
        )
    if records and measured:
        raise ValueError(
            f"blas must be BLAs alone or Records alone, got {len(measured)} and {len(records)}:"
            " the estimate from records needs the motion, which a BLA does not contain. Use the"
            " records of all levels, or identify all of them"
        )
    if not records:
        if free:
            raise ValueError(
                "free must be left out with BLAs, which do not show whether there is a spring"
                " to ground, got True"
            )
        if masses != 1:
            raise ValueError(
                f"masses must be 1 with BLAs (for a flexible machine give a nominal), got {masses}"
            )
        return assume_class(read_blas(measured, nominal), stiction=stiction, margin=margin)
    if nominal is not None:
        raise ValueError(
            "nominal must be left out with Records, for which one or two masses are fitted, got"
            " a nominal. To use it, give BLAs: nlfrf.identify(record) for each record"
        )
    fit = identify_friction(records, free=free, masses=masses)
    return assume_class(read_fit(fit), stiction=stiction, margin=margin)
