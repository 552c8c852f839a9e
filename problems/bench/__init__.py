"""Problems that measure the workbench itself: ratios within one run; of first answers the time."""
