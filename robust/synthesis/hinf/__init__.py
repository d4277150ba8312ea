"""H-infinity synthesis: controllers from Riccati equations.

circles            singular problems: the axis replaced by circles on either side of it
closed             loops that are judged as given: stability and norm
descent            scalings of D-K iteration, improved along the gradient of the least norm
design             `Design`: a controller and the norm that it achieves
dk                 D-K iteration: several uncertainties and robust performance
generalised_plant  the plant in the form of the equations: scaled, regular, normalised, no hidden modes; and K back
hinfsyn            any generalised plant
mixsyn             least norm of weighted S, K S and T
ncfsyn             loop shaping by Glover and McFarlane
riccati_pair       the two equations at one level gamma, the central controller, the bisection on gamma
stiff              stiff plants: a lower bound that is free of rounding
synthesis          `Synthesis`: a controller for a generalised plant, its norm and a lower bound
unchangeable       gains that no controller changes
"""
