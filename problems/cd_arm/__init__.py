"""The mechanical construction of a CD-player arm: a measured record and its models."""
