"""Readers of file formats: named channels of any file.

clock           names that give a sampling frequency; the sampling frequency of a time axis
columns         Parquet and Feather
hdf5            HDF5: datasets, tables, attributes
header          names, units and clocks that the rows above the numbers of a text table state
layout          where the numbers stand in a text table, and what separates them
matlab          MATLAB: which version it is
matlab_v5       MATLAB to v7: variables, structs, Simulink scopes, dSPACE recordings
mdf             MDF of cars and test benches
names           the grammar of names and units, with its tables of words
npy             arrays of NumPy, with or without named columns
tables          text tables: CSV as the world writes it, LabVIEW measurements
tdms            TDMS of LabVIEW
touchstone      Touchstone: S-parameters
twincat         text exports of TwinCAT Scope
uff             universal files, datasets of type 58
wav             sound
"""
