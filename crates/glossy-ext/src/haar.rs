//! The adaptive Haar basis on the octahedron (paper, section 4.2).
