"""From a record to the best linear approximation: record -> spectra -> FRF and distortion level -> `Bla`.

identify          the door: from a periodic record to its `Bla`
bla               `Bla`: the FRF, its variances, its bound
realizations      realisations: refused where an input is missing or another spectrum, joined where they repeat
spectra           DFT of the periods: their means and their noise on the lines, input and output
transient         the transient: whether there is one, and local fits between the lines to take it off
frf               the FRF over realisations, its variance by noise and in total
distortion_level  the variance of one realisation, off detection lines or roughness, the smooth FRF taken off
detection_lines   even and odd levels from the lines that were not excited
calibration       what a detection line tells about an excited line, grid by grid
localfit          rational fits of the FRF in windows of lines, and the scatter they leave
neighbours        where the lines stand, and windows of them, worked out once a grid
second_opinion    detection lines held against roughness
noise_excitation  the BLA when noise was played instead of a multisine
"""
