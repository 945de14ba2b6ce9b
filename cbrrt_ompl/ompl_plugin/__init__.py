"""Everything that OMPL calls: space, propagators, samplers, validity, goals, and the set-up that assembles them."""
