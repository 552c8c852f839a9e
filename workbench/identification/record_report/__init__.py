"""Is a record fit to be estimated from: each assumption tested, and what was found."""
