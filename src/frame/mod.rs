//! Layers over a background.
