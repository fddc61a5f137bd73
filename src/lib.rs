//! Owns the examples and the whole-pipeline tests of the workspace; there is nothing to import here.
