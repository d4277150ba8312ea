"""Uncertainty sets: forms, radii, models of one and of several channels.

coprime          normalised coprime factors of a plant, and the plants that other factors make
evidence         what one record says of its lines, as far as a set has to remember it
forms            the ways Delta enters, one row each: plant, S_p, discs of the loop, ports
interconnection  several uncertainties, joined by the names of their signals
joint            the probability that a whole FRF lies in the set
matrix_model     `MatrixUncertainty`: sets of several inputs and outputs
matrix_radius    how wide they have to be around the nominal of a measured matrix
measured         a plant known on measured lines only: its lines, radius, hold
model            `UncertaintyModel`: the set, and how it is made from measurements
perturbations    Delta as a system, random or of a given value at a frequency, and the plant it makes
radius           how large the disc about a nominal (a model or an FRF) has to be on each line, and what it is made of
"""
