"""Controllers from Riccati equations: the least closed-loop norm (H-infinity).

design             `Design`: a controller and the level it reaches
ncfsyn             loop shaping by Glover and McFarlane
mixsyn             weighted S, K S and T made small together
hinfsyn            any generalised plant
prefilter          a loop that follows a reference model, and what the set makes of it
feedforward        the same by what is added to the input of the plant
cascade            an outer and an inner loop as one controller
reduce_controller  a controller of lower order that keeps what was proved
reduction          balanced truncation: plain, weighted, of coprime factors
dk                 D-K iteration: several uncertainties and a performance
generalised_plant  the plant made ready: hidden modes refused, scaled, regular, normalised; and K taken back
singular           problems with zeros on the axis or at infinity: controllers and lower bounds by circles beside it
central            the two Riccati equations at one level, and the central controller from them
"""
