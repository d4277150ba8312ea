"""Sets of plants: a nominal G, a weight w, and every stable Delta of gain one between them.

forms            the four ways Delta enters, in one table
model            `UncertaintyModel`: the set, and how it is made from measurements
radius           how large the disc about the nominal has to be, and what it is made of
matrix_model     `MatrixUncertainty`: sets of several inputs and outputs
matrix_radius    how wide they have to be around the nominal of a measured matrix
breaking         the smallest perturbation found that breaks a loop, to replay
measured         a plant known on measured lines only
perturbations    plants of the set
validation       a second record held against the set
interconnection  several uncertainties, joined by the names of their signals
"""
