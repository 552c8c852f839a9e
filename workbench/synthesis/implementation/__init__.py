"""From a controller to a computer: reduced, sampled, in sections, in integers, exported."""
