"""Everything that is read from a file or written to one.

records        records: MATLAB, dSPACE, CSV, NPZ, HDF5
channels       the named channels inside such a file
hdf5           HDF5 files, read in a process of their own
designs        multisines, and the signals to play
results        `Bla` and tables
stored_values  any value of this package, field by field, with its schema and version
"""
