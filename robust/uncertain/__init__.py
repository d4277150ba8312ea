"""Sets of plants: a nominal G, a weight w, and every stable Delta of gain one between them.

forms            the ways Delta enters, one row each: plant, S_p, discs of the loop, ports
coprime          normalised coprime factors of a plant, and the plants that other factors make
model            `UncertaintyModel`: the set, and how it is made from measurements
evidence         what one record says of its lines, as far as a set has to remember it
joint            the probability that a whole FRF lies in the set
radius           how large the disc about a nominal (a model or an FRF) has to be on each line, and what it is made of
matrix_model     `MatrixUncertainty`: sets of several inputs and outputs
matrix_radius    how wide they have to be around the nominal of a measured matrix
breaking         the smallest perturbation found that breaks a loop, to replay
measured         a plant known on measured lines only: its lines, radius, hold
perturbations    Delta as a system, random or of a given value at a frequency, and the plant it makes
interconnection  several uncertainties, joined by the names of their signals
"""
