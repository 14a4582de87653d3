//! Tests of the whole growth from within.
