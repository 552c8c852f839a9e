"""Where method "fixed" starts: one module for each rule, and the choice among what they find."""
