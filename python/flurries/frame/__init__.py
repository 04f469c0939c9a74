"""One frame: what is asked of effects, what they answer, what runs, and what it costs."""
