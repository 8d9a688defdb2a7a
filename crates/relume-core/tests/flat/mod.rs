//! The plane: crossed strings against formulas, closed rows, and the links that follow motion against
//! links built anew.

// Formulas are measured with whatever the platform offers.
#![allow(clippy::disallowed_methods)]

mod motion;
mod orders;
mod strings;
