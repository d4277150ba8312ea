"""Everything that is read from a file or written to one.

records   records: MATLAB, dSPACE, CSV, NPZ, HDF5
channels  the named channels inside such a file
hdf5      HDF5 files, read in a process of their own
results   multisines, `Bla` and tables
"""
