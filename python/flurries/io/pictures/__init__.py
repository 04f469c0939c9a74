"""Pictures: what their files say, their pixels, and how they are written and fitted."""
