//! Sparse flakes in front of the texture (Langer 2004, sections 6 and 7).
