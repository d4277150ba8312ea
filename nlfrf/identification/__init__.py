"""From a record to the best linear approximation: record -> spectra -> FRF and distortion level -> `Bla`.

identify          the door: from a periodic record to its `Bla`
bla               `Bla`: the FRF, its variances, its bound
realizations      whether they are excited and belong together
spectra           period means and their noise on the lines
transient         whether there is one, what to do about it, and taking it off
frf               the FRF over realisations, its variance by noise and in total
distortion_level  which lines tell the distortion of one realisation, and how much it is
detection_lines   even and odd levels from the lines that were not excited
calibration       what a detection line tells about an excited line, grid by grid
localfit          the FRF fitted over its neighbours: the roughness that is left
neighbours        where the lines stand, and windows of them, worked out once a grid
second_opinion    detection lines held against roughness
noise_excitation  the BLA when noise was played instead of a multisine
"""
