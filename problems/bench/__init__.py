"""Problems that measure the workbench itself; ratios within one run, never bare times."""
