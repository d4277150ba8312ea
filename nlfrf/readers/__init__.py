"""Measurement files of others: one room reads one kind of file.

    file -> arrays by name, their units, their clocks (a frequency or a time channel), and what in it is no signal

tables          text tables: CSV as the world writes it
layout          where header, units and numbers stand in a text table
lvm             LabVIEW measurements
matlab          MATLAB: which version it is
matlab_v5       MATLAB to v7: variables, structs, Simulink scopes, dSPACE recordings
matlab_objects  MATLAB: time series, timetables, datasets
hdf5            HDF5: datasets, tables, attributes
tdms            TDMS of LabVIEW
mdf             MDF of cars and test benches
uff             universal files, datasets of type 58
columns         Parquet and Feather
wav             sound
clock           names of clocks, the frequency of a time axis
"""
