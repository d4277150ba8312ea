"""Uncertainty sets for any number of channels: forms, radii, models.

coprime          normalised coprime factors of a plant, and the plants that other factors make
block_weights    the smallest W_l and W_r that hold several matrices, at each frequency, by a convex program
build            `uncertainty`: the set around a nominal, from records or plants
family           sets from families of plants of several channels, and `choose_form`
forms            the forms of uncertainty, a row each: perturbed plant, sensitivity, discs of the loop
interconnection  several uncertainties, joined by the names of their signals
joint            the probability that a whole FRF lies in the set
measured         a plant known on measured lines only: its lines, radius, hold
membership       whether a plant lies in a set at every frequency, by exact polynomials
model            `UncertaintyModel`: a nominal and the set around it, for any number of channels
orders           how many poles a nominal takes: by what its set allows a loop, or by what the data show
perturbations    Delta as a system, random or of a given value at a frequency, and the plant it makes
radius           how large the set about a nominal (a model or an FRF) has to be on each line, and what it is made of
records          summary of a record that a set keeps: its lines, FRF and scatter
single_family    sets of one channel that hold given plants
"""
