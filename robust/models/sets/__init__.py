"""Uncertainty sets for any number of channels: forms, radii, models.

coprime          normalised coprime factors of a plant, and the plants with perturbed factors
block_weights    the smallest W_l and W_r that cover several matrices, at each frequency, by a convex program
build            `uncertainty`: the set around a nominal, from records
centre           the nominal of a set: a system, or an FRF that is known on its lines only
delta            the perturbation of a set with its weights: a number, a number for each entry, or a full block
family           sets from families of plants with several channels, and `choose_form`
family_members   the members of a family on the lines where they are compared, and their nominal
forms            the forms of uncertainty, one row each: perturbed plant, sensitivity, discs of the loop
interconnection  several uncertainties, joined by the names of their signals
joint            the probability that a whole FRF lies in the set
measured         a plant known on measured lines only: its lines, radius, hold
membership       a plant in a set at every frequency: the decision, by exact polynomials
model            `UncertaintyModel`: a nominal and the set around it, for any number of channels
orders           the number of poles of a nominal: by the loop that its set allows, or by the data
perturbations    Delta as a system, random or of a given value at a frequency, and the perturbed plant
plants           `uncertainty_of_plants`: the set that contains given plants
radius           the radius of a set about a nominal (a model or an FRF) on each line, and its parts
records          the summary of a record in a set: its lines, FRF and scatter
single_family    sets for one channel that contain given plants
"""
