"""Formats of stored runs: arrays in NetCDF files, and the RO-Crate that describes a run's folder.

Takes datasets and runs; gives files that other programs read, and reads the datasets back.
"""
