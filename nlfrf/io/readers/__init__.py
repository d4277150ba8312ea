"""Readers of file formats: named channels of any file.

clock           names of clocks; the sampling frequency of a time axis
columns         Parquet and Feather
hdf5            HDF5: datasets, tables, attributes
header          names, units and clocks in the rows above the numbers of a text table
layout          place and separators of the numbers in a text table
matlab          MATLAB: files of any version, each by its library
matlab_v5       MATLAB up to v7: variables, structs, Simulink scopes, dSPACE recordings
mdf             MDF of cars and test benches
names           the grammar of names and units, with its tables of words
npy             arrays of NumPy, with or without named columns
tables          text tables: CSV of any origin, LabVIEW measurements
tdms            TDMS of LabVIEW
touchstone      Touchstone: S-parameters
twincat         text exports of TwinCAT Scope
uff             universal files, datasets of type 58
wav             sound
"""
