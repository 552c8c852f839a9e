"""The ground of every room: arrays, compilation, remembered results, imports on demand, tables."""
