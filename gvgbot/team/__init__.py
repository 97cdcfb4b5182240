"""Several robots in one building: what they tell each other, and what each makes of it."""
