"""A suspension that ages: one controller for all of its life, or one for what each start finds."""
