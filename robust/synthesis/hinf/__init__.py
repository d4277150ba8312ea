"""H-infinity synthesis: controllers from Riccati equations.

descent            scalings of D-K iteration, improved along the gradient of the least norm
design             `Design`: a controller and the norm that it achieves
dk                 D-K iteration: several uncertainties and robust performance
generalised_plant  the plant in the form of the equations: scaled, regular, normalised, no hidden modes; and K back
hinfsyn            any generalised plant
mixsyn             least norm of weighted S, K S and T
ncfsyn             loop shaping by Glover and McFarlane
"""
