//! Falling snow as a texture whose spectrum lies on the tent surface (Langer 2004, sections 4-7).
